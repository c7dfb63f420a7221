"""The budget of model error: what the joint observer may claim on a car that is not its twin.

The innovations' noise is taken larger, channel by channel, by what sums of residuals over several
time scales show of noise that is not white (F); the estimates that result are more accurate where
the model is wrong. What the parts of a drive disagree about beyond their covariance (a jackknife
over segments of driving) is the error of the model in the estimates themselves; the largest ratio
over all unknowns widens every interval, as each one's own is too noisy. A jackknife averages a
systematic error away on long drives, hence the factor for the length of the drive.

Source: measured on 28 simulated cars that each differ from the twin in something it does not
estimate; of nine rules this is the one whose 2-sd intervals held (.95), and the widest.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.joint.evidence import FULL, SCALES
from estimators.joint.state import State

Array = NDArray[np.float64]

ROUNDS = 4  # of noise and estimates in turn
LENGTH = 40.0  # seconds of used driving beyond which a systematic error counts as averaged away
# Factor of the covariance where the car differs from its twin: what all segments have wrong alike
# is invisible to a jackknife. Chosen on ten drawn cars (seeds 100 to 109) on two drives: 2-sd
# coverage .81 without it, .96 with it.
SHARED = 4.0
LEAST_SEGMENTS = 4  # before anything may count as known
DIFFERS = 3.0  # whiteness from which a car differs from its twin; the same car has 2.3 at most


class Budget(NamedTuple):
    """What the segments of a drive say together.

    Attributes:
        z: (q,) estimates.
        covariance: (q, q) without the widening.
        widening: factor of the covariance, 1 or more.
        noise_factor: (ny,) of each channel's variance, 1 or more.
        whiteness: (scales, ny) variance of sums of residuals over that of white noise; NaN where
            there is nothing.
    """

    z: Array
    covariance: Array
    widening: float
    noise_factor: Array
    whiteness: Array


def budget(state: State, prior: Array, mean: Array, covariance: Array, speed: int | None,
           seconds: float) -> Budget:  # fmt: skip
    """Weighs the evidence of an observer.

    Args:
        state: of the observer, with two full segments or more.
        prior: (q,) standard deviations before the first sample.
        mean: (q,) of the estimates before the evidence.
        covariance: (q, q) of them.
        speed: place of the twins' common speed among the estimates, which is another in every
            segment; None if it is not estimated.
        seconds: of driving that was used.
    """
    segments = int(state.evidence[FULL])
    information = _symmetric(state.segment_information[:segments])
    score = state.segment_score[:segments]
    before = np.linalg.inv(covariance)
    noise = np.ones(score.shape[1])
    whiteness = np.full((SCALES.size, noise.size), np.nan)
    z, c = mean, covariance
    for _ in range(ROUNDS):
        a, b = _weighed(information, score, noise, prior, speed)
        z, c = _solve(before + a.sum(axis=0), before @ mean + b.sum(axis=0))
        whiteness = _whiteness(state, z)
        noise = np.maximum(1.0, np.nan_to_num(np.nanmax(np.nan_to_num(whiteness), axis=0)))
    a, b = _weighed(information, score, noise, prior, speed)
    whole, total = before + a.sum(axis=0), before @ mean + b.sum(axis=0)
    z, c = _solve(whole, total)
    left_out = np.array([_solve(whole - a[k], total - b[k])[0] for k in range(segments)])
    spread = (segments - 1.0) / segments * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
    widening = max(1.0, max(1.0, seconds / LENGTH) * float((spread / np.diag(c)).max()))
    if np.nanmax(np.nan_to_num(whiteness)) >= DIFFERS:
        widening *= SHARED
    return Budget(z, c, widening, noise, whiteness)


def _symmetric(upper: Array) -> Array:
    """Whole matrices of upper triangles (..., q, q)."""
    lower = np.triu(upper, 1)
    return upper + np.swapaxes(lower, -1, -2)


def _weighed(
    information: Array, score: Array, noise: Array, prior: Array, speed: int | None
) -> tuple[Array, Array]:
    """(K, q, q) and (K, q) of each segment, all channels together, the speed marginalised."""
    a = np.einsum("kjab,j->kab", information, 1.0 / noise)
    b = np.einsum("kja,j->ka", score, 1.0 / noise)
    if speed is not None:
        own = a[:, speed, speed] + prior[speed] ** -2.0
        column = a[:, :, speed].copy()
        b = b - column * (b[:, speed] / own)[:, None]
        a = a - column[:, :, None] * column[:, None, :] / own[:, None, None]
        a[:, speed], a[:, :, speed], b[:, speed] = 0.0, 0.0, 0.0
    return a, b


def _solve(information: Array, score: Array) -> tuple[Array, Array]:
    covariance = np.linalg.inv(information)
    covariance = 0.5 * (covariance + covariance.T)
    return covariance @ score, covariance


def _whiteness(state: State, z: Array) -> Array:
    information = _symmetric(state.scale_information)
    squares, number = state.scale_square[..., 0], state.scale_square[..., 1]
    explained = np.einsum("sja,a->sj", state.scale_score, z)
    own = np.einsum("a,sjab,b->sj", z, information, z)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(number > 1.0, (squares - 2.0 * explained + own) / number, np.nan)
