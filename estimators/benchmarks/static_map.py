"""Sideslip from a static map: what an estimator has to beat.

A car in steady cornering has beta = l_r r / v_x - m l_f a_y / (L C_r): its rear axle follows a
circle and slips by the force that it carries. The map beta = k_1 a_y + k_2 r / v_x + k_0 has these
two terms and an offset, fitted to a measured sideslip.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal

from estimators.base import Estimate, sideslip_estimate
from estimators.entry import Entry
from twin import Drive

Array = NDArray[np.float64]
LEAST_SPEED = 1.0  # of the signal that stands for the speed; chosen


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


class StaticMapEstimator:
    """A static map over the low-passed signals of a drive.

    Args:
        static_map: fitted to `map_inputs` of another drive.
    """

    def __init__(self, static_map: StaticMap) -> None:
        self.static_map = static_map

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Nothing to reset: the map has no memory."""

    def run(self, drive: Drive) -> Estimate:
        """Sideslip over a whole drive.

        Raises:
            TwinError: the drive lacks a channel.
        """
        return sideslip_estimate(drive.time, predict(self.static_map, *map_inputs(drive)))


def map_inputs(drive: Drive) -> tuple[Array, Array, Array]:
    """Lateral acceleration, yaw rate and speed of a drive, low-passed, as `fit` takes them.

    The speed is the measured `vx` where there is one, else the mean of the rear wheel speeds.

    Raises:
        TwinError: the drive lacks a channel.
    """
    if "vx" in drive.output_names:
        speed = drive.channel("vx")
    else:
        speed = 0.5 * (drive.channel("wheel_speed_rl") + drive.channel("wheel_speed_rr"))
    signals = drive.channel("ay"), drive.channel("yaw_rate"), speed
    ay, yaw_rate, speed = (low_pass(signal, drive.dt) for signal in signals)
    return ay, yaw_rate, np.maximum(speed, LEAST_SPEED)


ENTRY = Entry(
    name="static-map",
    words="sideslip by a linear map of lateral acceleration and curvature",
    make=lambda given: StaticMapEstimator(given.model),
    needs=frozenset(("model",)),
    channels=("ay", "yaw_rate"),
    gives=("sideslip",),
)
