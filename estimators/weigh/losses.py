"""What lies between the torque that a log shows and the force at the road, shared by all trips.

The effective force is h = F + sum(b_k phi_k), with terms phi_k of force and speed:

* `regeneration`: the negative part of F. Losses take from a driving force and add to a braking one.
* `friction`: tanh(F / 300 N): dry friction of the gears changes its sign with the torque.
* `speed`: F v / 10 m/s: what of the torque is lost with speed.
* `cold`: F while the driveline is cold; see `Samples.cold`.

The scale of the torques is no term here: with the mass of a trip free it cannot be told from it.
The b_k follow from how the force acts *within* trips, the mass of every trip left free, and so
need no trip of known mass.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimators.weigh.regression import Fit, regress
from estimators.weigh.samples import Samples
from estimators.weigh.whitening import whitened

Array = NDArray[np.float64]

FRICTION_FORCE = 300.0  # [N]; chosen: 10 N m at the motor of a small car
UNIT_SPEED = 10.0  # [m/s]
TERMS = ("regeneration", "friction", "speed", "cold")
# b_k is in N for `friction` and a ratio otherwise. The standard deviations of a prior about zero,
# weak beside some trips: what few trips cannot tell stays zero.
PRIOR_SD = {"regeneration": 0.3, "friction": 100.0, "speed": 0.05, "cold": 0.1}
ROUNDS = 10
TOLERANCE = 1e-3  # of the prior's standard deviation


def terms(force: Array, speed: Array, cold: Array) -> Array:
    """(n, k) terms phi of `TERMS`, of signals (n,) as in `Samples`."""
    return np.column_stack(
        (
            np.minimum(force, 0.0),
            np.tanh(force / FRICTION_FORCE),
            force * speed / UNIT_SPEED,
            force * cold,
        )
    )


def fit_trip(samples: Samples, losses: Array) -> Fit:
    """The regression of one trip under known losses (k,)."""
    white = _white(samples)
    return regress(white[:, 1] + white[:, 4:] @ losses, white[:, 2], white[:, 3], white[:, 0])


def fit_losses(trips: Sequence[Samples]) -> Array:
    """The losses (k,) that all trips share; zeros where no trip tells anything.

    Gauss-Newton on f M_i - F = sum(b_k phi_k) - (r_i + d_i v^2) M_i: each round takes the masses of
    the last, projects what a trip has of its own out, and solves for b.
    """
    prior = np.diag([PRIOR_SD[name] ** -2 for name in TERMS])
    losses = np.zeros(len(TERMS))
    white = [_white(samples) for samples in trips]
    for _ in range(ROUNDS):
        information, right = prior.copy(), np.zeros(len(TERMS))
        for columns in white:
            fit = regress(
                columns[:, 1] + columns[:, 4:] @ losses, columns[:, 2], columns[:, 3], columns[:, 0]
            )
            if not np.isfinite(fit.mass):
                continue
            left, unknown = _own_taken_out(columns, losses, fit)
            noise = (fit.mass * fit.noise) ** 2
            weighted = unknown * fit.weights[:, None]
            information += weighted.T @ unknown / noise
            right += weighted.T @ left / noise
        before = losses
        losses = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        if np.all(np.abs(losses - before) < TOLERANCE * np.sqrt(1.0 / np.diag(prior))):
            break
    return losses


def _own_taken_out(columns: Array, losses: Array, fit: Fit) -> tuple[Array, Array]:
    """Left side (n,) and terms (n, k), less what mass, rolling and drag of the trip explain."""
    effective = columns[:, 1] + columns[:, 4:] @ losses
    own = np.column_stack((effective, columns[:, 2:4]))
    both = np.column_stack((columns[:, 0] * fit.mass - columns[:, 1], columns[:, 4:]))
    root = np.sqrt(fit.weights)[:, None]
    both -= own @ np.linalg.lstsq(own * root, both * root, rcond=None)[0]
    return both[:, 0], both[:, 1:]


def _white(samples: Samples) -> Array:
    """(n, 4 + k): acceleration, force, ones, speed squared, terms, whitened."""
    columns = np.column_stack(
        (
            samples.acceleration,
            samples.force,
            np.ones_like(samples.force),
            samples.speed_squared,
            terms(samples.force, samples.speed, samples.cold),
        )
    )
    return whitened(columns, samples.first, samples.step)
