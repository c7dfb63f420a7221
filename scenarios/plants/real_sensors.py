"""What a real car's bus tells of a drive: its sensors' faults, and how late each signal is."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from scenarios.plants.random_car import RealCar
from scenarios.plants.sensors import lever
from twin import (
    ACCELERATIONS,
    IMU,
    RATES,
    ROAD_HEIGHTS,
    TORQUES,
    WHEEL_SPEEDS,
    WHEELS,
    Drive,
    TwinError,
    U,
    noise_sd,
)

Array = NDArray[np.float64]
WHAT_MAY_BE_KNOWN = ("road",)


def told(
    clean: Drive,
    real: RealCar,
    snr: float,
    rng: np.random.Generator,
    knows: Collection[str] = (),
) -> Drive:
    """The drive as the car's bus tells it; the truth stays as it is.

    Args:
        clean: of `scenarios.plants.real_record.record_real`.
        real: the car.
        snr: of the sensors [dB], TiL Eq. (10); inf: no noise.
        rng: of the noise.
        knows: of `WHAT_MAY_BE_KNOWN`, what is told beyond what a car has: the manoeuvre's road.

    Raises:
        TwinError: something else is to be known.
    """
    if not set(knows) <= set(WHAT_MAY_BE_KNOWN):
        raise TwinError(f"knows is {sorted(knows)}; allowed: {', '.join(WHAT_MAY_BE_KNOWN)}")
    inputs, dt = clean.inputs.copy(), clean.dt
    imu, spins, hand_wheel, torques = real["bus_delays"]
    steering = [U.steering_wheel_angle]
    inputs[:, steering] = _late(inputs[:, steering], hand_wheel / dt)
    noise = 1000.0 * real.number("torque_noise") * rng.standard_normal(inputs[:, TORQUES].shape)
    acting = inputs[:, TORQUES] > 0.0
    inputs[:, TORQUES] = np.maximum(inputs[:, TORQUES] + acting * noise, 0.0)
    inputs[:, TORQUES] = _late(inputs[:, TORQUES], torques / dt)
    if "road" not in knows:
        inputs[:, ROAD_HEIGHTS] = 0.0
    y = clean.measurements.copy()
    y[:, IMU] = _imu(y[:, IMU], real, dt)
    for w, wheel in enumerate(WHEELS):
        phase = clean.truth[f"wheel_angle_{wheel}"] + w
        y[:, WHEEL_SPEEDS.start + w] *= 1.0 + real.number("wheel_speed_ripple") * np.sin(phase)
    # measurements of the time that the other clock shows
    ahead = real.number("clock") * np.arange(len(clean))
    y[:, IMU] = _late(y[:, IMU], imu / dt - ahead)
    y[:, WHEEL_SPEEDS] = _late(y[:, WHEEL_SPEEDS], spins / dt - ahead)
    y += noise_sd(clean.measurements, snr) * rng.standard_normal(y.shape)
    return clean.replace(
        inputs=inputs,
        measurements=y,
        settings=clean.settings | {"snr": float(snr), "knows": sorted(knows)},
    )


def _imu(y: Array, real: RealCar, dt: float) -> Array:
    """(N, 6) accelerations and rates as an IMU shows them that sits and measures as this one."""
    y = y.copy()
    y[:, ACCELERATIONS] += lever(y[:, RATES], real["imu_position"], dt)
    a, b, c = real["imu_tilt"]
    tilt = np.array([[1.0, c, -b], [-c, 1.0, a], [b, -a, 1.0]])
    scales = real["imu_scale"]
    for columns, scale, bias in (
        (ACCELERATIONS, scales[0], real["acceleration_bias"]),
        (RATES, scales[1], real["rate_bias"]),
    ):
        y[:, columns] = scale * y[:, columns] @ tilt.T + bias
    band = real.number("imu_bandwidth")
    if band > 0.0:
        keep = np.exp(-2.0 * np.pi * band * dt)
        y = y[0] + np.asarray(lfilter([1.0 - keep], [1.0, -keep], y - y[0], axis=0))
    return y


def _late(y: Array, samples: float | Array) -> Array:
    """(N, k) signals of so many samples ago, linear between samples, the first before it."""
    if not np.any(samples):
        return y
    at = np.arange(len(y), dtype=np.float64)
    return np.column_stack([np.interp(at - samples, at, column) for column in y.T])
