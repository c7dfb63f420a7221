"""The mass of a trip, its interval, and whether it may be believed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from estimators.weigh.calibration import LEAST_AGREEMENT, Calibration
from estimators.weigh.losses import fit_trip
from estimators.weigh.regression import Fit
from estimators.weigh.samples import Samples, samples_of
from estimators.weigh.trip import Trip

Array = NDArray[np.float64]

PROBABILITY = 0.95
# Standard deviation of the scale under load, as a share of the load: it shortens the lever of the
# driven tyres. 300 kg take 2 mm (rolling radius) to 6 mm (hub height) off a car's 330 mm, 3 to
# 10 % of the load.
LEVER_SD = 0.05
# Limits of what is believed; chosen
WIDEST = 75.0  # [kg], half the interval: about one person
LEAST_ACCELERATION = 0.15  # [m/s2], standard deviation; in traffic it is 0.5 and more
LEAST_MASS, LARGEST_MASS = 0.85, 1.5  # of the car with its driver and no load
LARGEST_DRAG_OF_BRAKES = 0.15  # [m/s2] by which a car rolls harder than on any reference trip
LARGEST_NOISE = 3.0  # of the references'
LEAST_SECONDS = 30.0  # of used driving


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighing:
    """What a trip weighs.

    Attributes:
        name: of the log.
        mass: of the car with everything in it [kg]; NaN where nothing can be said.
        load: beyond the car with its driver [kg].
        half_width: of the interval that holds the load with a probability of `PROBABILITY` [kg].
        believable: whether to trust the interval.
        reason: why not; empty if it is.
        seconds: of driving that was used [s].
        duration: of the trip [s].
    """

    name: str
    mass: float
    load: float
    half_width: float
    believable: bool
    reason: str
    seconds: float
    duration: float

    @property
    def interval(self) -> tuple[float, float]:
        """Of the load [kg]."""
        return self.load - self.half_width, self.load + self.half_width


def weigh(trip: Trip, calibration: Calibration) -> Weighing:
    """Weighs one trip."""
    return weigh_samples(trip.name, trip.duration, samples_of(trip), calibration)


def weigh_samples(
    name: str, duration: float, samples: Samples, calibration: Calibration
) -> Weighing:
    """Weighs a trip whose samples were prepared before."""
    fit = fit_trip(samples, calibration.losses)
    mass, half_width = _mass(fit, calibration)
    reason = _reason(samples, fit, mass, half_width, calibration)
    return Weighing(
        name=name,
        mass=mass,
        load=mass - calibration.mass,
        half_width=half_width,
        believable=not reason,
        reason=reason,
        seconds=samples.seconds,
        duration=duration,
    )


def _mass(fit: Fit, calibration: Calibration) -> tuple[float, float]:
    """Of the car with everything in it, and half the interval of the load [kg].

    The scatter is known from few reference trips: its part follows Student's distribution.
    """
    if not np.isfinite(fit.mass):
        return np.nan, np.inf
    scatter = calibration.scatter
    inertial = fit.mass / float(scatter.scale_at(fit.rolling))
    spread = scatter.sd(fit.mass_sd / inertial) / scatter.scale * inertial
    # an error of the unloaded mass is one of the scale: it only matters to the load's share
    scale_sd = np.hypot(calibration.mass_sd / calibration.inertial_mass, LEVER_SD)
    of_load = scale_sd * (inertial - calibration.inertial_mass)
    quantile, freedom = 0.5 + 0.5 * PROBABILITY, max(scatter.trips - 2.0, 1.0)
    half_width = np.hypot(student.ppf(quantile, freedom) * spread, norm.ppf(quantile) * of_load)
    return inertial - calibration.rotating_mass, float(half_width)


def _reason(
    samples: Samples, fit: Fit, mass: float, half_width: float, calibration: Calibration
) -> str:
    """A sentence that says why the weight is not to be believed; empty if it is."""
    if samples.seconds < LEAST_SECONDS:
        return (
            f"only {samples.seconds:.0f} s of driving could be used, {LEAST_SECONDS:.0f} s are "
            "needed: the accelerator is hardly pressed, or a brake may act nearly always"
        )
    if samples.acceleration.std() < LEAST_ACCELERATION:
        return (
            f"the car hardly accelerates: by {samples.acceleration.std():.2f} m/s2 rms, at least "
            f"{LEAST_ACCELERATION:g} is needed"
        )
    if not np.isfinite(mass):
        return "the car does not accelerate when its motor drives: the torque has the wrong sign"
    if not LEAST_MASS * calibration.mass <= mass <= LARGEST_MASS * calibration.mass:
        return (
            f"{mass:.0f} kg are {mass / calibration.mass:.3g} times this car with its driver: the "
            "log is of another car, or its torque has another unit or gear ratio"
        )
    if not samples.agreement >= LEAST_AGREEMENT:
        return (
            f"speed and accelerometer disagree, correlation {samples.agreement:.2f}, at least "
            f"{LEAST_AGREEMENT:g} is needed: one of the two signals is bad"
        )
    if half_width > WIDEST:
        return (
            f"the interval is +-{half_width:.0f} kg, more than {WIDEST:.0f} kg: too little "
            "acceleration"
        )
    if fit.rolling > calibration.hardest_rolling + LARGEST_DRAG_OF_BRAKES:
        return (
            f"the car rolls as if braked by {fit.rolling:.2f} m/s2, on no reference trip by more "
            f"than {calibration.hardest_rolling:.2f}: a brake that drags, or another car"
        )
    if fit.noise > LARGEST_NOISE * calibration.noise:
        return (
            f"residuals are {fit.noise / calibration.noise:.1f} times those of the reference "
            "trips: the log is of another car, or a signal is bad"
        )
    return ""
