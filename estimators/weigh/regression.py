"""The apparent mass of one trip: acceleration over force, robust.

Acceleration is regressed on force, not the reverse: the error is in the acceleration, and an error
of the regressor would make the car lighter than it is. With the effective force h (see `losses`)

    f = h / M - r - d v^2 + slow disturbance + noise

gives the apparent mass M, the rolling deceleration r (an offset of the accelerometer included) and
the drag d. M is the mass with rotating parts times the scale of the log's torques.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HUBER = 1.5  # residuals beyond so many standard deviations weigh less
ROUNDS = 30
TOLERANCE = 1e-5  # of 1/M: 15 g
LEAST_SAMPLES = 20
# Weak priors about zero, so that a trip without acceleration or at one speed is solvable: standard
# deviations of 1/M [1/kg], r [m/s2] and d [1/m]
_PRIOR_SD = np.array([1e-2, 1.0, 1e-3])


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What the regression of a trip gives.

    Attributes:
        mass: apparent mass M [kg]; NaN: there are too few samples, or force and acceleration do
            not go together.
        mass_sd: its standard deviation, from the residuals [kg].
        rolling: deceleration r [m/s2].
        drag: d [1/m].
        noise: standard deviation of the residuals in units of the assumed one.
        weights: (n,) of the samples, at most 1.
    """

    mass: float
    mass_sd: float
    rolling: float
    drag: float
    noise: float
    weights: Array


def regress(force: Array, constant: Array, speed_squared: Array, acceleration: Array) -> Fit:
    """Fits a trip.

    Args:
        force: (n,) effective, whitened as all others.
        constant: (n,) ones before whitening.
        speed_squared: (n,).
        acceleration: (n,).
    """
    if force.size < LEAST_SAMPLES:
        return Fit(
            mass=np.nan, mass_sd=np.inf, rolling=np.nan, drag=np.nan, noise=np.nan,
            weights=np.ones(force.size),
        )  # fmt: skip
    columns = np.column_stack((force, constant, speed_squared))
    solution, sd, weights = robust_least_squares(columns, acceleration, _PRIOR_SD)
    weighted = columns * weights[:, None]
    covariance = np.linalg.inv(weighted.T @ columns + np.diag(_PRIOR_SD**-2))
    inverse_mass, inverse_sd = solution[0], sd * np.sqrt(covariance[0, 0])
    positive = inverse_mass > 0.0
    return Fit(
        mass=1.0 / inverse_mass if positive else np.nan,
        mass_sd=inverse_sd / inverse_mass**2 if positive else np.inf,
        rolling=-solution[1],
        drag=-solution[2],
        noise=sd,
        weights=weights,
    )


def robust_least_squares(
    columns: Array, values: Array, prior_sd: Array
) -> tuple[Array, float, Array]:
    """Huber's estimate by reweighting.

    Args:
        columns: (n, p) regressors.
        values: (n,).
        prior_sd: (p,) standard deviations of a prior about zero, in which residuals have one of 1.

    Returns:
        (p,) solution, standard deviation of the residuals, (n,) weights of the samples.
    """
    weights, sd = np.ones(values.size), 1.0
    solution = np.zeros(columns.shape[1])
    for _ in range(ROUNDS):
        before = solution
        weighted = columns * weights[:, None]
        information = weighted.T @ columns + np.diag(prior_sd**-2)
        solution = np.asarray(np.linalg.solve(information, weighted.T @ values), dtype=np.float64)
        residuals = values - columns @ solution
        sd = max(robust_sd(residuals), 1e-9)
        weights = np.minimum(1.0, HUBER * sd / np.maximum(np.abs(residuals), 1e-12))
        if np.all(np.abs(solution - before) <= TOLERANCE * np.abs(solution)):
            break
    return solution, sd, weights


def robust_sd(values: Array) -> float:
    """Standard deviation by the median of absolute values, about zero."""
    return 1.4826 * float(np.median(np.abs(values)))
