"""Brings a channel of a log to the sample times of a drive."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A gap is longer than so many of the channel's own steps, whatever the map says; chosen
_STEPS_OF_A_GAP = 2.5
# A channel faster than the drive by more than this is averaged over the drive's step, so that what
# is above half its rate does not come back as something slow; chosen
FASTER = 1.5


def resample(time: Array, values: Array, grid: Array, longest_gap: float) -> Array:
    """Values at other times, linear between samples; NaN in gaps and outside.

    Args:
        time: (N,) never falling [s]; of equal times the first counts.
        values: (N,), NaN where a sample is missing.
        grid: (M,) uniform, rising [s].
        longest_gap: what is interpolated over at most [s].

    Returns:
        (M,).
    """
    good = np.isfinite(values)
    good[1:] &= ~((np.diff(time) == 0.0) & good[:-1])
    time, values = time[good], values[good]
    if time.size < 2:
        return np.full(grid.size, np.nan)
    dt = (grid[-1] - grid[0]) / (grid.size - 1)
    step = float(np.median(np.diff(time)))
    slack = 1e-3 * dt  # times of a file are rounded
    inside = (grid > time[0] - slack) & (grid < time[-1] + slack)
    at = np.clip(grid, time[0], time[-1])
    faster = step * FASTER < dt
    result = _averages(time, values, at, dt) if faster else np.interp(at, time, values)
    after = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    wide = time[after] - time[after - 1] > max(longest_gap, _STEPS_OF_A_GAP * step)
    on_a_sample = np.minimum(np.abs(at - time[after]), np.abs(at - time[after - 1])) < slack
    result[~inside | (wide & ~on_a_sample)] = np.nan
    return result


def gaps(time: Array, longest_gap: float = 0.0) -> list[tuple[float, float]]:
    """Start [s] and length [s] of every gap between samples that counts as one."""
    steps = np.diff(time)
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else np.inf
    wide = np.flatnonzero(steps > max(longest_gap, _STEPS_OF_A_GAP * step))
    return [(float(time[i]), float(steps[i])) for i in wide]


def _averages(time: Array, values: Array, at: Array, dt: float) -> Array:
    """Means over dt around each time, of what is linear between samples."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    first = np.maximum(at - 0.5 * dt, time[0])
    last = np.minimum(at + 0.5 * dt, time[-1])
    return (np.interp(last, time, area) - np.interp(first, time, area)) / (last - first)
