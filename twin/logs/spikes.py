"""Single samples of a steering angle that no driver can have turned to, and back."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WINDOW = 5  # samples, of the running median: a spike has two at most
_LEAST_RATE = 40.0  # [Hz]; slower, a driver can do it
_OUT = 10.0  # rms steps between samples, that a spike stands out by; chosen


def without_spikes(time: Array, values: Array) -> tuple[Array, int]:
    """The values with NaN in place of spikes, and how many there are.

    Args:
        time: (N,) never falling [s].
        values: (N,), NaN where a sample is missing.
    """
    there = np.flatnonzero(np.isfinite(values))
    span = time[-1] - time[0]
    if there.size < 4 * _WINDOW or (time.size - 1) < _LEAST_RATE * span:
        return values, 0
    known = values[there]
    padded = np.pad(known, _WINDOW // 2, mode="edge")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, _WINDOW), axis=1)
    step = float(np.sqrt(np.mean(np.diff(median) ** 2)))
    out = np.abs(known - median) > _OUT * step
    if step == 0.0 or not out.any():
        return values, 0
    values = values.copy()
    values[there[out]] = np.nan
    return values, int(out.sum())
