"""Sideslip from a static map: what an estimator has to beat.

A car in steady cornering has beta = l_r r / v_x - m l_f a_y / (L C_r): its rear axle follows a
circle and slips by the force that it carries. The map beta = k_1 a_y + k_2 r / v_x + k_0 has these
two terms and an offset, fitted to a measured sideslip.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]


class StaticMap(NamedTuple):
    """beta = per_ay a_y + per_curvature r / v_x + offset."""

    per_ay: float  # [rad s2/m]
    per_curvature: float  # [m]
    offset: float  # [rad]


def fit(ay: Array, yaw_rate: Array, speed: Array, sideslip: Array) -> StaticMap:
    """The map with the least squared error.

    Args:
        ay: (N,) lateral acceleration [m/s2], low-passed where it is noisy.
        yaw_rate: (N,) [rad/s], likewise.
        speed: (N,) [m/s], or anything in proportion to it; not zero.
        sideslip: (N,) measured [rad].
    """
    columns = np.column_stack([ay, yaw_rate / speed, np.ones_like(ay)])
    return StaticMap(*np.linalg.lstsq(columns, sideslip, rcond=None)[0].tolist())


def predict(static_map: StaticMap, ay: Array, yaw_rate: Array, speed: Array) -> Array:
    """(N,) sideslip [rad] of samples as in `fit`."""
    curvature = yaw_rate / speed
    return static_map.per_ay * ay + static_map.per_curvature * curvature + static_map.offset


def low_pass(values: Array, dt: float, cutoff: float = 2.0) -> Array:
    """Without delay, forwards and backwards through a Butterworth filter of second order.

    It looks ahead, which flatters whatever is computed from it.

    Args:
        values: (N,).
        dt: sample time [s].
        cutoff: [Hz]; 2 Hz: above the driver, below the engine and wheel hop.
    """
    return signal.sosfiltfilt(signal.butter(2, cutoff, fs=1.0 / dt, output="sos"), values)
