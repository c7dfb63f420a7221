"""What sensors make of a drive: where they sit, what they add, how late and how coarse they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from twin import ACCELERATIONS, OUTPUTS, RATES, WHEEL_SPEEDS, Drive, TwinError, noise_sd

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Faults of a car's sensors; by default they have none but the white noise of an SNR.

    Attributes:
        position: of the IMU, from where the twin has it [m].
        acceleration_bias: [m/s2].
        rate_bias: [rad/s].
        delay: of all measurements behind the inputs [s].
        correlation_time: of the noise [s]; zero: white.
        acceleration_step, rate_step, wheel_speed_step: what a digit is worth [m/s2, rad/s, rad/s];
            zero: no quantisation.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    acceleration_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rate_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    delay: float = 0.0
    correlation_time: float = 0.0
    acceleration_step: float = 0.0
    rate_step: float = 0.0
    wheel_speed_step: float = 0.0


def measured(clean: Drive, sensors: Sensors, snr: float, rng: np.random.Generator) -> Drive:
    """The drive as such sensors give it; inputs and truth stay as they are.

    The settings receive `snr` [dB] and `noise_sd`, by channel.

    Args:
        clean: simulated, its measurements those of perfect sensors.
        sensors: their faults.
        snr: signal-to-noise ratio [dB], TiL Eq. (10); inf: no noise.
        rng: of the noise.

    Raises:
        TwinError: the drive has other channels than a car, or the ratio is none.
    """
    if clean.output_names != OUTPUTS:
        raise TwinError(f"sensors: drive has {clean.output_names}; allowed: {OUTPUTS}")
    y = clean.measurements.copy()
    y[:, ACCELERATIONS] += lever(y[:, RATES], sensors.position, clean.dt)
    y = _delayed(y, round(sensors.delay / clean.dt))
    y[:, ACCELERATIONS] += sensors.acceleration_bias
    y[:, RATES] += sensors.rate_bias
    sd = noise_sd(clean.measurements, snr)
    y += sd * _noise(y.shape, sensors.correlation_time, clean.dt, rng)
    steps = (sensors.acceleration_step, sensors.rate_step, sensors.wheel_speed_step)
    for columns, step in zip((ACCELERATIONS, RATES, WHEEL_SPEEDS), steps, strict=True):
        if step > 0.0:
            y[:, columns] = step * np.round(y[:, columns] / step)
    by_channel = dict(zip(OUTPUTS, sd.tolist(), strict=True))
    return clean.replace(
        measurements=y, settings=clean.settings | {"snr": float(snr), "noise_sd": by_channel}
    )


def lever(rates: Array, position: ArrayLike, dt: float) -> Array:
    """(N, 3) acceleration of a point of the body relative to its origin, by rigid kinematics."""
    r = np.asarray(position, dtype=np.float64)
    if not r.any():
        return np.zeros_like(rates)
    turn = np.gradient(rates, dt, axis=0)
    return np.cross(turn, r) + np.cross(rates, np.cross(rates, r))


def _delayed(y: Array, samples: int) -> Array:
    """The signals of so many samples ago; before the first, the first."""
    return y[np.maximum(np.arange(len(y)) - samples, 0)]


def _noise(shape: tuple[int, ...], time: float, dt: float, rng: np.random.Generator) -> Array:
    """Noise of unit variance, white or of first order with a correlation time [s]."""
    white = rng.standard_normal(shape)
    if time == 0.0:
        return white
    keep = np.exp(-dt / time)
    white[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=0))
