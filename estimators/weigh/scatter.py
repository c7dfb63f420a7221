"""How the trips of one car differ: scale of the torques, scatter, and trips with a load unnoted.

Each reference trip gives the ratio q_i of its apparent mass to the mass it is declared to have. It
is modelled as a mixture of two kinds,

    q_i = s (1 + a (r_i - r)) + e_i                          the declared mass,
    q_i = the same + (20 to 200 kg) / declared mass          somebody rode along who was not noted,

with a scale s, the effect a of the rolling deceleration r_i (a cold car rolls harder and its gears
lose more), and e_i normal with variance tau^2 + phi sd_i^2: the scatter that no regression within a
trip can see, and the inflated variance of the regression. Expectation-maximisation finds s, a, the
share of either kind and, by maximum likelihood on a grid, tau and phi.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

ROUNDS = 100
UNNOTED = (20.0, 200.0)  # [kg], uniform; chosen: a bag to three people
LEAST_SHARE, LARGEST_SHARE = 0.02, 0.4  # of trips with a load unnoted
LARGEST_ROLLING = (
    0.05  # [m/s2] by which r_i counts as different from r: rain and wind roll hard, too
)
EFFECT_SD = 0.3  # [s2/m] prior of a
TAUS = np.linspace(0.002, 0.05, 97)  # of the scale
PHIS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0])
# What is known of tau before the first reference: so many trips' worth of this one
PRIOR_TAU, PRIOR_TRIPS = 0.01, 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """What the reference trips say.

    Attributes:
        scale: s, apparent over declared mass at the mean rolling deceleration.
        scale_sd: its standard deviation.
        effect: a, of the rolling deceleration [s2/m].
        rolling: r [m/s2].
        tau: standard deviation from trip to trip, in units of q.
        phi: by which the variance of a trip's regression is inflated.
        trips: how many reference trips have their declared mass, as a sum of probabilities.
        as_declared: (n,) probability of each reference trip that it has.
    """

    scale: float
    scale_sd: float
    effect: float
    rolling: float
    tau: float
    phi: float
    trips: float
    as_declared: Array

    def scale_at(self, rolling: ArrayLike) -> Array:
        """The scale of a trip with this rolling deceleration [m/s2]."""
        return self.scale * (1.0 + self.effect * _clipped(np.asarray(rolling) - self.rolling))

    def sd(self, ratio_sd: float) -> float:
        """Standard deviation of a new trip's q, given that of its regression."""
        return float(np.sqrt(self.tau**2 + self.phi * ratio_sd**2 + self.scale_sd**2))


def fit_scatter(ratio: Array, ratio_sd: Array, rolling: Array, declared: Array) -> Scatter:
    """Fits the mixture.

    Args:
        ratio: (n,) q, at least 2.
        ratio_sd: (n,) of the regressions.
        rolling: (n,) decelerations [m/s2].
        declared: (n,) masses with rotating parts [kg].
    """
    middle = float(np.median(rolling))
    columns = np.column_stack((np.ones_like(ratio), _clipped(rolling - middle)))
    line, tau, phi, share = np.array([_mode(ratio), 0.0]), PRIOR_TAU, 1.0, 0.1
    information, as_declared = np.eye(2), np.ones_like(ratio)
    for _ in range(ROUNDS):
        variance, error = tau**2 + phi * ratio_sd**2, ratio - columns @ line
        as_declared = _as_declared(error, variance, declared / line[0], share)
        share = float(np.clip(1.0 - as_declared.mean(), LEAST_SHARE, LARGEST_SHARE))
        weight = as_declared / variance
        information = (columns * weight[:, None]).T @ columns
        information[1, 1] += (line[0] * EFFECT_SD) ** -2
        line = np.linalg.solve(information, columns.T @ (weight * ratio))
        tau, phi = _spread(ratio - columns @ line, ratio_sd, as_declared)
    return Scatter(
        scale=float(line[0]),
        scale_sd=float(np.sqrt(np.linalg.inv(information)[0, 0])),
        effect=float(line[1] / line[0]),
        rolling=middle,
        tau=tau,
        phi=phi,
        trips=float(as_declared.sum()),
        as_declared=as_declared,
    )


def _as_declared(error: Array, variance: Array, kilograms: Array, share: float) -> Array:
    """(n,) probabilities that trips have their declared mass.

    Args:
        error: (n,) of q.
        variance: (n,) of it.
        kilograms: (n,) per unit of q.
        share: of trips with a load unnoted.
    """
    own = (1.0 - share) * np.exp(-0.5 * error**2 / variance) / np.sqrt(2.0 * np.pi * variance)
    low, high = UNNOTED
    within = (error * kilograms > low) & (error * kilograms < high)
    other = share * within * kilograms / (high - low)
    return own / (own + other + 1e-12)


def _clipped(rolling: Array) -> Array:
    return np.clip(rolling, -LARGEST_ROLLING, LARGEST_ROLLING)


def _mode(values: Array) -> float:
    """Mean of the shortest half."""
    ordered = np.sort(values)
    half = values.size // 2 + 1
    width = ordered[half - 1 :] - ordered[: values.size - half + 1]
    start = int(np.argmin(width))
    return float(ordered[start : start + half].mean())


def _spread(error: Array, ratio_sd: Array, weight: Array) -> tuple[float, float]:
    """The most likely tau and phi."""
    variance = TAUS[:, None, None] ** 2 + PHIS[None, :, None] * ratio_sd**2
    likelihood = -0.5 * np.sum(weight * (np.log(variance) + error**2 / variance), axis=2)
    prior = -0.5 * PRIOR_TRIPS * (2.0 * np.log(TAUS) + (PRIOR_TAU / TAUS) ** 2)
    row, column = np.unravel_index(np.argmax(likelihood + prior[:, None]), likelihood.shape)
    return float(TAUS[row]), float(PHIS[column])
