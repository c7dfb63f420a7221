"""Bounded least squares over black-box runs, with confidence intervals that know of drift.

What a model cannot do makes residuals that stay for seconds, so that samples are no independent
witnesses. The covariance is the cluster-robust sandwich (Liang and Zeger, Biometrika 73, 1986):
with rows of the drive gathered in blocks that are long against that memory,

    cov = B/(B - n) (J'J)^-1 [sum over blocks of (J_b' e_b)(J_b' e_b)'] (J'J)^-1.

A model that is wrong in what is not fitted errs alike in many blocks, which the sandwich does not
see. Each of `PARTS` long parts is left out in turn; the largest ratio of that jackknife's variance
to the sandwich's widens all intervals, as each one's own is too noisy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin import TwinError

Array = NDArray[np.float64]
CONFIDENCE, NORMAL_95 = 0.95, 1.96
PARTS = 8  # of the drive, left out in turn; chosen
AT_BOUND = 1e-3  # of the range between the bounds
TOLERANCE = 1e-3  # of the cost, relatively: far below what a confidence interval shows
LEAST_INFORMATION = 1e-10  # relative; a direction below it cannot be told from the others


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What bounded least squares found.

    Attributes:
        values: (n,) where the cost is least.
        low, high: (n,) ends of the 95 % confidence intervals; NaN where the data say nothing.
        at_bound: (n,) whether a value lies at one of its bounds, where its interval means little.
        rms_before, rms_after: of all residuals, at the start and at the end.
        evaluations: how often the cost was computed, derivatives aside.
        converged: whether it ended because nothing improved any more.
    """

    values: Array
    low: Array
    high: Array
    at_bound: NDArray[np.bool_]
    rms_before: float
    rms_after: float
    evaluations: int
    converged: bool


def fit(
    residuals: Callable[[Sequence[Array]], Sequence[Array]],
    start: ArrayLike,
    bounds: tuple[ArrayLike, ArrayLike],
    scale: ArrayLike,
    *,
    block: int,
    memory: int = 1,
    prior_sd: ArrayLike | None = None,
    evaluations: int = 20,
) -> Fit:
    """Fits n numbers.

    Args:
        residuals: takes points (n,) and gives of each the residuals (N, m), a row per sample; it
            may compute the points side by side.
        start: (n,) within the bounds.
        bounds: (n,) least and largest.
        scale: (n,) a change that makes a difference; derivatives take a hundredth of it.
        block: rows that make a block.
        memory: rows that count as one witness against the prior.
        prior_sd: (n,) standard deviations of what is believed beforehand, around the start; inf:
            nothing is. No interval is wider than the prior's.
        evaluations: the most, derivatives aside.

    Raises:
        TwinError: the drive has too few blocks for so many numbers.
    """
    from scipy.optimize import least_squares  # not at the top: it takes its time

    start, scale = np.asarray(start, dtype=float), np.asarray(scale, dtype=float)
    low, high = (np.asarray(bound, dtype=float) for bound in bounds)
    first = residuals([start])[0]
    blocks = -(-len(first) // block)
    if blocks <= start.size:
        raise TwinError(
            f"fit: the drive makes {blocks} blocks of {block} samples for {start.size} free "
            "parameters; allowed: more blocks than parameters: a longer drive, or fewer free"
        )
    steps = 0.01 * scale
    sd = np.full_like(start, np.inf if prior_sd is None else prior_sd)
    pull = np.sqrt(memory) / sd

    def jacobian(x: Array) -> Array:
        # towards the inside of the bounds
        signs = np.where(x + steps <= high, 1.0, -1.0)
        points = [x, *(x + np.diag(signs * steps))]
        here, *there = (values.ravel() for values in residuals(points))
        slopes = [(one - here) / step for one, step in zip(there, signs * steps, strict=True)]
        return np.concatenate([np.stack(slopes, axis=1), np.diag(pull)])

    def errors(x: Array) -> Array:
        return np.concatenate([residuals([x])[0].ravel(), pull * (x - start)])

    found = least_squares(
        errors,
        start,
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=(low, high),
        x_scale=scale,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        max_nfev=evaluations,
    )
    last = found.fun[: first.size]
    half = _half_widths(found.jac[: first.size], last, block * first.shape[1], scale, pull)
    half = np.fmin(half, np.where(np.isinf(sd), np.nan, NORMAL_95 * sd))
    return Fit(
        values=found.x,
        low=found.x - half,
        high=found.x + half,
        at_bound=np.minimum(found.x - low, high - found.x) < AT_BOUND * (high - low),
        rms_before=float(np.sqrt(np.mean(first**2))),
        rms_after=float(np.sqrt(np.mean(last**2))),
        evaluations=found.nfev,
        converged=found.status > 0,
    )


def _half_widths(jacobian: Array, residuals: Array, block: int, scale: Array, pull: Array) -> Array:
    """(n,) of the confidence intervals; NaN of what lies in a direction without information."""
    from scipy.stats import t

    j = jacobian * scale
    values, vectors = np.linalg.eigh(j.T @ j + np.diag((pull * scale) ** 2))
    known = values > LEAST_INFORMATION * values[-1]
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T
    starts = np.arange(0, residuals.size, block)
    scores = np.add.reduceat(j * residuals[:, None], starts, axis=0)
    freedom = starts.size - scale.size
    spread = starts.size / freedom * scores.T @ scores
    # what the prior is worth, in the residuals' own measure, as one more witness
    spread += np.diag((pull * scale) ** 2) * np.mean(residuals**2)
    covariance = inverse @ spread @ inverse
    covariance = covariance * _disagreement(j, residuals, inverse, np.diag(covariance))
    half = t.ppf(0.5 + 0.5 * CONFIDENCE, freedom) * np.sqrt(np.diag(covariance)) * scale
    blind = (np.abs(vectors[:, ~known]) > 0.01).any(axis=1)
    return np.where(blind, np.nan, half)


def _disagreement(j: Array, residuals: Array, inverse: Array, variance: Array) -> float:
    """By how much parts of the drive disagree beyond the variance (n,): a factor, 1 or more.

    A step of Gauss and Newton from the fit without each part; the prior, in the inverse (n, n) of
    the information, stays.
    """
    parts = np.array_split(np.arange(residuals.size), PARTS)
    moved = []
    for part in parts:
        own = j[part]
        rest = np.eye(j.shape[1]) - inverse @ (own.T @ own)
        moved.append(np.linalg.lstsq(rest, inverse @ (own.T @ residuals[part]), rcond=None)[0])
    spread = (PARTS - 1.0) / PARTS * np.var(moved, axis=0) * PARTS
    known = variance > 0.0
    return float(max(1.0, (spread[known] / variance[known]).max(initial=1.0)))
