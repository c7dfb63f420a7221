"""Whitening of samples whose errors are the sum of a slow disturbance and white noise.

What the law of the car leaves out - wind, a curve, wet road, pitch - changes within seconds, an
Ornstein-Uhlenbeck process; the sensors add white noise. A Kalman filter of that disturbance, run
over every column alike, leaves innovations that are white: generalised least squares becomes
ordinary least squares on them.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Seen in the residuals of 46 trips of an electric car; the mass depends on them weakly
SLOW_SD = 0.05  # [m/s2]
SLOW_TIME = 5.0  # [s]
NOISE_SD = 0.05  # [m/s2] of a mean over half a second


def whitened(columns: Array, first: NDArray[np.bool_], step: float) -> Array:
    """The columns, whitened.

    Args:
        columns: (n, p) signals, all alike.
        first: (n,) where a stretch begins; stretches are independent.
        step: between samples [s].

    Returns:
        (n, p) in units of the noise.
    """
    noise = NOISE_SD * np.sqrt(0.5 / step)
    return _whiten(
        np.ascontiguousarray(columns, dtype=np.float64), first, np.exp(-step / SLOW_TIME), noise
    )


@njit(cache=True)
def _whiten(columns, first, decay, noise):
    n, p = columns.shape
    white, slow = np.empty_like(columns), np.zeros(p)
    stationary, variance = SLOW_SD**2, 0.0
    for k in range(n):
        if first[k]:
            slow[:] = 0.0
            variance = stationary
        else:
            slow *= decay
            variance = decay * decay * variance + (1.0 - decay * decay) * stationary
        total = variance + noise * noise
        gain = variance / total
        for j in range(p):
            innovation = columns[k, j] - slow[j]
            white[k, j] = innovation / np.sqrt(total)
            slow[j] += gain * innovation
        variance *= 1.0 - gain
    return white
