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

from twin.stepping import AIR_DENSITY

# Slower than this a driver who wants to stand still just holds the brake [m/s]; chosen.
CREEP = 0.3
SLOWEST_STEERING = 5.0  # [m/s]: below it the steering gains no longer grow; chosen


class Driver(NamedTuple):
    """Who drives, and what he knows of the car; forces are those at the road, of all wheels.

    The figures are for the SUV; `scenarios.driving.drivers` has the other cars'.
    """

    # a proportional-integral speed driver
    proportional: float = 4000.0  # [N per m/s]
    integral: float = 600.0  # [N per m]
    largest_force: float = 9000.0  # [N], of the engine
    pedal_rate: float = 20000.0  # [N/s]
    wheel_radius: float = 0.36  # [m], turns force into torque
    drive_front: float = 0.4  # share of the front axle
    brake_front: float = 0.65
    holding_torque: float = 500.0  # [N m] per wheel, at a standstill
    # what follows is used along a course only
    power: float = 250e3  # [W], of the engine at the wheels
    locking: float = 0.0  # of an axle's differential [N m s/rad]
    locked_share: float = 0.0  # of the axle's torque that it passes to the slower wheel at most
    mass: float = 2337.8  # [kg]
    drag_area: float = 0.90  # c_D A [m2]
    wheelbase: float = 2.9  # [m]
    steering_ratio: float = 16.0  # hand wheel over road wheel
    understeer: float = 0.0013  # road-wheel angle over lateral acceleration [rad s2/m]
    preview: float = 0.2  # how far ahead the bend and the pedals are taken [s]
    look_ahead: float = 0.6  # [s]
    yaw_gain: float = 0.08  # road-wheel angle over missing yaw rate [s]
    steering_rate: float = 15.0  # of the hand wheel [rad/s]


MEMORY = 4  # numbers a driver keeps: distance along the course [m], speed integral [m], force [N]
# and hand wheel [rad]


def new_memory(distance: float = 0.0) -> np.ndarray:
    """What a driver keeps from sample to sample, at the start of a course.

    Args:
        distance: along the course where the car is [m]; from there the driver keeps count.
    """
    memory = np.zeros(MEMORY)
    memory[0] = distance
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
    u[0] = _hand_wheel(driver, course, memory, left, travel, math.hypot(vx, vy), yaw_rate, dt)
    here, ahead = memory[0], memory[0] + driver.preview * vx
    wanted = at(course.speed, here / course.step)
    speeding_up = driver.mass * at(course.acceleration, ahead / course.step)
    air = 0.5 * AIR_DENSITY * driver.drag_area * vx * abs(vx)
    limit = min(driver.largest_force, driver.power / max(vx, 1.0))
    memory[1], memory[2] = pedals(
        driver, wanted, speeding_up + air, vx, memory[1], memory[2], limit, dt
    )
    torques(driver, memory[2], u)
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
        position = memory[0] / course.step
        heading = at(course.heading, position)
        dx, dy = x - at(course.x, position), y - at(course.y, position)
        memory[0] += dx * math.cos(heading) + dy * math.sin(heading)
        left = dy * math.cos(heading) - dx * math.sin(heading)
    turn = direction - heading
    return left, turn - 2.0 * math.pi * round(turn / (2.0 * math.pi))


@njit(cache=True, nogil=True)
def _hand_wheel(driver, course, memory, left, travel, speed, yaw_rate, dt):
    """The angle of the hand wheel [rad]."""
    bend = at(course.curvature, (memory[0] + driver.preview * speed) / course.step)
    angle = math.atan(bend * driver.wheelbase) + driver.understeer * bend * speed**2
    fast = max(speed, SLOWEST_STEERING)
    # ahead by v T, e is undone as by a spring and damper of damping ratio 0.8: w = 1.6 / T
    stiffness = (1.6 / (driver.look_ahead * fast)) ** 2
    error = left + driver.look_ahead * fast * math.sin(travel)
    angle -= (driver.wheelbase + driver.understeer * fast**2) * stiffness * error
    angle -= driver.yaw_gain * (yaw_rate - at(course.curvature, memory[0] / course.step) * speed)
    change = driver.steering_rate * dt
    wanted = driver.steering_ratio * min(max(angle, -0.6), 0.6)
    memory[3] = min(max(wanted, memory[3] - change), memory[3] + change)
    return memory[3]


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
    u[1:3] = drive * driver.drive_front
    u[3:5] = drive * (1.0 - driver.drive_front)
    u[5:7] = brake * driver.brake_front
    u[7:9] = brake * (1.0 - driver.brake_front)


@njit(cache=True, nogil=True)
def lock(driver, wheel_speeds, u):
    """Limited-slip differentials: the slower wheel of an axle gets torque of the faster one."""
    for i in (1, 3):
        most = driver.locked_share * (u[i] + u[i + 1])
        passed = driver.locking * (wheel_speeds[i - 1] - wheel_speeds[i])
        passed = min(max(passed, -most), most)
        u[i] -= 0.5 * passed
        u[i + 1] += 0.5 * passed
