"""TiL Tables 3 to 6 and 8, and tables of all real vehicles: the paper's figures beside ours."""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from estimators.entry import Given
from estimators.joint.observer import JointSettings
from scenarios import mass, pitch, roll_yaw
from scenarios.experiment import gains_file, joint, laws, sideslip_and_mass
from scenarios.experiment.engine import rows, runs
from scenarios.experiment.experiment import INFINITE, Case, Experiment, Recipe, Run
from scenarios.experiment.reproduction import Clock, Making
from scenarios.experiment.result import Result, Row
from scenarios.experiment.sideslip_and_mass import BOUNDS, CASE, COMMONROAD, TABLE_8, TWIN
from scenarios.plants.mismatch import MISMATCHES
from scenarios.report.pictures import figure
from twin import LOAD, Drive, Vehicle


def table_3(making: Making) -> Result:
    """Our loaded chassis beside the paper's, which no point masses of Table 2 can give."""
    clock = Clock.started()
    real, nominal = (Vehicle.load(car).chassis() for car in (joint.REAL, joint.TWIN))
    # d is measured from the front axle and the road: where the chassis frame stands
    place = np.array([-1.25, 0.0, 0.644])
    quantities = (
        ("mass", "kg", real.mass, 2480.8),
        ("Jxx", "kg m2", real.inertia[0, 0], 901.9),
        ("Jyy", "kg m2", real.inertia[1, 1], 4394.4),
        ("Jzz", "kg m2", real.inertia[2, 2], 4760.0),
        ("cm_x", "cm", 100.0 * (real.cm + place)[0], -131.6),
        ("cm_y", "cm", 100.0 * (real.cm + place)[1], 1.6),
        ("cm_z", "cm", 100.0 * (real.cm + place)[2], 68.4),
    )
    found = [
        Row.over_seeds(
            [value], case="loaded chassis", quantity=name, metric="value", unit=unit,
            estimator="model", paper=paper,
        )
        for name, unit, value, paper in quantities
    ]  # fmt: skip
    return clock.result("til-table-3", making, found, nominal_mass=nominal.mass)


def table_4(making: Making) -> Result:
    """Mass."""
    return _table("til-table-4", mass.EXPERIMENT, making)


def table_5(making: Making) -> Result:
    """Roll and yaw inertia, also by the joint observer."""
    return _table("til-table-5", roll_yaw.EXPERIMENT, making, joint=True)


def table_6(making: Making) -> Result:
    """Pitch inertia, also by the joint observer."""
    return _table("til-table-6", pitch.EXPERIMENT, making, joint=True)


def _table(name: str, experiment: Experiment, making: Making, *, joint: bool = False) -> Result:
    clock = Clock.started()
    todo = runs(experiment, making.seeds, making.duration, cases=experiment.table)
    if joint:
        white = [c for c in experiment.table if c.snr < INFINITE and c.noise_on == "rates"]
        other = replace(experiment, estimators={"joint": JOINT}, limit=None)
        todo += runs(other, making.seeds, making.duration, cases=white)
    return clock.result(name, making, rows(todo, making.jobs, name))


def _joint_of_a_table(run: Run, drive: Drive, given: Given) -> Given:
    """The parameters of the load that the case does not tell; of sensors and tyres all is known."""
    del drive
    names = tuple(name for name in LOAD if name not in run.case.knows)
    return replace(
        given, parameters=names, settings=JointSettings(parameters=names, sensor_errors=())
    )


JOINT = Recipe(estimator="joint", complete=_joint_of_a_table)


def table_8(making: Making) -> Result:
    """Bounds, optima and the gains in use, the paper's optima beside; what they cost elsewhere.

    The optima are those of `til tune`, as `models/gains/tuned` has them with how the search
    converged; gains in use are others where the optima are worse on what the search did not see.
    """
    clock = Clock.started()
    found = []
    made = {estimator: _tuned(estimator) for estimator in BOUNDS}
    for estimator, tuned in made.items():
        own = sideslip_and_mass.gains_of(TWIN, estimator)
        for name, ends in tuned["made"]["bounds"].items():
            paper = TABLE_8.get(estimator, {}).get(name)
            values = {"lower bound": ends[0], "upper bound": ends[1], "in use": own[name],
                      "optimised": tuned["gains"][name]}  # fmt: skip
            found += [
                Row.over_seeds(
                    [value], case=case, quantity=name, metric="gain",
                    unit=GAIN_UNITS.get(name, "1/s"), estimator=estimator,
                    paper=paper if case == "optimised" else None,
                )
                for case, value in values.items()
            ]  # fmt: skip
        found += _costs(estimator, tuned["made"])
    _draw_convergence(making.out / "til-table-8.png", made)
    return clock.result(
        "til-table-8", making, found, made={name: tuned["made"] for name, tuned in made.items()}
    )


def _costs(estimator: str, made: dict[str, Any]) -> list[Row]:
    """What the gains found and those in use cost where they were not tuned."""
    cases = {
        "optimised": {", ".join(made["tuned_on"]): made["cost"], **made["held_out"]},
        "in use": made["held_out_before"],
    }
    return [
        Row.over_seeds(
            [value], case=f"{case}, {'tuned on' if name not in made['held_out'] else 'held out'}",
            quantity=f"cost, {name}", metric=made["metric"], unit="1", estimator=estimator,
        )
        for case, costs in cases.items()
        for name, value in costs.items()
    ]  # fmt: skip


def _draw_convergence(path: Path, made: dict[str, dict[str, Any]]) -> None:
    """The lowest cost so far over evaluations, relative to the first, of each search."""
    with figure(path, title="Tuning: lowest cost so far, over that of the first gains") as axes:
        for estimator, tuned in made.items():
            after = tuned["made"]["best_after"]
            counts = [*map(int, after), tuned["made"]["evaluations"]]
            costs = [*after.values(), tuned["made"]["cost"]]
            shares = [cost / costs[0] for cost in costs]
            axes.step(counts, shares, where="post", label=f"{estimator}, {costs[0]:.3g} at first")
        axes.set(xlabel="evaluations", ylabel="cost", ylim=(0.0, 1.05))
        axes.legend(loc="lower left")


GAIN_UNITS = {
    "ax_vx": "1",
    "ay_vy": "1",
    "mass": "kg/(m/s)",
    "yaw_rate_vy": "m/s",
    "noise_density": "m/s2/Hz^0.5",
    "drift": "kg/s^0.5",
}


def _tuned(estimator: str) -> Any:
    path = gains_file.FOLDER / "tuned" / f"{TWIN}-{estimator}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


# Errors of one force at a time: what they do to the mass does not average out
SINGLE = ("drive-5", "drive+5", "brake-5", "brake+5", "cornering_stiffness+10", "drag+10", "delay")


def joint_table(making: Making) -> Result:
    """Sideslip, mass and axle forces of every observer on every real vehicle."""
    clock = Clock.started()
    experiment = sideslip_and_mass.experiment("laps")
    forces = replace(
        experiment, estimators={**experiment.estimators, **sideslip_and_mass.AXLE_FORCES}
    )
    alone = replace(experiment, estimators={"til": experiment.estimators["til"]})
    both = ("laps", "lane-change")
    others = find_spec("vehiclemodels") is not None
    case = sideslip_and_mass.case
    todo: list[tuple[Experiment, Sequence[Case]]] = [
        (experiment, [case("same", drive) for drive in both]),
        (forces, [case(CASE, drive) for drive in both]),
        (alone, [case(vehicle, "laps") for vehicle in SINGLE]),
        *([(experiment, [case(COMMONROAD, drive) for drive in both])] if others else []),
    ]
    found = rows(
        [run for e, cases in todo for run in runs(e, making.seeds, making.duration, cases=cases)],
        making.jobs,
        "til-joint-table",
    )
    vehicles = {name: MISMATCHES[name].summary for name in ("same", CASE, *SINGLE)}
    vehicles[COMMONROAD] = (
        "BMW 320i of commonroad-vehicle-models, below 0.6 g"
        if others
        else "left out: commonroad-vehicle-models is not installed"
    )
    settings = {"snr": sideslip_and_mass.SNR, "real_vehicles": vehicles}
    return clock.result("til-joint-table", making, found, **settings)


def _all_parameters(run: Run, drive: Drive, given: Given) -> Given:
    return replace(given, parameters=joint.NAMES)


PEERS = {
    "staged": Recipe(estimator="staged", laws=laws.ALL_LAWS),
    "til-paper": Recipe(estimator="til-paper", laws=laws.ALL_PAPER_LAWS),
    **{
        name: Recipe(
            estimator=name,
            complete=lambda run, drive, given: replace(given, parameters=joint.NAMES),
        )
        for name in ("unscented", "least-squares")
    },
}
COMPARED = (("mixed", "same"), ("mixed", "all-scales"))  # by all peers
BOUNDED = (("mixed", "same"), ("hard", "same"))
OTHERS = (
    ("hard", "same"),
    ("straight", "same"),
    ("straight", "imu-bias"),
    ("urban", "all-scales"),
    (joint.LOAD_CHANGE, "same"),
)


def joint_all(making: Making) -> Result:
    """The joint observer against every real vehicle, on all drives, beside its peers."""
    clock = Clock.started()
    todo = []
    for drive, mismatch in (*(("mixed", name) for name in MISMATCHES), *OTHERS):
        # the other peers look at 37 twins, or through the whole drive many times over
        peers = dict(PEERS) if (drive, mismatch) in COMPARED else {"staged": PEERS["staged"]}
        if drive == joint.LOAD_CHANGE:
            peers = {}
        experiment = joint.experiment(drive, {**joint.RECIPES, **peers})
        if (drive, mismatch) in BOUNDED:
            experiment = replace(experiment, limit=joint.bound)
        case = joint.case(drive, mismatch)
        todo += runs(experiment, making.seeds, making.duration, cases=[case])
    found = rows(todo, making.jobs, "til-joint-all")
    return clock.result("til-joint-all", making, found, snr=joint.SNR)
