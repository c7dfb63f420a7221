"""Torques for a twin whose vehicle's are unknown: it follows the measured speed.

The force at the road is the measured longitudinal acceleration times the mass, drag, and what
the twin's speed lacks; a positive one drives, a negative one brakes. With a force made to fit, the
mass is not observable: scaling it scales the force. A wheel whose tyre cannot carry its torque gets
less of it, or a twin with too little grip would spin its wheels up without end.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from twin import INPUTS, TwinError, U, X
from twin import TORQUES as _TORQUE_BLOCK

TORQUES = INPUTS[_TORQUE_BLOCK]
_FIRST_TORQUE, _AFTER_TORQUES = _TORQUE_BLOCK.start, _TORQUE_BLOCK.stop
HALF_AIR_DENSITY = 0.6  # [kg/m3]

# Slip of a wheel from which its torque is reduced, and at which nothing is left of it; chosen:
# beyond the peak of a tyre's force
SLIP_LIMITED, LARGEST_SLIP = 0.15, 0.3
SLOWEST = 3.0  # [m/s], slower than this slip is taken at this speed

_VX, _SPIN = X.vx, X.wheel_speed_fl
_REAR_LEFT, _REAR_RIGHT = X.wheel_speed_rl, X.wheel_speed_rr


class SpeedFollower(NamedTuple):
    """How a speed is followed, and how a vehicle turns force into torques at its wheels."""

    mass: float  # [kg], of the whole vehicle; an error of it is left to the gain
    drag_area: float = 0.0  # [m2]
    gain: float = 10.0  # [1/s]; chosen: a lag of 0.1 s, and slower than a tyre's slip
    radius_front: float = 0.3  # [m], of the wheels
    radius_rear: float = 0.3
    drive_front: float = 0.0  # share of the front axle in driving
    brake_front: float = 0.65  # ... and in braking
    locking: float = 0.0  # [N m s/rad], from the faster rear wheel to the slower one, driving


def check_follower(follower: SpeedFollower) -> None:
    """Refuses what makes no sense.

    Raises:
        TwinError: a number is not finite or out of range.
    """
    limits = {"mass": 1.0, "radius_front": 0.05, "radius_rear": 0.05}
    shares = ("drive_front", "brake_front")
    for name, value in follower._asdict().items():
        least, largest = limits.get(name, 0.0), 1.0 if name in shares else np.inf
        if not least <= value <= largest or np.isinf(value):
            raise TwinError(
                f"speed follower: {name} is {value}; allowed: {least:g} to {largest:g}, finite"
            )


@njit(cache=True, nogil=True)
def follow(follower, speed, acceleration, states, u):
    """Fills in the torques of one sample of inputs.

    Args:
        follower: a `SpeedFollower`.
        speed: measured [m/s].
        acceleration: measured, longitudinal [m/s2]; NaN: it is left to the gain.
        states: (28,) of the twin, `twin.STATES`.
        u: (13,) inputs, `twin.INPUTS`; torques are overwritten.
    """
    ahead = 0.0 if np.isnan(acceleration) else acceleration
    force = follower.mass * (ahead + follower.gain * (speed - states[_VX]))
    force += HALF_AIR_DENSITY * follower.drag_area * states[_VX] * abs(states[_VX])
    front, rear = 0.5 * follower.radius_front * force, 0.5 * follower.radius_rear * force
    u[_FIRST_TORQUE:_AFTER_TORQUES] = 0.0
    if force > 0.0:
        moved = follower.locking * (states[_REAR_LEFT] - states[_REAR_RIGHT])
        u[U.drive_torque_fl] = u[U.drive_torque_fr] = front * follower.drive_front
        u[U.drive_torque_rl] = rear * (1.0 - follower.drive_front) - moved
        u[U.drive_torque_rr] = rear * (1.0 - follower.drive_front) + moved
    else:
        u[U.brake_torque_fl] = u[U.brake_torque_fr] = -front * follower.brake_front
        u[U.brake_torque_rl] = u[U.brake_torque_rr] = -rear * (1.0 - follower.brake_front)
    for w in range(4):
        radius = follower.radius_front if w < 2 else follower.radius_rear
        slip = (radius * states[_SPIN + w] - states[_VX]) / max(abs(states[_VX]), SLOWEST)
        left = (LARGEST_SLIP - abs(slip)) / (LARGEST_SLIP - SLIP_LIMITED)
        left = min(max(left, 0.0), 1.0)
        if slip * force > 0.0:
            u[U.drive_torque_fl + w] *= left
            u[U.brake_torque_fl + w] *= left
