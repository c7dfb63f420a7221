"""What weighing knows of a car from reference trips: losses, scale and scatter.

Three levels: all trips share the losses and the scale of the torques; each trip has an apparent
mass, rolling deceleration and drag of its own; and between trips lies a scatter with a name for
what is not noise, a load that nobody noted. The interval of a new trip comes from that scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators.weigh.losses import TERMS, fit_losses, fit_trip, terms
from estimators.weigh.regression import Fit
from estimators.weigh.samples import Samples, coldness
from estimators.weigh.scatter import Scatter, fit_scatter
from estimators.weigh.trip import Trip
from twin import TwinError

Array = NDArray[np.float64]

LEAST_REFERENCES = 4
# Below, the measured speed and the accelerometer do not see the same car. Of 46 trips of an
# electric car 43 have 0.956 or more, the other three 0.931 and less.
LEAST_AGREEMENT = 0.94
# Standard deviation of the scale from one season, tyre or driver to the next; chosen
DRIFT = 0.01
HALF_AIR_DENSITY = 0.6  # [kg/m3]
_ROUNDS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What reference trips say of a car.

    Attributes:
        mass: of the car with its driver and no load [kg], as the car's file has it.
        mass_sd: how well that is known [kg].
        rotating_mass: of wheels, gears and motor, sum(J / R^2) [kg].
        losses: (k,) of `losses.TERMS`.
        scatter: scale of the torques, and how trips differ.
        drag_area: c_d A that the references show, the median, by the scale of the torques [m2].
        noise: of a reference trip's residuals, the median, in units of the assumed.
        hardest_rolling: the largest deceleration among the references [m/s2].
    """

    mass: float
    mass_sd: float
    rotating_mass: float
    losses: Array
    scatter: Scatter
    drag_area: float
    noise: float
    hardest_rolling: float

    @property
    def inertial_mass(self) -> float:
        """Of the car without load, rotating parts included [kg]."""
        return self.mass + self.rotating_mass

    def effective_force(self, trip: Trip) -> Array:
        """(N,) force at the wheels by scale and losses [N]; zero where the log has a gap."""
        force, speed = np.nan_to_num(trip.force), np.nan_to_num(trip.speed)
        phi = terms(force, speed, coldness(force, speed, trip.dt))
        return (force + phi @ self.losses) / self.scatter.scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A trip of known mass.

    Attributes:
        name: of its log.
        samples: what may be used of it.
        load: beyond the car with its driver, as declared [kg].
    """

    name: str
    samples: Samples
    load: float = 0.0


def calibrate(
    references: Sequence[Reference], *, mass: float, mass_sd: float, rotating_mass: float
) -> Calibration:
    """Learns losses, scale and scatter of a car.

    Args:
        references: trips of known mass. One whose speed and accelerometer disagree is not used.
        mass: of the car with its driver and no load [kg].
        mass_sd: its standard deviation [kg].
        rotating_mass: see `Calibration`.

    Raises:
        TwinError: fewer than `LEAST_REFERENCES` can be used.
    """
    good = [r for r in references if r.samples.agreement >= LEAST_AGREEMENT]
    losses = fit_losses([reference.samples for reference in good])
    fits = [fit_trip(reference.samples, losses) for reference in good]
    pairs = [(r, fit) for r, fit in zip(good, fits, strict=True) if np.isfinite(fit.mass)]
    if len(pairs) < LEAST_REFERENCES:
        raise TwinError(
            f"weigh: {len(pairs)} of {len(references)} reference trips can be used; allowed: at "
            f"least {LEAST_REFERENCES}, in which the car accelerates with its accelerator pressed"
        )
    declared = np.array([mass + rotating_mass + reference.load for reference, _ in pairs])
    ratio, ratio_sd, rolling = _ratios([fit for _, fit in pairs], declared)
    scatter = fit_scatter(ratio, ratio_sd, rolling, declared)
    drag = [fit.drag * fit.mass for _, fit in pairs]
    return Calibration(
        mass=mass,
        mass_sd=mass_sd,
        rotating_mass=rotating_mass,
        losses=losses,
        scatter=scatter,
        drag_area=float(np.median(drag)) / (HALF_AIR_DENSITY * scatter.scale),
        noise=float(np.median([fit.noise for _, fit in pairs])),
        hardest_rolling=float(rolling.max()),
    )


def anchored(calibration: Calibration, references: Sequence[Reference]) -> Calibration:
    """The same car with the scale of these trips: another season, other tyres, another driver.

    The scale starts from that of the calibration with a standard deviation of `DRIFT`; losses and
    scatter stay.

    Raises:
        TwinError: no reference can be used.
    """
    fits = [
        (reference, fit_trip(reference.samples, calibration.losses))
        for reference in references
        if reference.samples.agreement >= LEAST_AGREEMENT
    ]
    pairs = [(reference, fit) for reference, fit in fits if np.isfinite(fit.mass)]
    if not pairs:
        raise TwinError(
            f"weigh: none of {len(references)} reference trips can be used; allowed: trips in "
            "which the car accelerates with its accelerator pressed"
        )
    scatter = calibration.scatter
    declared = np.array([calibration.inertial_mass + r.load for r, _ in pairs])
    ratio, ratio_sd, rolling = _ratios([fit for _, fit in pairs], declared)
    ratio = ratio * scatter.scale / scatter.scale_at(rolling)
    variance = scatter.tau**2 + scatter.phi * ratio_sd**2
    prior = scatter.scale_sd**2 + (DRIFT * scatter.scale) ** 2
    scale, information = _robust_mean(ratio, variance, scatter.scale, prior)
    moved = replace(scatter, scale=scale, scale_sd=information**-0.5)
    return replace(
        calibration,
        scatter=moved,
        hardest_rolling=max(calibration.hardest_rolling, float(rolling.max())),
    )


def _robust_mean(values: Array, variance: Array, mean: float, prior: float) -> tuple[float, float]:
    """Posterior mean and information, values beyond two standard deviations weighing less."""
    start, weight, information = mean, 1.0 / variance, 0.0
    for _ in range(_ROUNDS):
        information = 1.0 / prior + weight.sum()
        mean = (start / prior + weight @ values) / information
        error = np.abs(values - mean) / np.sqrt(variance)
        weight = np.minimum(1.0, 2.0 / np.maximum(error, 1e-9)) / variance
    return float(mean), float(information)


def _ratios(fits: Sequence[Fit], declared: Array) -> tuple[Array, Array, Array]:
    """Ratios of apparent to declared mass, their standard deviations, rolling [m/s2]; (n,) each."""
    mass, sd = np.array([fit.mass for fit in fits]), np.array([fit.mass_sd for fit in fits])
    return mass / declared, sd / declared, np.array([fit.rolling for fit in fits])


def losses_by_name(calibration: Calibration) -> dict[str, float]:
    """The losses with their names, see `losses`."""
    return dict(zip(TERMS, map(float, calibration.losses), strict=True))
