"""Plans a manoeuvre: searches designs for the one that tells soonest what is wanted.

The search takes the twin's own car; the best few designs are then driven by cars drawn from the
prior, and the one wins whose slowest car is quickest.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimators.joint.expected import (
    LONGEST,
    NO_MODEL_ERROR,
    Information,
    ModelError,
    information_of,
    seconds_until,
)
from scenarios.driving.speed_profile import Course
from scenarios.experiment.experiment import Gain
from scenarios.experiment.progress import parallel
from scenarios.planning.design import FIRST, VARIABLES, Design, design_of, motion_of
from scenarios.planning.drive import Driven, Motion, course_for, driven
from scenarios.planning.fit import fitted
from scenarios.planning.limits import PlanLimits
from scenarios.planning.standard import STANDARD
from scenarios.tuning.tune import Objective, search
from twin import CHANNEL, LOAD, OUTPUTS, PARAMETER, PARAMETERS, SCALES, Twin, TwinError, Vehicle
from twin.car.fingerprint import fingerprint

Array = NDArray[np.float64]

SIMULATED = 16.0  # [s] of a design in the search; what it tells later is extrapolated
WORST = 1e5  # cost of what tells nothing
BEST = 5  # designs that drawn cars drive
_DRAWN = 0.7  # of the prior's standard deviations, for cars that a driver would take on the road
_CUT = 1.5  # prior's standard deviations
NOISE = tuple(CHANNEL[name].noise_floor for name in OUTPUTS)


@dataclass(frozen=True)
class Task:
    """What is planned.

    Attributes:
        vehicle: name or file of the car.
        wanted: standard deviations by parameter.
        limits: to stay within.
        error: of the model, that the standard deviations contain.
    """

    vehicle: str
    wanted: Mapping[str, float]
    limits: PlanLimits
    error: ModelError = NO_MODEL_ERROR

    @cached_property
    def car(self) -> Vehicle:
        """The car."""
        return Vehicle.load(self.vehicle)

    @cached_property
    def course(self) -> Course:
        """The middle of the road."""
        return course_for(self.limits, self.car)

    @property
    def name(self) -> str:
        """Of the task and no other."""
        limits = {key: str(value) for key, value in asdict(self.limits).items()}
        content = [fingerprint(self.car), dict(self.wanted), limits, asdict(self.error)]
        return "plan " + hashlib.sha256(json.dumps(content).encode()).hexdigest()[:12]


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """A manoeuvre and what it tells.

    Attributes:
        name: of the manoeuvre.
        driven: by the twin's own car.
        information: of the drive.
        seconds: until what is wanted is reached; inf: not within `LONGEST`.
        missed: least factor by which what is wanted is missed; 1 or less: reached.
        used: share of each limit.
    """

    name: str
    driven: Driven
    information: Information
    seconds: float
    missed: float
    used: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A planned manoeuvre beside the standard ones.

    Attributes:
        task: what was planned.
        design: of the manoeuvre.
        scale: by which the limits lower its steering.
        motion: what is to be driven.
        planned: what it tells.
        standard: what the standard manoeuvres tell, by name.
        cars: seconds until what is wanted is reached, of each drawn car.
        evaluations: of the search.
    """

    task: Task
    design: Design
    scale: float
    motion: Motion
    planned: Option
    standard: Mapping[str, Option]
    cars: tuple[float, ...]
    evaluations: int


@dataclass(frozen=True)
class DesignCost:
    """Seconds until what is wanted is reached, of a search's point; a worker can be sent it."""

    task: Task

    def __call__(self, point: Mapping[str, float]) -> float:
        """The seconds; where it is never reached, more by the factor that is missing."""
        option, _ = evaluate(self.task, shares_of(point), SIMULATED)
        return cost_of(option)


def cost_of(option: Option) -> float:
    """Seconds until what is wanted is reached; where it never is, more by what is missing."""
    if np.isfinite(option.seconds):
        return option.seconds
    return min(LONGEST * max(option.missed, 1.0) ** 2, WORST)


def shares_of(point: Mapping[str, float]) -> dict[str, float]:
    """Numbers from 0 to 1 of a search's gains, which go from 1 to 10."""
    return {name: float(np.clip(np.log10(value), 0.0, 1.0)) for name, value in point.items()}


def evaluate(
    task: Task, shares: Mapping[str, float], seconds: float, car: Array | None = None
) -> tuple[Option, Motion]:
    """A design as a car drives it, its steering as strong as the limits allow."""
    design = design_of(shares, task.limits)
    motion = motion_of(design, task.car, task.limits, seconds)
    motion, _, _ = fitted(task.car, motion, task.course, task.limits)
    return told_by(task, motion, car), motion


def told_by(task: Task, motion: Motion, car: Array | None = None) -> Option:
    """What a motion tells of a car with parameters (20,), by default as in its files."""
    run = driven(task.car, motion, task.course, task.limits.width, car)
    at = None if car is None else dict(zip(PARAMETERS, car.tolist(), strict=True))
    information = information_of(task.car, NOISE, run.drive, at, repeats=motion.repeats)
    seconds, missed = seconds_until(information, task.wanted, task.error)
    return Option(
        name=motion.name, driven=run, information=information, seconds=seconds, missed=missed,
        used={},
    )  # fmt: skip


def standard(task: Task, name: str) -> Option:
    """A standard manoeuvre, on an area without bounds, within the other limits."""
    seconds = min(task.limits.seconds, 30.0) if name != "urban" else task.limits.seconds
    open_area = replace(task.limits, width=np.inf, length=np.inf, road="straight")
    free = replace(task, limits=open_area)
    motion = STANDARD[name](task.car, open_area, seconds)
    motion, _, used = fitted(task.car, motion, free.course, open_area)
    return replace(told_by(free, motion), used=used)


def drawn(task: Task, rng: np.random.Generator, count: int) -> list[Array]:
    """(20,) parameters of cars drawn from the prior, each of a car that there can be."""
    names = (*LOAD, *SCALES)
    found = []
    twin = Twin(task.car)
    lightest = -0.25 * task.car.chassis().mass
    for _ in range(20 * count):
        values = np.zeros(len(PARAMETERS))
        for name in names:
            spread = _DRAWN * np.clip(rng.standard_normal(), -_CUT, _CUT)
            values[PARAMETERS.index(name)] = spread * PARAMETER[name].prior_sd
        values[PARAMETERS.index("mass")] = max(values[PARAMETERS.index("mass")], lightest)
        possible = twin.set_parameters(values)
        try:
            twin.reset(task.limits.slow)
        except TwinError:
            continue
        found.append(possible)
        if len(found) == count:
            break
    return found


def plan(task: Task, *, evaluations: int, cars: int, jobs: int, seed: int, journal: Path) -> Plan:
    """Searches, or goes on where the journal ends.

    Args:
        task: what is planned.
        evaluations: designs to try.
        cars: how many are drawn.
        jobs: processes.
        seed: of the drawn cars.
        journal: of the search.

    Raises:
        TwinError: the limits allow this car nothing, or the journal belongs to another plan.
    """
    task.limits.check(task.car)
    objective = Objective(
        name=task.name,
        gains=tuple(
            Gain(name=name, low=1.0, high=10.0, today=10.0 ** FIRST[name]) for name in VARIABLES
        ),
        cost=DesignCost(task),
        metric="seconds to the wanted standard deviations",
        unit="s",
        worst=WORST,
    )
    tuned = search(objective, evaluations, jobs, journal)
    order = np.argsort(tuned.costs, kind="stable")[:BEST]
    candidates = [shares_of(tuned.points[k]) for k in order]
    draws = drawn(task, np.random.default_rng(seed), cars)
    pairs = [(shares, car) for shares in candidates for car in draws]
    found = np.reshape(parallel(_DrawnCost(task), pairs, jobs, "drawn cars"), (len(candidates), -1))
    chosen = int(np.argmin(found.max(axis=1))) if cars else 0
    planned, motion, design, scale = _whole(task, candidates[chosen], draws)
    options = parallel(_Standard(task), list(STANDARD), jobs, "standard manoeuvres")
    return Plan(
        task=task, design=design, scale=scale, motion=motion, planned=planned,
        standard=dict(zip(STANDARD, options, strict=True)),
        cars=tuple(found[chosen].tolist()), evaluations=tuned.evaluations,
    )  # fmt: skip


@dataclass(frozen=True)
class _DrawnCost:
    task: Task

    def __call__(self, pair: tuple[Mapping[str, float], Array]) -> float:
        shares, car = pair
        try:
            return cost_of(evaluate(self.task, shares, SIMULATED, car)[0])
        except TwinError:
            return WORST


@dataclass(frozen=True)
class _Standard:
    task: Task

    def __call__(self, name: str) -> Option:
        return standard(self.task, name)


def _whole(
    task: Task, shares: Mapping[str, float], draws: list[Array]
) -> tuple[Option, Motion, Design, float]:
    """The chosen design driven until what is wanted is reached, within every car's limits."""
    first, _ = evaluate(task, shares, SIMULATED)
    design = design_of(shares, task.limits)
    longest = task.limits.seconds
    seconds = longest if not np.isfinite(first.seconds) else min(1.25 * first.seconds + 2, longest)
    plain = motion_of(design, task.car, task.limits, max(seconds, 5.0))
    motion, _, used = fitted(task.car, plain, task.course, task.limits, (None, *draws))
    largest = np.abs(plain.steering).max()
    scale = float(np.abs(motion.steering).max() / largest) if largest > 0.0 else 0.0
    return replace(told_by(task, motion), used=used), motion, design, scale
