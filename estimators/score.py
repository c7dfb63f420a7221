"""How far an estimate is off: TiL Eqs. (11) and (12)."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rms_pct(estimate: Array, truth: float, dt: float, window: float = 1.0) -> float:
    """Root mean square error over the last seconds, in % of the variation to be found.

    TiL Eq. (11), with the square root that it lacks in print, over Eq. (12).

    Args:
        estimate: (N,) of a delta.
        truth: the delta to be found, the variation.
        dt: sample time [s].
        window: length [s].
    """
    last = estimate[-round(window / dt) :] - truth
    return float(100.0 * np.sqrt(np.mean(last**2)) / abs(truth))


def settling_time(estimate: Array, truth: float, dt: float, share: float = 0.1) -> float:
    """When the error gets below a share of the variation for good [s]; inf if it never does."""
    outside = np.flatnonzero(np.abs(estimate - truth) >= share * abs(truth))
    if outside.size == 0:
        return 0.0
    if outside[-1] == estimate.size - 1:
        return float("inf")
    return float((outside[-1] + 1) * dt)
