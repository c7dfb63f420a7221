"""One signal fitted to another: how alike they are, by how much one is late, and how it drifts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_LAG = 1.0  # [s] that is searched
_LEAST_SECONDS = 3.0  # of a part whose lag is looked for
_LEAST_COMMON = 0.6  # of the good samples that must remain good with a lag
_PART = 12.0  # [s] of a drive, to see whether the lag drifts; at most so many of them:
_MOST_PARTS = 12
_LEAST_DRIFT = 0.08  # [s] over the drive
_SURE = 4.0  # standard errors
_SHARPNESS = 1.3  # by which a lag must lessen the residual's variance to be believed; chosen


class Fit(NamedTuple):
    """The left side of an equation fitted to its right side.

    Attributes:
        correlation: of both, as they come; NaN if there is too little of it.
        slope, intercept: of the left side over the right one, lag removed.
        lag: by which the left side is late [s]; 0 where it makes no difference.
        at_lag: correlation with the lag removed.
        drift: by how much the lag grows per second; 0 where it cannot be seen.
        spread: standard deviation of the right side.
        both_signs: whether the right side has both: else the intercept is extrapolated.
    """

    correlation: float
    slope: float
    intercept: float
    lag: float
    at_lag: float
    drift: float
    spread: float
    both_signs: bool = False


def fit(left: Array, right: Array, good: NDArray[np.bool_], dt: float, *, lags: bool = True) -> Fit:
    """Fits (N,) left to (N,) right where it is good to, both with steps of dt [s]."""
    if good.sum() * dt < 2.0:
        return Fit(np.nan, np.nan, np.nan, 0.0, np.nan, 0.0, 0.0)
    here = _correlation(left, right, good, 0)
    best, at_best = _lag(left, right, good, dt) if lags else (0.0, here)
    if not _matters(here, at_best):
        best, at_best = 0.0, here
    a, b, weights = _shifted(left, right, good, round(best / dt))
    a, b = a[weights], b[weights]
    spread = float(b.std())
    slope = float(
        (a - a.mean()) @ (b - b.mean()) / max(float((b - b.mean()) @ (b - b.mean())), 1e-300)
    )
    return Fit(
        correlation=here,
        slope=slope,
        intercept=float(a.mean() - slope * b.mean()),
        lag=best,
        at_lag=at_best,
        drift=_drift(left, right, good, dt) if lags else 0.0,
        spread=spread,
        both_signs=bool(np.quantile(b, 0.05) < 0.0 < np.quantile(b, 0.95)),
    )


def _matters(here: float, there: float) -> bool:
    """Whether a lag explains much more than none."""
    return (1.0 - here * abs(here)) > _SHARPNESS * (1.0 - there * abs(there)) or (
        abs(there) > abs(here) + 0.1
    )


def _shifted(
    left: Array, right: Array, good: NDArray[np.bool_], steps: int
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Both with the left side brought forward by so many steps."""
    n = left.size
    if steps >= 0:
        return left[steps:], right[: n - steps], good[steps:] & good[: n - steps]
    return left[:steps], right[-steps:], good[:steps] & good[-steps:]


def _correlation(left: Array, right: Array, good: NDArray[np.bool_], steps: int) -> float:
    a, b, weights = _shifted(left, right, good, steps)
    a, b = a[weights], b[weights]
    if a.size < max(8.0, _LEAST_COMMON * float(good.sum())):
        return 0.0
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / max(np.sqrt((a @ a) * (b @ b)), 1e-300))


def _lag(left: Array, right: Array, good: NDArray[np.bool_], dt: float) -> tuple[float, float]:
    """The lag [s] with the largest correlation of either sign, and that correlation."""
    most = min(round(LARGEST_LAG / dt), left.size // 4)
    steps = np.arange(-most, most + 1)
    found = np.array([_correlation(left, right, good, int(k)) for k in steps])
    # of lags that explain as much the shortest
    best = int(np.argmax(np.abs(found) - 1e-3 * np.abs(steps) * dt))
    lag = float(steps[best])
    if 0 < best < steps.size - 1:  # between samples, by a parabola
        a, b, c = np.abs(found[best - 1 : best + 2])
        bend = a - 2.0 * b + c
        lag += 0.5 * float((a - c) / bend) if bend < 0.0 else 0.0
    return lag * dt, float(found[best])


def _drift(left: Array, right: Array, good: NDArray[np.bool_], dt: float) -> float:
    """Seconds per second by which the lag grows, from parts of the drive; 0 if it is not sure."""
    n = left.size
    parts = min(int(n * dt / _PART), _MOST_PARTS)
    if parts < 4:
        return 0.0
    middles, found = [], []
    for part in range(parts):
        cut = slice(part * n // parts, (part + 1) * n // parts)
        if good[cut].sum() * dt < _LEAST_SECONDS or right[cut].std() < 0.3 * right[good].std():
            continue
        lag, alike = _lag(left[cut], right[cut], good[cut], dt)
        if abs(alike) > 0.9:
            middles.append((part + 0.5) * n / parts * dt)
            found.append(lag)
    if len(found) < 4:
        return 0.0
    at, lags = np.array(middles), np.array(found)
    slope, base = np.polyfit(at, lags, 1)
    misfit = np.sqrt(np.sum((lags - base - slope * at) ** 2) / (at.size - 2))
    error = max(misfit, 0.25 * dt) / np.sqrt(np.sum((at - at.mean()) ** 2))
    sure = abs(slope) * n * dt > _LEAST_DRIFT and abs(slope) > _SURE * error
    return float(slope) if sure else 0.0
