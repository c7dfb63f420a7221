"""Names of the scenarios and reproductions; what they name is imported only when it is used."""

from __future__ import annotations

import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from scenarios.experiment.result import Result

if TYPE_CHECKING:
    from twin import Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a scenario is run.

    Attributes:
        snr: signal-to-noise ratio of the sensors [dB]; inf: no noise; NaN: the scenario's noise is
            no matter of a ratio.
        seeds: one run each.
        jobs: processes side by side.
        duration: of the drive [s]; None: all of it.
        gains: file of the default estimator's gains; None: those of the project.
    """

    snr: float
    seeds: tuple[int, ...]
    jobs: int
    duration: float | None
    gains: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """How gains are chosen.

    Attributes:
        estimator: whose.
        evaluations: points to try.
        jobs: evaluations side by side.
        path: of the TOML file with the gains; the journal lies beside it.
        bounds: of gains by name, where they are not to be the estimator's own.
        cost: by name; empty: the scenario's own.
    """

    estimator: str
    evaluations: int
    jobs: int
    path: Path
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cost: str = ""

    @property
    def journal(self) -> Path:
        """What an interrupted tuning goes on from."""
        return self.path.with_suffix(".journal")


def _without_limits(*_: object) -> NoReturn:
    from twin.errors import TwinError  # not at the top: it imports NumPy

    raise TwinError("limits: this scenario has none; allowed: one of a car with a constant load")


def _without_gains(*_: object) -> NoReturn:
    from twin.errors import TwinError  # not at the top: it imports NumPy

    raise TwinError("tune: this scenario has no gains to choose; allowed: one of a car")


def _without_picture(*_: object) -> NoReturn:
    from twin.errors import TwinError  # not at the top: it imports NumPy

    raise TwinError("run: this scenario draws no picture; allowed: --png with ferrari or i3")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """What a scenario's module offers as `SCENARIO`.

    Attributes:
        run: drives over all seeds and scores.
        timeline: writes the drive of the first seed as a Rerun recording to the given path,
            whole or not at all.
        vehicle: the twin's, by its name in `models`.
        default_snr: signal-to-noise ratio unless the user names one [dB]; NaN: it takes none.
        drive: of the real vehicle, without noise; by default `til limits` says it has none.
        tune: chooses gains and writes them to a file.
        takes_gains: whether it heeds `Settings.gains`.
        picture: draws the run as PNG to the given path, whole or not at all.
        variation: by parameter what its load changes, around the twin's vehicle; as `drive`.
    """

    run: Callable[[Settings], Result]
    timeline: Callable[[Settings, Path], None]
    vehicle: str
    default_snr: float = math.nan
    drive: Callable[[Settings], Drive] = _without_limits
    variation: Callable[[], Mapping[str, float]] = _without_limits
    takes_gains: bool = False
    tune: Callable[[Tuning], Result] = _without_gains
    picture: Callable[[Settings, Path], None] = _without_picture


Reproduction = Callable[[int, int, Path], Result]
"""A paper's table or figure from (number of seeds, jobs, existing folder for pictures)."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the catalogue.

    Attributes:
        target: "module:attribute" of the `Scenario` or `Reproduction`.
        summary: one line for people.
    """

    target: str
    summary: str


_TRUCK = "scenarios.papers.truck"
SCENARIOS = {
    "mass": Entry(
        "scenarios.mass:SCENARIO", "a car in town finds the mass of the unknown 355 kg on board"
    ),
    "roll-yaw": Entry(
        "scenarios.roll_yaw:SCENARIO", "a swept steer tells the roll and yaw inertia"
    ),
    "pitch": Entry("scenarios.pitch:SCENARIO", "a rough road tells the pitch inertia"),
    "laps": Entry(
        "scenarios.laps:LAPS", "a sports car on a circuit: sideslip and mass at its limits"
    ),
    "lane-change": Entry(
        "scenarios.laps:LANE_CHANGE", "double lane changes and braking: sideslip and mass"
    ),
    "mixed": Entry(
        "scenarios.experiment.joint:MIXED",
        "two brisk minutes: all load parameters, tyres and springs at once",
    ),
    "hard": Entry("scenarios.experiment.joint:HARD", "near the limit: the same, and the friction"),
    "straight": Entry(
        "scenarios.experiment.joint:STRAIGHT", "steady straight on: a drive that tells nothing"
    ),
    "load-change": Entry(
        "scenarios.experiment.joint:LOAD_CHANGES",
        "two passengers get out at a stop, and the load is followed",
    ),
    "truck": Entry(
        "scenarios.truck:SCENARIO", "a truck's load changes twice: Kalman-Bucy filters beside TiL"
    ),
    "ferrari": Entry(
        "scenarios.ferrari:SCENARIO", "a measured lap: the sideslip of a Ferrari 250 LM"
    ),
    "weigh": Entry(
        "scenarios.weigh:SCENARIO", "a simulated car in traffic is weighed from what its bus shows"
    ),
    "i3": Entry("scenarios.i3:SCENARIO", "48 measured trips: the loads of a BMW i3"),
}

_STATES = "scenarios.papers.state_figures"
_JOINT = "scenarios.papers.joint_tables"
_TABLES, _FIGURES = "scenarios.papers.til_tables", "scenarios.papers.til_figures"
REPRODUCTIONS = {
    "til-table-3": Entry(f"{_TABLES}:table_3", "load parameters of the empty and loaded car"),
    "til-table-4": Entry(f"{_TABLES}:table_4", "mass: noise, wrong CM"),
    "til-table-5": Entry(f"{_TABLES}:table_5", "roll and yaw inertia: noise, wrong mass, wrong CM"),
    "til-table-6": Entry(
        f"{_TABLES}:table_6", "pitch inertia: noise, noisy road, wrong mass, wrong CM"
    ),
    "til-figure-4": Entry(f"{_FIGURES}:figure_4", "mass over time from several initial errors"),
    "til-figure-5": Entry(f"{_FIGURES}:figure_5", "mass error over the sensors' noise"),
    "til-figure-6": Entry(
        f"{_FIGURES}:figure_6", "roll and yaw inertia over time, CM right and wrong"
    ),
    "til-figure-7": Entry(f"{_FIGURES}:figure_7", "roll inertia error over noise"),
    "til-figure-8": Entry(f"{_FIGURES}:figure_8", "yaw inertia error over noise"),
    "til-figure-9": Entry(f"{_FIGURES}:figure_9", "pitch inertia over time"),
    "til-figure-10": Entry(f"{_FIGURES}:figure_10", "pitch inertia error over noise"),
    "til-figure-11": Entry(f"{_FIGURES}:figure_11", "pitch inertia error over the road's noise"),
    "til-table-8": Entry(f"{_STATES}:table_8", "gains of the observers of sideslip and mass"),
    "til-figure-14": Entry(f"{_STATES}:figure_14", "what the car does on the laps"),
    "til-figure-15": Entry(f"{_STATES}:figure_15", "what the car does in the lane changes"),
    "til-figure-16": Entry(f"{_STATES}:figure_16", "mass and sideslip on the laps"),
    "til-figure-17": Entry(f"{_STATES}:figure_17", "the last part of the laps"),
    "til-figure-18": Entry(f"{_STATES}:figure_18", "mass and sideslip in the lane changes"),
    "til-joint-table": Entry(
        f"{_STATES}:joint_table", "sideslip and mass of every observer on every real vehicle"
    ),
    "til-double-track-ramp": Entry(
        f"{_STATES}:ramp", "the double track's mass is a ramp: three initial errors"
    ),
    "til-joint-all": Entry(f"{_JOINT}:everything", "all drives, all real vehicles: joint observer"),
    "kbf-table-2": Entry(f"{_TRUCK}_studies:table_2", "every filter in both readings of the noise"),
    "kbf-figure-5": Entry(f"{_TRUCK}_figures:figure_5", "the truck's velocities over time"),
    "kbf-figure-6": Entry(f"{_TRUCK}_figures:figure_6", "the truck's mass and inertia over time"),
    "kbf-tuning": Entry(f"{_TRUCK}_studies:tuning", "R and Q by decades: lower R is not better"),
    "kbf-robustness": Entry(f"{_TRUCK}_studies:robustness", "filters that know the truck badly"),
}


def scenario(name: str) -> Scenario:
    """The scenario of that name in `SCENARIOS`."""
    return pkgutil.resolve_name(SCENARIOS[name].target)


def reproduction(name: str) -> Reproduction:
    """The reproduction of that name in `REPRODUCTIONS`."""
    return pkgutil.resolve_name(REPRODUCTIONS[name].target)


def limits() -> Callable[[str, Scenario, Settings], tuple[Result, str]]:
    """What gives the bounds of a scenario, by its name, as a result and as text."""
    return pkgutil.resolve_name("scenarios.papers.limits:run")


def bench() -> Callable[[], Result]:
    """What measures the speed."""
    return pkgutil.resolve_name("scenarios.cli.bench:run")


def inspection() -> Callable[[Path, Path | None, str | None], str]:
    """What tells of a log, with a map or without, as text."""
    return pkgutil.resolve_name("scenarios.logs.inspect:inspect_log")


def new_car() -> Any:
    """The module that writes new cars and tyres."""
    return import_module("scenarios.calibration.new_car")


def calibrate() -> Any:
    """The module that fits a twin to a log."""
    return import_module("scenarios.calibration.calibrate")


def estimate() -> Any:
    """The module that observes recorded drives."""
    return import_module("scenarios.logs.estimate")


def weigh() -> tuple[Any, Callable[[str], Any]]:
    """The module that weighs recorded drives, and what reads the name of a reference."""
    return import_module("scenarios.weighing.weigh"), pkgutil.resolve_name(
        "scenarios.weighing.logs:Log"
    ).parse


def estimate_stream() -> Any:
    """The module that observes samples from standard input."""
    return import_module("scenarios.logs.stream")
