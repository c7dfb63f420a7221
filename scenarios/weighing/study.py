"""Cross-validation over trips of known load: weighing, its baseline and the twin's own answer.

Each reference trip is weighed by what the others say: weighing learns its losses, scale and scatter
without it, baseline and twin their scale and scatter. Trips that are held out are weighed by all
references.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from estimators.weigh.calibration import Calibration, Reference, calibrate
from estimators.weigh.samples import samples_of
from estimators.weigh.scatter import fit_scatter
from estimators.weigh.torque_over_acceleration import apparent_mass
from estimators.weigh.trip import Trip
from estimators.weigh.weighing import Weighing, weigh_samples
from scenarios.experiment.progress import parallel
from scenarios.weighing.car import MASS_SD, Car
from scenarios.weighing.twin_answer import TwinAnswer, twin_answer
from twin import Vehicle

Array = NDArray[np.float64]

ESTIMATORS = ("weigh", "regression", "til")
CLOSE = 20.0  # [kg], an error that a load is to fall below and stay
STEP = 30.0  # [s] between the starts of a trip that are weighed for that
_NORMAL_95 = 1.96
_ROBUST = 1.4826  # standard deviation over the median of absolute deviations


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """What one estimator says of one trip.

    Attributes:
        load: [kg].
        half_width: of its 95 % interval [kg].
        believable: whether it trusts itself; the regression has no opinion.
    """

    load: float
    half_width: float
    believable: bool = True


def everything(car: Car, references: Sequence[Reference]) -> Calibration:
    """The calibration from these trips."""
    return calibrate(references, mass=car.mass, mass_sd=MASS_SD, rotating_mass=car.rotating_mass)


def cross_validated(
    car: Car, trips: Sequence[Trip], jobs: int
) -> tuple[list[Weighing], list[Calibration]]:
    """Each trip weighed by the others, and the calibrations that did so."""
    references = [Reference(name=trip.name, samples=samples_of(trip)) for trip in trips]
    leave = partial(_without, car, references)
    calibrations = parallel(leave, range(len(trips)), jobs, "calibrations")
    weighings = [
        weigh_samples(trip.name, trip.duration, reference.samples, calibration)
        for trip, reference, calibration in zip(trips, references, calibrations, strict=True)
    ]
    return weighings, calibrations


def _without(car: Car, references: Sequence[Reference], index: int) -> Calibration:
    return everything(car, [r for i, r in enumerate(references) if i != index])


def seconds_to_stay(trip: Trip, calibration: Calibration, truth: float) -> float:
    """From the start until the load stays within `CLOSE` of the truth [s]; inf: it does not."""
    found = np.inf
    for end in np.arange(trip.duration, STEP, -STEP):
        start = trip.until(float(end))
        w = weigh_samples(trip.name, start.duration, samples_of(start), calibration)
        if not abs(w.load - truth) <= CLOSE:
            break
        found = float(end)
    return found


def by_regression(car: Car, trips: Sequence[Trip], held_out: Sequence[Trip]) -> dict[str, Scored]:
    """The baseline: apparent masses over those of the other reference trips."""
    masses = np.array([apparent_mass(trip) for trip in trips])
    found = {
        trip.name: _from_apparent(car, masses[i], np.delete(masses, i))
        for i, trip in enumerate(trips)
    }
    new = regression_of(car, trips, held_out)
    return found | {trip.name: one for trip, one in zip(held_out, new, strict=True)}


def regression_of(car: Car, references: Sequence[Trip], trips: Sequence[Trip]) -> list[Scored]:
    """The baseline of trips that are no references."""
    masses = np.array([apparent_mass(trip) for trip in references])
    return [_from_apparent(car, apparent_mass(trip), masses) for trip in trips]


def _from_apparent(car: Car, mass: float, others: Array) -> Scored:
    """Scale and scatter are median and median deviation of the other trips."""
    inertial, others = car.mass + car.rotating_mass, others[np.isfinite(others)]
    scale = float(np.median(others)) / inertial
    sd = _ROBUST * float(np.median(np.abs(others - np.median(others)))) / scale
    return Scored(load=mass / scale - inertial, half_width=_NORMAL_95 * sd)


def by_twin(
    vehicle: Vehicle,
    car: Car,
    trips: Sequence[Trip],
    held_out: Sequence[Trip],
    calibration: Calibration,
    jobs: int,
) -> dict[str, Scored]:
    """The TiL observer's masses, their scale and scatter from the other reference trips."""
    run = partial(_answer, vehicle, calibration)
    answers = parallel(run, [*trips, *held_out], jobs, "twins")
    known, new = answers[: len(trips)], answers[len(trips) :]
    found = {
        answer.name: _rescaled(car, answer, [a for a in known if a is not answer])
        for answer in known
    }
    return found | {answer.name: _rescaled(car, answer, known) for answer in new}


def _answer(vehicle: Vehicle, calibration: Calibration, trip: Trip) -> TwinAnswer:
    return twin_answer(vehicle, trip, calibration)


def _rescaled(car: Car, answer: TwinAnswer, others: Sequence[TwinAnswer]) -> Scored:
    inertial = car.mass + car.rotating_mass
    declared = np.full(len(others), inertial)
    ratio = np.array([a.mass + car.rotating_mass for a in others]) / inertial
    sd = np.array([a.sd for a in others]) / inertial
    scatter = fit_scatter(ratio, sd, np.zeros(len(others)), declared)
    load = (answer.mass + car.rotating_mass) / scatter.scale - inertial
    half_width = _NORMAL_95 * scatter.sd(answer.sd / inertial) / scatter.scale * inertial
    return Scored(load=load, half_width=half_width, believable=not answer.at_bound)


def as_scored(weighings: Sequence[Weighing]) -> Mapping[str, Scored]:
    """Weighings by their trips' names."""
    return {
        w.name: Scored(load=w.load, half_width=w.half_width, believable=w.believable)
        for w in weighings
    }
