"""A nonlinear single-track car that follows the measured speed and yaw rate.

States are lateral speed and yaw rate at the centre of mass and the slip angle of each axle, which
builds up over a relaxation length. An axle's lateral force is D sin(C arctan(alpha K / (C D))),
D = friction times the static load (Pacejka, Tyre and Vehicle Dynamics, 2nd ed., Eq. 4.49 without
curvature). No wheel, no load transfer, no longitudinal slip: a twin has to do better.

Its numbers are fitted to a measured sideslip by bounded least squares.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from estimators.base import Estimate, sideslip_estimate
from estimators.entry import Entry
from twin import Drive

Array = NDArray[np.float64]
GRAVITY = 9.81
SHAPE = 1.3  # C; Pacejka's for side force
EVALUATIONS = 40  # the most, derivatives aside; the cost has settled by then


class Geometry(NamedTuple):
    """What is known of the car."""

    mass: float  # [kg]
    front: float  # from the centre of mass to the front axle [m]
    rear: float  # ... to the rear axle [m]
    yaw_inertia: float  # [kg m2]
    steering_ratio: float = 1.0  # hand wheel over front wheels


class SingleTrack(NamedTuple):
    """What is fitted."""

    front_stiffness: float  # of the axle over its static load [1/rad]
    rear_stiffness: float
    front_friction: float
    rear_friction: float
    relaxation: float  # [m]
    yaw_gain: float  # of the yaw rate's innovation on the yaw rate [1/s]
    lateral_gain: float  # ... on the lateral speed [m/s per rad]
    steering_offset: float  # [rad] at the road wheels
    sideslip_offset: float  # [rad] of the measured sideslip


START = SingleTrack(20.0, 25.0, 1.2, 1.3, 0.4, 5.0, 0.0, 0.0, 0.0)
LOW = SingleTrack(3.0, 3.0, 0.5, 0.5, 0.02, 0.0, -50.0, -0.03, -0.02)
HIGH = SingleTrack(80.0, 80.0, 2.5, 2.5, 2.0, 50.0, 50.0, 0.03, 0.02)
_SCALE = SingleTrack(5.0, 5.0, 0.2, 0.2, 0.3, 5.0, 2.0, 0.003, 0.003)


def predict(
    car: SingleTrack, geometry: Geometry, steering: Array, drive: Drive, speed: Array
) -> Array:
    """Sideslip at the centre of mass [rad].

    Args:
        car: its numbers.
        geometry: what is known.
        steering: (N,) mean angle of the front wheels [rad].
        drive: with yaw_rate; a NaN corrects nothing.
        speed: (N,) measured [m/s], not zero.
    """
    sideslip = np.empty(len(drive))
    yaw_rate = np.ascontiguousarray(drive.channel("yaw_rate"))
    _run(car, geometry, drive.dt, steering, yaw_rate, speed, sideslip)
    return sideslip


def fit(
    geometry: Geometry,
    steering: Array,
    drive: Drive,
    speed: Array,
    sideslip: Array,
    start: ArrayLike = START,
) -> SingleTrack:
    """The numbers with the least squared error of the sideslip, arguments as of `predict`."""
    from scipy.optimize import least_squares  # not at the top: it takes its time

    def error(x: Array) -> Array:
        found = predict(SingleTrack(*x), geometry, steering, drive, speed)
        return np.nan_to_num(found - sideslip, nan=1.0)

    found = least_squares(
        error, start, bounds=(LOW, HIGH), x_scale=_SCALE, diff_step=1e-4, max_nfev=EVALUATIONS
    )
    return SingleTrack(*found.x.tolist())


class SingleTrackEstimator:
    """A fitted single-track car over a drive with steering_wheel_angle, yaw_rate and vx.

    Args:
        car: its fitted numbers.
        geometry: what is known of it.
    """

    def __init__(self, car: SingleTrack, geometry: Geometry) -> None:
        self.car, self.geometry = car, geometry

    def reset(
        self,
        speed: float,
        parameters: Mapping[str, float] | None = None,
        road: ArrayLike | None = None,
    ) -> None:
        """Nothing to reset: each drive begins straight ahead at its first yaw rate."""

    def run(self, drive: Drive) -> Estimate:
        """Sideslip over a whole drive.

        Raises:
            TwinError: the drive lacks a channel.
        """
        steering = drive.channel("steering_wheel_angle") / self.geometry.steering_ratio
        speed = drive.channel("vx")
        return sideslip_estimate(
            drive.time, predict(self.car, self.geometry, steering, drive, speed)
        )


@njit(cache=True)
def _force(alpha, stiffness, friction, load):
    peak = friction * load
    return peak * math.sin(SHAPE * math.atan(stiffness * load * alpha / (SHAPE * peak)))


@njit(cache=True)
def _run(car, geometry, dt, steering, yaw_rate, speed, sideslip):
    wheelbase = geometry.front + geometry.rear
    weight = geometry.mass * GRAVITY / wheelbase
    front_load, rear_load = weight * geometry.rear, weight * geometry.front
    vy, r = 0.0, yaw_rate[0]
    if np.isnan(r):
        r = 0.0
    alpha_f, alpha_r = 0.0, 0.0
    for k in range(speed.size):
        v = speed[k]
        sideslip[k] = math.atan2(vy, v) + car.sideslip_offset
        share = 1.0 - math.exp(-abs(v) * dt / car.relaxation)
        delta = steering[k] + car.steering_offset
        alpha_f += share * (delta - math.atan2(vy + geometry.front * r, v) - alpha_f)
        alpha_r += share * (-math.atan2(vy - geometry.rear * r, v) - alpha_r)
        front = _force(alpha_f, car.front_stiffness, car.front_friction, front_load)
        rear = _force(alpha_r, car.rear_stiffness, car.rear_friction, rear_load)
        front *= math.cos(delta)
        innovation = 0.0 if np.isnan(yaw_rate[k]) else yaw_rate[k] - r
        moment = geometry.front * front - geometry.rear * rear
        vy += dt * ((front + rear) / geometry.mass - v * r + car.lateral_gain * innovation)
        r += dt * (moment / geometry.yaw_inertia + car.yaw_gain * innovation)


ENTRY = Entry(
    name="single-track",
    words="sideslip by a fitted single-track car that follows the measured yaw rate",
    make=lambda given: SingleTrackEstimator(*given.model),
    needs=frozenset(("model",)),
    channels=("yaw_rate", "vx"),
    gives=("sideslip",),
)
