"""The states of CommonRoad's multi-body car in our axes, and what an IMU shows of them.

Its axes are SAE's (y to the right, z down): y, z, steering angle, yaw and pitch and their rates
change sign, roll keeps its. Its velocities are in axes that yaw with the car but neither roll nor
pitch. Ours are those of the body, and the IMU turns with it: what it measures of gravity depends on
roll and pitch. The IMU is at the centre of mass of the sprung mass.

A channel is a number, or an array over time; a sample of 29 numbers is quickest as a list.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.channels import OUTPUTS, WHEEL_SPEEDS, WHEELS
from twin.commonroad.model import (
    AXLE_ROLL_RATE,
    AXLE_VY,
    AXLE_VZ,
    AXLE_Z,
    FRONT,
    GRAVITY,
    PITCH,
    PITCH_RATE,
    REAR,
    ROLL,
    ROLL_RATE,
    VX,
    VY,
    VZ,
    WHEEL,
    YAW,
    YAW_RATE,
    MultiBody,
    X,
    Y,
    Z,
)

Array = NDArray[np.float64]
Channels = Sequence[Any] | Array

COMMONROAD_STATES = (
    *("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz"),
    *("roll_rate", "pitch_rate", "yaw_rate"),
    *(f"wheel_speed_{wheel}" for wheel in WHEELS),
)
"""Those of its states that mean the same as ours, `twin.STATES`."""


def our_states(car: MultiBody, x: Channels) -> Array:
    """The 16 `COMMONROAD_STATES` of their 29 states."""
    roll, pitch = x[ROLL], -x[PITCH]
    position = (x[X], -x[Y], car.h_s - x[Z])
    velocity = _to_body(roll, pitch, (x[VX], -x[VY], -x[VZ]))
    parts = (*position, roll, pitch, -x[YAW], *velocity, *_body_rates(x), *x[WHEEL : WHEEL + 4])
    return np.array(parts)


def move(car: MultiBody, x: Array, dx: Array) -> None:
    """Adds a correction (16,) of the `COMMONROAD_STATES` to their states (29,), in place.

    The body's velocity keeps its components in the body as it turns. The axles go along sideways.
    """
    now = our_states(car, x.tolist()) + dx
    roll, pitch, yaw = now[3:6]
    before = x.copy()
    x[X], x[Y], x[Z] = now[0], -now[1], car.h_s - now[2]
    x[ROLL], x[PITCH], x[YAW] = roll, -pitch, -yaw
    ahead, left, up = _from_body(roll, pitch, now[6:9])
    x[VX], x[VY], x[VZ] = ahead, -left, -up
    turning = now[10] * np.sin(roll) + now[11] * np.cos(roll)
    x[ROLL_RATE] = now[9] + np.tan(pitch) * turning
    x[PITCH_RATE] = now[11] * np.sin(roll) - now[10] * np.cos(roll)
    x[YAW_RATE] = -turning / np.cos(pitch)
    x[WHEEL : WHEEL + 4] = now[12:]
    for axle, arm in ((FRONT, car.a), (REAR, -car.b)):
        x[axle + AXLE_VY] += x[VY] - before[VY] + arm * (x[YAW_RATE] - before[YAW_RATE])


def measurements(x: Channels, rates: Channels) -> Array:
    """The `twin.OUTPUTS` of their 29 states and the rates of these."""
    # Specific force in the axes that only yaw: acceleration less gravity
    force = (
        rates[VX] - x[YAW_RATE] * x[VY],
        -rates[VY] - x[YAW_RATE] * x[VX],
        GRAVITY - rates[VZ],
    )
    imu = _to_body(x[ROLL], -x[PITCH], force)
    known = (*imu, *_body_rates(x), *x[WHEEL : WHEEL + 4])
    found = np.full((len(OUTPUTS), *np.shape(rates[VX])), np.nan)
    found[: WHEEL_SPEEDS.stop] = known
    return found


def _to_body(roll, pitch, v):
    """Turns a vector of the axes that only yaw (x forward, y left, z up) into those of the body."""
    x, y, z = v
    up = x * np.sin(pitch) + z * np.cos(pitch)
    return (
        x * np.cos(pitch) - z * np.sin(pitch),
        y * np.cos(roll) + up * np.sin(roll),
        up * np.cos(roll) - y * np.sin(roll),
    )


def _from_body(roll, pitch, v):
    """The inverse of `_to_body`."""
    x, y, z = v
    up = y * np.sin(roll) + z * np.cos(roll)
    return (
        x * np.cos(pitch) + up * np.sin(pitch),
        y * np.cos(roll) - z * np.sin(roll),
        up * np.cos(pitch) - x * np.sin(pitch),
    )


def _body_rates(x):
    """Rates about the body's axes from those of its angles (ISO 8855: yaw, then pitch, roll)."""
    roll, pitch = x[ROLL], -x[PITCH]
    pitching, yawing = -x[PITCH_RATE], -x[YAW_RATE]
    return (
        x[ROLL_RATE] - yawing * np.sin(pitch),
        pitching * np.cos(roll) + yawing * np.cos(pitch) * np.sin(roll),
        yawing * np.cos(pitch) * np.cos(roll) - pitching * np.sin(roll),
    )


def suspensions(car: MultiBody, x: Channels) -> tuple[Array, Array]:
    """Travels (4, ...) [m] and rates (4, ...) [m/s] of the suspensions, positive upwards.

    The lines of z_S and dz_S in `vehicle_dynamics_mb`, where they are positive downwards.
    """
    hub = car.h_s - car.R_w
    travels, rates = [], []
    for axle, arm, track in ((FRONT, car.a, car.T_f), (REAR, -car.b, car.T_r)):
        z, speed = x[axle + AXLE_Z], x[axle + AXLE_VZ]
        lift = hub - (hub + z - x[Z]) / np.cos(x[ROLL]) - arm * x[PITCH]
        rate = x[VZ] - speed - arm * x[PITCH_RATE]
        for side in (0.5, -0.5):
            travels.append(lift - side * track * (x[ROLL] - x[axle]))
            rates.append(rate - side * track * (x[ROLL_RATE] - x[axle + AXLE_ROLL_RATE]))
    return np.array(travels), np.array(rates)
