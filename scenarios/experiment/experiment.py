"""What is driven, what is estimated, what an estimator is told and how it is scored: all data."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from estimators.base import Estimate, Estimator
from estimators.entry import Given
from estimators.til.law import ParameterLaw
from scenarios.experiment.result import Result
from twin import LOAD, SCALES, Drive, RigidBody, TwinError, Vehicle

# What a twin can be told of a load. The paper's loads leave the products of inertia alone; ours, of
# passengers and luggage behind and above the CM, do not, and a wrong Jxz alone is worth half of
# Jxx: who knows where the CM is knows where everything on board is.
MASS = ("mass",)
CM = ("cm_x", "cm_y", "cm_z", "Jxy", "Jxz", "Jyz")
INFINITE = math.inf


class Plant(Protocol):
    """A real vehicle on a drive. Plants are compared and hashed by value: drives are cached."""

    def drive(self, case: "Case", rng: np.random.Generator, duration: float | None) -> Drive:
        """The noisy drive of a case; of its first seconds only, if a duration is given [s]."""
        ...


@runtime_checkable
class HasVehicle(Protocol):
    """A plant with a car that can be drawn."""

    def vehicle(self) -> Vehicle:
        """The real vehicle at the start."""
        ...


@runtime_checkable
class CarPlant(Plant, HasVehicle, Protocol):
    """A simulated car, whose drive can be had without noise."""

    def clean(self, duration: float | None) -> Drive:
        """The drive without sensor noise."""
        ...

    def load(self, nominal: RigidBody) -> dict[str, float]:
        """What its chassis differs in from a twin's at the start, by name of `PARAMETERS`."""
        ...


@cache
def nominal_chassis(car: str) -> RigidBody:
    """The chassis of a twin's car, without load."""
    return Vehicle.load(car).chassis()


@cache
def nominal_values(car: str) -> dict[str, float]:
    """The parameters of a twin's car by name: of its chassis, and scales of one."""
    body = nominal_chassis(car)
    products = body.inertia[[0, 0, 1], [1, 2, 2]]
    load = (body.mass, *body.cm, *np.diag(body.inertia), *products)
    return dict(zip(LOAD, map(float, load), strict=True)) | dict.fromkeys(SCALES, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One real vehicle on one drive, its noise, and what the estimators are told of it.

    Attributes:
        name: in the words of the paper's row, or of the real vehicle.
        plant: the real vehicle and its drive.
        twin: the car of `models` that the estimators' twins are; empty: the plant is no car.
        snr: signal-to-noise ratio of the sensors [dB]; NaN: the noise is not a matter of a ratio.
        noise_on: where TiL Eq. (10) enters: the sensors' rates or, as Section 4.3 can be read, the
            angular accelerations, of which the noise of the rates is then the integral.
        road_noise: half width of TiL Eq. (17) on the road that the estimators are told.
        knows: parameters of the load that the estimators are told.
        initial: what they believe of other parameters at the start, as deltas; zero by default.
        paper: the paper's figures by (quantity, metric).
        measured: whether the drive is a log, to which no seed adds noise.
    """

    name: str = field(compare=False)
    plant: Plant
    twin: str = ""
    snr: float = math.nan
    noise_on: Literal["rates", "accelerations"] = "rates"
    road_noise: float = 0.0
    knows: tuple[str, ...] = ()
    initial: tuple[tuple[str, float], ...] = ()
    paper: Mapping[tuple[str, str], float] = field(default_factory=dict, compare=False)
    measured: bool = False

    @property
    def is_random(self) -> bool:
        """Whether seeds differ."""
        return not self.measured and (self.snr != INFINITE or self.road_noise > 0.0)

    def noisy_drive(self, seed: int, duration: float | None = None) -> Drive:
        """The drive as the estimators get to see it, with its truth: one way from seed to drive."""
        return self.plant.drive(self, np.random.default_rng(seed), duration)

    def load(self) -> dict[str, float]:
        """What the load of the real car changes at the start, as deltas of the twin's chassis."""
        if not isinstance(self.plant, CarPlant):
            raise TwinError(f"{self.name}: the real vehicle is no car with a load")
        return self.plant.load(nominal_chassis(self.twin))

    def told(self, quantities: Sequence[str]) -> dict[str, float]:
        """What the estimators of some quantities believe of the load at the start, as deltas."""
        load = self.load() if self.knows else {}
        told = {name: load[name] for name in self.knows if name not in quantities}
        return told | dict(self.initial)

    def variation(self) -> dict[str, float]:
        """What is to be found of each parameter: the load less what is believed at the start."""
        load = self.load()
        return {name: value - dict(self.initial).get(name, 0.0) for name, value in load.items()}


@dataclass(frozen=True, slots=True)
class Gain:
    """A gain that can be tuned.

    Attributes:
        name: of the gain.
        low, high: bounds.
        today: what it is now.

    Raises:
        TwinError: the bounds are not those of a positive number.
    """

    name: str
    low: float
    high: float
    today: float

    def __post_init__(self) -> None:
        """Checks the bounds."""
        if not 0.0 < self.low < self.high < math.inf:
            raise TwinError(
                f"tune: bounds of {self.name} are {self.low:g} to {self.high:g}; allowed: "
                "0 < lower < upper, finite"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Recipe:
    """What an estimator is given in an experiment, beside a twin and the noise of the sensors.

    Attributes:
        estimator: its name in the registry.
        laws: of its parameters; gains of a run are gains of these, if it has laws.
        channels: the only ones of the drive's that it is shown; by default all.
        complete: gives what else it needs for a run on a drive.
        make: makes the estimator, where it is none of the registry.
        tunable: the gains that can be tuned, for a car.
    """

    estimator: str
    laws: tuple[ParameterLaw, ...] = ()
    channels: tuple[str, ...] = ()
    complete: Callable[["Run", Drive, Given], Given] | None = None
    make: Callable[["Run", Drive], Estimator] | None = None
    tunable: Callable[[str], Sequence[Gain]] | None = None


class Score(NamedTuple):
    """One figure of one trial.

    Attributes:
        quantity, metric, unit: what it is.
        value: the figure.
        over: how the seeds' figures become one row: their median and 90th percentile, or one figure
            that all seeds make together, their root mean square or mean.
        case: another name of the case than the run's.
    """

    quantity: str
    metric: str
    unit: str
    value: float
    over: Literal["median", "rms", "mean"] = "median"
    case: str = ""


class Cost(NamedTuple):
    """What a tuning minimises.

    Attributes:
        runs: of an estimator with given gains: what is driven.
        of: the cost, of those runs' scores and the runs.
        metric: its name; its unit is 1.
        worst: what gains cost with which the estimator blows up [-].
        made: what else belongs into the file of gains: seeds, starts.
        on: the same cost of other real vehicles and drives, by their names; None: it has no others.
        held_out: names that a tuning is reported on unless it is told others.
    """

    runs: Callable[["Experiment", str, tuple[tuple[str, float], ...]], list["Run"]]
    of: Callable[[Sequence[Sequence[Score]], Sequence["Run"]], float]
    metric: str
    worst: float
    made: Mapping[str, Any]
    on: "Callable[[Sequence[str]], Cost] | None" = None
    held_out: tuple[str, ...] = ()


class Study(NamedTuple):
    """An experiment that is no estimator over one drive: many drives that are used together.

    Attributes:
        run: over seeds, in so many processes, for a duration of each drive [s] or all of it.
        picture: draws it; None: it has none.
    """

    run: "Callable[[Sequence[int], int, float | None], Result]"
    picture: Callable[[Path, int], None] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Experiment:
    """An experiment; its description is the docstring of the module that defines it.

    Attributes:
        name: as `til run` takes it.
        cases: that `til run` drives.
        table: the cases of the paper's table; by default `cases`.
        estimators: that `til run` shows, by the label of their rows. Others of the registry run by
            `til run --estimator`, with what `recipes.recipe_of` gives them.
        quantities: what is to be estimated.
        metrics: of a trial.
        limit: least values that figures of a case can have, by (quantity, metric), for a duration.
        costs: that `til tune` can minimise, by name; the first is the default.
        notes: sentences about a trial.
        timeline: the kind of timeline, a name of `scenarios.timeline.write.KINDS`.
        picture: draws trials of one drive, for `til run --png`.
        study: what is run instead of cases and estimators.
        with_car: the same with another car, by its name in `models` or its file; None: there is
            none, its vehicle belongs to the experiment.
    """

    name: str
    cases: tuple[Case, ...] = ()
    table: tuple[Case, ...] = ()
    estimators: Mapping[str, Recipe] = field(default_factory=dict)
    quantities: tuple[str, ...]
    metrics: Callable[["Trial"], list[Score]] = lambda _: []
    limit: "Callable[[Experiment, Case, float | None], Mapping[tuple[str, str], float]] | None" = (
        None
    )
    costs: Mapping[str, Cost] = field(default_factory=dict)
    notes: Callable[["Trial"], tuple[str, ...]] | None = None
    timeline: str = "parameters"
    picture: "Callable[[Sequence[Trial], Path], None] | None" = None
    study: Study | None = None
    with_car: "Callable[[str], Experiment] | None" = None

    def of(self, car: str) -> "Experiment":
        """The same experiment with another car.

        Args:
            car: its name in `models`, or its file.

        Raises:
            TwinError: the experiment keeps its own car.
        """
        if self.with_car is None:
            raise TwinError(f"{self.name}: car is {car!r}; allowed: none, the scenario has its own")
        return self.with_car(car)

    @property
    def draws(self) -> bool:
        """Whether `til run --png` has a picture to draw."""
        return self.picture is not None or (self.study is not None and bool(self.study.picture))

    def at(self, snr: float | None) -> tuple[Case, ...]:
        """The cases of `til run` at a signal-to-noise ratio [dB]; None: at their own.

        Raises:
            TwinError: the noise of a case is not a matter of a ratio.
        """
        return self.cases if snr is None else tuple(self._at(case, snr) for case in self.cases)

    def _at(self, case: Case, snr: float) -> Case:
        if math.isnan(case.snr):
            raise TwinError(
                f"{self.name}: snr is {snr:g}; allowed: none, the noise of this scenario is given"
            )
        other = replace(case, snr=snr)
        if other == case:
            return case
        same = next((one for one in self.table if one == other), None)
        noise = "noiseless" if snr == INFINITE else f"SNR {snr:g} dB"
        return same or replace(other, name=f"{case.name}, {noise}", paper={})


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One estimator over one noisy drive.

    Attributes:
        experiment: that it belongs to.
        case: what is driven.
        estimator: a label of the experiment's estimators, or a name of the registry.
        seed: of all noise.
        duration: of the drive [s]; None: all of it.
        gains: by name, instead of the recipe's own; None: those.
    """

    experiment: Experiment
    case: Case
    estimator: str
    seed: int = 0
    duration: float | None = None
    gains: tuple[tuple[str, float], ...] | None = None


class Trial(NamedTuple):
    """A run that was made: what the estimator was shown, truth besides, and what it found."""

    run: Run
    drive: Drive
    estimate: Estimate
