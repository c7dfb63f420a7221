"""Are planned manoeuvres shorter than standard ones, and do they reach what they promise?

`til reproduce plan`. A plan's standard deviations are held against the errors of the joint observer
on cars drawn from the prior, which start it at the car of the files, with new noise each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimators.joint.expected import EVERY, expected_sd
from estimators.joint.observer import JointObserver
from scenarios.experiment.progress import parallel
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.planning.limits import PlanLimits
from scenarios.planning.picture import draw
from scenarios.planning.plan import NOISE, Option, Plan, Task, drawn, plan, told_by
from scenarios.planning.wanted import ALL, wanted_sd
from twin import OUTPUTS, PARAMETERS, TwinError

Array = NDArray[np.float64]

WANTED: Mapping[str, str] = {
    "Jzz": "Jzz=5%",
    "Jxx": "Jxx=10%",
    "cm_z": "cm_z=10mm",
    "mass": "mass=20kg",
    "all": "mass=20kg,cm_x=10mm,cm_y=10mm,cm_z=10mm,Jxx=10%,Jyy=10%,Jzz=5%",
}
LIMITS: Mapping[str, PlanLimits] = {
    "suv": PlanLimits(fast=25.0, width=50.0),
    "sports_car": PlanLimits(fast=30.0, lateral=7.0, braking=8.0, accelerating=4.0, width=50.0),
}
WHOLE = 10  # seeds from which on every car and every want is planned
EVALUATIONS = {False: 24, True: 60}
CARS = 10  # drawn, whose noise-free drives are evaluated besides


def planning(making: Making) -> Result:
    """Seconds of plans against the best standard manoeuvre, and errors over planned sds."""
    clock = Clock.started()
    whole = len(making.seeds) >= WHOLE
    pairs = [(car, want) for car in LIMITS for want in WANTED]
    if not whole:
        pairs = [("suv", "Jzz"), ("suv", "all")]
    rows = []
    for car, want in pairs:
        journal = making.out / f"plan-{car}-{want}.journal"
        made = plan(
            task_of(car, want), evaluations=EVALUATIONS[whole], cars=CARS if whole else 2,
            jobs=making.jobs, seed=making.seeds[0], journal=journal,
        )  # fmt: skip
        draw(made, making.out / ("plan.png" if want == "all" else f"plan-{car}-{want}.png"))
        rows += _rows(f"{car}, {want}", made)
        if np.isfinite(made.planned.seconds):
            jobs = [(made, seed) for seed in making.seeds]
            errors = parallel(_errors, jobs, making.jobs, f"plan: {car}, {want}")
            rows += _error_rows(f"{car}, {want}", made, np.array(errors))
    return clock.result("plan", making, rows)


def task_of(car: str, want: str) -> Task:
    """A task of the study: names of `LIMITS` and `WANTED`."""
    task = Task(car, {}, LIMITS[car])
    return replace(task, wanted=wanted_sd(WANTED[want], task.car))


def _rows(case: str, made: Plan) -> list[Row]:
    best = min(made.standard.values(), key=_seconds)
    found = [
        _row(f"{case}, plan", "seconds", "s", [_seconds(made.planned)]),
        _row(f"{case}, {best.name}", "seconds", "s", [_seconds(best)]),
        _row(case, "times_shorter", "1", [_seconds(best) / _seconds(made.planned)]),
    ]
    if made.cars:
        found.append(_row(f"{case}, drawn cars", "seconds", "s", made.cars))
    return found


def _seconds(option: Option) -> float:
    return option.seconds


def _error_rows(case: str, made: Plan, errors: Array) -> list[Row]:
    """Root mean square over seeds of the errors (seeds, wanted) over the planned sd."""
    good = errors[np.isfinite(errors).all(axis=1)]
    found = []
    for k, name in enumerate(made.task.wanted):
        size = float(np.sqrt(np.mean(good[:, k] ** 2))) if len(good) else np.nan
        row = _row(case, "error_over_planned_sd", "1", [size], name)
        found.append(replace(row, seeds=len(good), p90=_p90(good[:, k])))
    return found


def _p90(errors: Array) -> float:
    return float(np.quantile(np.abs(errors), 0.9)) if errors.size else np.nan


def _row(case: str, metric: str, unit: str, values: Sequence[float], quantity: str = "all") -> Row:
    return Row.over_seeds(
        values, case=case, quantity=quantity, metric=metric, unit=unit, estimator="joint"
    )


def _errors(pair: tuple[Plan, int]) -> Array:
    """(wanted,) of the joint observer at the planned time over the sds planned for this car."""
    made, seed = pair
    rng = np.random.default_rng([seed, 20])
    (car,) = drawn(made.task, rng, 1)
    try:
        option = told_by(made.task, made.motion, car)
    except TwinError:
        return np.full(len(made.task.wanted), np.nan)
    end = min(max(made.planned.seconds, EVERY), float(option.information.time[-1]))
    clean = option.driven.drive
    drive = clean[: round(end / clean.dt)]
    noise = np.array(NOISE) * rng.standard_normal((len(drive), len(OUTPUTS)))
    observer = JointObserver(made.task.car, NOISE)
    observer.reset(float(clean.truth["vx"][0]))
    estimate = observer.run(drive.replace(measurements=drive.measurements + noise))
    sds = expected_sd(option.information, [end], made.task.error)[0]
    by_name = dict(zip(option.information.estimated, sds.tolist(), strict=True))
    truth = dict(zip(PARAMETERS, car.tolist(), strict=True))
    return np.array([(estimate[n][-1] - truth[n]) / by_name[n] for n in made.task.wanted])


assert set(ALL) == {part.split("=")[0] for part in WANTED["all"].split(",")}
