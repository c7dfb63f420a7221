"""`til plan`: plans, writes picture, table and instructions, and compares in a table."""

import time
from pathlib import Path

import numpy as np

from estimators.joint.expected import NO_MODEL_ERROR, REAL_CAR, expected_sd, seconds_until
from scenarios.experiment.result import Result, Row, replacing
from scenarios.planning.limits import ROADS, PlanLimits, speeds
from scenarios.planning.limits import area as of
from scenarios.planning.picture import draw
from scenarios.planning.plan import Option, Plan, Task, plan
from scenarios.planning.sheet import instructions, write_table
from scenarios.planning.wanted import shown, wanted_sd
from twin import PARAMETER, TwinError, Vehicle


def limits_of(
    *,
    area: str | None,
    road: str,
    width: float | None,
    speed: str,
    lateral: float,
    braking: float,
    jerk: float,
    steering_rate: float,
    seconds: float,
) -> PlanLimits:
    """The limits as a user gives them, the steering rate in deg/s.

    Raises:
        TwinError: one of them cannot be read or is out of range, or they exclude each other.
    """
    slow, fast = speeds(speed)
    if area is not None and (road != "straight" or width is not None):
        raise TwinError("--area: excludes --road and --width; allowed: one of them")
    length, broad = (np.inf, ROADS[road] if width is None else width) if area is None else of(area)
    return PlanLimits(
        slow=slow, fast=fast, lateral=lateral, braking=braking, jerk=jerk,
        steering_rate=float(np.radians(steering_rate)), seconds=seconds, road=road,
        width=broad, length=length,
    )  # fmt: skip


def make_plan(
    vehicle: str,
    want: str,
    limits: PlanLimits,
    *,
    differs: bool,
    evaluations: int,
    cars: int,
    jobs: int,
    seed: int,
    out: Path,
) -> tuple[Result, str]:
    """Plans and writes `plan.png`, `plan.csv` and `plan.txt`.

    Args:
        vehicle: name or file of the car.
        want: as in `mass=20kg,Jzz=5%`.
        limits: to stay within.
        differs: whether the standard deviations contain the budget of model error.
        evaluations: designs to try.
        cars: that are drawn from the prior.
        jobs: processes.
        seed: of the drawn cars.
        out: folder; it is made if it is missing.

    Returns:
        The result, and its text: the instructions and the comparison.

    Raises:
        TwinError: something is wanted or allowed that is not possible.
    """
    start = time.perf_counter()
    car = Vehicle.load(vehicle)
    task = Task(vehicle, wanted_sd(want, car), limits, REAL_CAR if differs else NO_MODEL_ERROR)
    limits.check(car)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"--out: {out} cannot be written: {error.strerror}") from error
    made = plan(
        task, evaluations=evaluations, cars=cars, jobs=jobs, seed=seed,
        journal=out / "plan.journal",
    )  # fmt: skip
    draw(made, out / "plan.png")
    write_table(made, out / "plan.csv")
    words = instructions(made)
    with replacing(out / "plan.txt") as partial:
        partial.write_text(words, encoding="utf-8")
    result = Result(
        name="plan",
        settings={
            "vehicle": vehicle,
            "want": dict(task.wanted),
            "road": limits.road if np.isinf(limits.length) else "area",
            "evaluations": made.evaluations,
            "seed": seed,
            "model_error": differs,
            "used": dict(made.planned.used),
            "notes": _notes(made, out),
        },
        seconds=time.perf_counter() - start,
        rows=_rows(made),
    )
    return result, words + "\n" + _comparison(made)


def _rows(made: Plan) -> list[Row]:
    """Seconds to each that is wanted and to all, of the plan and the standard manoeuvres."""
    found = []
    for option in (made.planned, *made.standard.values()):
        for name, seconds in _seconds(made, option).items():
            found.append(_row(option.name, name, seconds))
    if made.cars:
        found.append(
            Row.over_seeds(
                made.cars, case="plan, drawn cars", quantity="all", metric="seconds", unit="s",
                estimator="joint",
            )
        )  # fmt: skip
    return found


def _row(case: str, quantity: str, seconds: float) -> Row:
    return Row.over_seeds(
        [seconds], case=case, quantity=quantity, metric="seconds", unit="s", estimator="joint"
    )


def _seconds(made: Plan, option: Option) -> dict[str, float]:
    """Until each that is wanted is reached, and all."""
    each = {
        name: seconds_until(option.information, {name: sd}, made.task.error)[0]
        for name, sd in made.task.wanted.items()
    }
    return each | {"all": option.seconds}


def _comparison(made: Plan) -> str:
    """Seconds as a table for people: a line for each manoeuvre."""
    wanted = made.task.wanted
    heads = [f"{name} to {shown(name, sd)}" for name, sd in wanted.items()]
    heads += ["all"] * (len(wanted) > 1)
    lines = [f"{'seconds until':16}" + "".join(f"{head:>24}" for head in heads)]
    for option in (made.planned, *made.standard.values()):
        values = list(_seconds(made, option).values())[: len(heads)]
        lines.append(f"{option.name:16}" + "".join(f"{_seconds_text(v):>24}" for v in values))
    return "\n".join(lines)


def _seconds_text(seconds: float) -> str:
    return f"{seconds:.1f}" if np.isfinite(seconds) else "never"


def _notes(made: Plan, out: Path) -> list[str]:
    planned, limits = made.planned, made.task.limits
    notes = []
    if planned.seconds > limits.seconds:
        sds = expected_sd(planned.information, [limits.seconds], made.task.error)[0]
        by_name = dict(zip(planned.information.estimated, sds.tolist(), strict=True))
        reached = ", ".join(
            f"{PARAMETER[name].words} {shown(name, by_name[name])}" for name in made.task.wanted
        )
        notes.append(f"NOT REACHED within {limits.seconds:g} s; at best then: {reached}.")
    bound = [name for name, share in planned.used.items() if share > 0.9]
    if bound:
        notes.append(f"What limits the plan: {', '.join(bound)}.")
    notes.append(
        "Standard manoeuvres are on an open area within the same speeds and accelerations."
    )
    notes.append(f"Picture, table over time and instructions: {out}/plan.png, plan.csv, plan.txt.")
    return notes
