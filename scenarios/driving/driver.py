"""A driver: preview steering, pedals and the torques of the wheels, sample by sample, compiled.

Steering follows the bend some time ahead, as it takes in a steady turn, and turns back what the
car would be beside the line after a look-ahead time: the classical preview driver (MacAdam 1981;
feed-forward and look-ahead error as in Kapania and Gerdes 2015). The look-ahead error is taken
along the direction of travel, so that the sideslip of a steady turn is no error.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from twin import U
from twin.stepping import AIR_DENSITY

# Slower than this a driver who wants to stand still just holds the brake [m/s]; chosen.
CREEP = 0.3
SLOWEST_STEERING = 5.0  # [m/s]: below it the steering gains no longer grow; chosen


class Driver(NamedTuple):
    """Who drives, and what he knows of the car; forces are those at the road, of all wheels.

    `scenarios.driving.drivers` makes the driver of a car.
    """

    mass: float  # [kg]
    drag_area: float  # c_D A [m2]
    wheelbase: float  # [m]
    steering_ratio: float  # hand wheel over road wheel
    wheel_radius: float  # [m], turns force into torque
    drive_front: float  # share of the front axle
    brake_front: float
    power: float  # [W], of the engine at the wheels
    largest_force: float  # [N], of the engine
    # a proportional-integral speed driver
    proportional: float  # [N per m/s]
    integral: float  # [N per m]
    pedal_rate: float  # [N/s]
    holding_torque: float  # [N m] per wheel, at a standstill
    # what follows is used along a course only
    understeer: float  # road-wheel angle over lateral acceleration [rad s2/m]
    steering_rate: float  # of the hand wheel [rad/s]
    locking: float = 0.0  # of an axle's differential [N m s/rad]
    locked_share: float = 0.0  # of the axle's torque that it passes to the slower wheel at most
    preview: float = 0.2  # how far ahead the bend and the pedals are taken [s]
    look_ahead: float = 0.6  # [s]
    yaw_gain: float = 0.08  # road-wheel angle over missing yaw rate [s]


# What a driver keeps: distance along the course [m], integral of the speed error [m], force [N],
# hand wheel [rad]
DISTANCE, INTEGRAL, FORCE, HAND_WHEEL, MEMORY = range(5)


def new_memory(distance: float = 0.0) -> np.ndarray:
    """What a driver keeps from sample to sample, at the start of a course.

    Args:
        distance: along the course where the car is [m]; from there the driver keeps count.
    """
    memory = np.zeros(MEMORY)
    memory[DISTANCE] = distance
    return memory


@njit(cache=True, nogil=True)
def drive_along(driver, course, memory, x, y, yaw, vx, vy, yaw_rate, wheel_speeds, dt, u):
    """What the driver of a car does at one sample: any car, from plain numbers (ISO 8855, SI).

    Args:
        driver: a `Driver`.
        course: a `scenarios.driving.speed_profile.Course`.
        memory: of the driver, from `new_memory`; changed.
        x: of a point of the car near its centre of mass, in the world [m].
        y: likewise.
        yaw: of the car [rad].
        vx: of that point in the car's axes [m/s].
        vy: likewise, to the left.
        yaw_rate: [rad/s].
        wheel_speeds: (4,) [rad/s].
        dt: to the next sample [s].
        u: (13,) inputs, see `twin.INPUTS`; hand wheel, drive and brake torques are filled in.
    """
    left, travel = _locate(course, memory, x, y, yaw + math.atan2(vy, max(vx, 1.0)))
    u[U.steering_wheel_angle] = _hand_wheel(
        driver, course, memory, left, travel, math.hypot(vx, vy), yaw_rate, dt
    )
    here, ahead = memory[DISTANCE], memory[DISTANCE] + driver.preview * vx
    wanted = at(course.speed, here / course.step)
    speeding_up = driver.mass * at(course.acceleration, ahead / course.step)
    air = 0.5 * AIR_DENSITY * driver.drag_area * vx * abs(vx)
    limit = min(driver.largest_force, driver.power / max(vx, 1.0))
    memory[INTEGRAL], memory[FORCE] = pedals(
        driver, wanted, speeding_up + air, vx, memory[INTEGRAL], memory[FORCE], limit, dt
    )
    torques(driver, memory[FORCE], u)
    lock(driver, wheel_speeds, u)


@njit(cache=True, nogil=True)
def at(values, position):
    """Between points, linearly; beyond the ends, the ends."""
    position = min(max(position, 0.0), values.size - 1.000001)
    i = int(position)
    return values[i] + (position - i) * (values[i + 1] - values[i])


@njit(cache=True, nogil=True)
def _locate(course, memory, x, y, direction):
    """How far left of the course [m], and how far to the left of it the travel [rad]."""
    left, heading = 0.0, 0.0
    for _ in range(2):
        position = memory[DISTANCE] / course.step
        heading = at(course.heading, position)
        dx, dy = x - at(course.x, position), y - at(course.y, position)
        memory[DISTANCE] += dx * math.cos(heading) + dy * math.sin(heading)
        left = dy * math.cos(heading) - dx * math.sin(heading)
    turn = direction - heading
    return left, turn - 2.0 * math.pi * round(turn / (2.0 * math.pi))


@njit(cache=True, nogil=True)
def _hand_wheel(driver, course, memory, left, travel, speed, yaw_rate, dt):
    """The angle of the hand wheel [rad]."""
    bend = at(course.curvature, (memory[DISTANCE] + driver.preview * speed) / course.step)
    angle = math.atan(bend * driver.wheelbase) + driver.understeer * bend * speed**2
    fast = max(speed, SLOWEST_STEERING)
    # ahead by v T, e is undone as by a spring and damper of damping ratio 0.8: w = 1.6 / T
    stiffness = (1.6 / (driver.look_ahead * fast)) ** 2
    error = left + driver.look_ahead * fast * math.sin(travel)
    angle -= (driver.wheelbase + driver.understeer * fast**2) * stiffness * error
    angle -= driver.yaw_gain * (
        yaw_rate - at(course.curvature, memory[DISTANCE] / course.step) * speed
    )
    change = driver.steering_rate * dt
    wanted = driver.steering_ratio * min(max(angle, -0.6), 0.6)
    memory[HAND_WHEEL] = min(max(wanted, memory[HAND_WHEEL] - change), memory[HAND_WHEEL] + change)
    return memory[HAND_WHEEL]


@njit(cache=True, nogil=True)
def pedals(driver, wanted, known, speed, integral, before, largest, dt):
    """The integral of the speed error [m] and the force wanted at the road [N], after a sample.

    Args:
        driver: a `Driver`.
        wanted: speed [m/s]; NaN: no foot on any pedal.
        known: force that is needed anyhow [N].
        speed: [m/s].
        integral: before the sample [m].
        before: the force before [N].
        largest: force of the engine now [N].
        dt: sample time [s].
    """
    if np.isnan(wanted):
        integral, force = 0.0, 0.0
    else:
        error = wanted - speed
        force = known + driver.proportional * error + driver.integral * integral
        if abs(force) < largest:
            integral += error * dt
    change = driver.pedal_rate * dt
    force = min(max(force, before - change), before + change, largest)
    return integral, force


@njit(cache=True, nogil=True)
def torques(driver, force, u):
    """Fills the torques of one sample of inputs for a force at the road [N]."""
    torque = 0.5 * driver.wheel_radius * force
    drive, brake = max(torque, 0.0), max(-torque, 0.0)
    for wheel in range(4):
        front = wheel < 2
        driven = driver.drive_front if front else 1.0 - driver.drive_front
        braked = driver.brake_front if front else 1.0 - driver.brake_front
        u[U.drive_torque_fl + wheel] = drive * driven
        u[U.brake_torque_fl + wheel] = brake * braked


@njit(cache=True, nogil=True)
def lock(driver, wheel_speeds, u):
    """Limited-slip differentials: the slower wheel of an axle gets torque of the faster one."""
    for left in (0, 2):
        i = U.drive_torque_fl + left
        most = driver.locked_share * (u[i] + u[i + 1])
        passed = driver.locking * (wheel_speeds[left] - wheel_speeds[left + 1])
        passed = min(max(passed, -most), most)
        u[i] -= 0.5 * passed
        u[i + 1] += 0.5 * passed
