"""Drives a planned manoeuvre with a simulated car: the plan's steering and a soft lane keeper's.

Speeds and steering are those of the plan over time. Besides, a driver who corrects little and
slowly keeps the car near the middle of its road, so that sines of the steering do not add up to a
heading; along a circuit the same driver takes the bends.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from scenarios.driving.circuit import circuit
from scenarios.driving.driver import CREEP, at, drive_along, new_memory, pedals, torques
from scenarios.driving.drivers import driver_of
from scenarios.driving.path import Piece, follow_on, path_of
from scenarios.driving.record import truth_of
from scenarios.driving.speed_profile import GRAVITY, Course, Limits, course_of
from scenarios.planning.limits import PlanLimits
from twin import (
    INPUTS,
    OUTPUTS,
    ROAD_HEIGHTS,
    SPINS,
    STATES,
    TYRE_OUTPUTS,
    WHEELS,
    Drive,
    Twin,
    TwinError,
    U,
    Vehicle,
    X,
)
from twin.kernel import is_sound, read_states, step
from twin.stepping import AIR_DENSITY

Array = NDArray[np.float64]

_SOFT = 0.9  # [s / sqrt(m)], look-ahead of the lane keeper over the root of the width; chosen
_WIDE = 60.0  # [m], beyond which it does not get slower
_KEEPING = 2.0  # [rad/s], of the hand wheel; chosen
_BENDS = 0.6  # share of the lateral acceleration that a circuit's bends may take


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What is to be driven.

    Attributes:
        name: in words.
        speed: (N,) wanted [m/s].
        steering: (N,) of the hand wheel, besides the lane keeper's [rad].
        repeats: whether it starts and ends at a standstill and is driven again and again.
        free: whether the car goes where the steering takes it, without a lane keeper.
    """

    name: str
    speed: Array
    steering: Array
    repeats: bool = False
    free: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Driven:
    """A motion as it was driven.

    Attributes:
        drive: noise-free.
        left: (N,) of the middle of the road [m].
    """

    drive: Drive
    left: Array


def course_for(limits: PlanLimits, vehicle: Vehicle) -> Course:
    """The middle of the road, and how fast its bends can be driven."""
    car = vehicle.figures
    length = limits.seconds * limits.fast + 500.0
    path = path_of([Piece(length, 0.0, 0.0)])
    if limits.road == "circuit":
        lap = circuit()
        path = follow_on([lap] * (2 + int(length / (lap.step * lap.x.size))))
    allowed = Limits(
        lateral=_BENDS * limits.lateral / GRAVITY,
        accelerating=limits.accelerating / GRAVITY,
        braking=0.6 * limits.braking / GRAVITY,
        speed=limits.fast,
        power=car.power,
        mass=car.mass,
        drag_area=car.drag_area,
    )
    return course_of(path, allowed, start=limits.fast)


def driven(
    vehicle: Vehicle,
    motion: Motion,
    course: Course,
    width: float,
    parameters: ArrayLike | None = None,
) -> Driven:
    """Drives a motion.

    Args:
        vehicle: the car.
        motion: what is driven.
        course: the middle of the road.
        width: of the road [m]: the lane keeper of a wide one is slower.
        parameters: (20,) deltas from the vehicle's; zero if not given.

    Raises:
        TwinError: the car blew up.
    """
    driver, car = driver_of(vehicle), Twin(vehicle)
    look_ahead = float(_SOFT * np.sqrt(min(width, _WIDE)))
    keeper = driver._replace(look_ahead=look_ahead, yaw_gain=0.0, steering_rate=_KEEPING)
    if parameters is not None:
        car.set_parameters(parameters)
    car.reset(float(motion.speed[0]))
    n = motion.speed.size
    ahead = np.nan_to_num(np.gradient(motion.speed, car.dt))
    inputs, outputs, states = (np.zeros((n, len(names))) for names in (INPUTS, OUTPUTS, STATES))
    tyres, left = np.empty((n, len(WHEELS), len(TYRE_OUTPUTS))), np.empty(n)
    done = _drive(
        car.car, driver, keeper, course, new_memory(), motion.speed, ahead, motion.steering,
        motion.free, inputs, outputs, states, tyres, left,
    )  # fmt: skip
    if done < n:
        raise TwinError(f"plan: {vehicle.source} blew up at {done * car.dt:.3f} s")
    drive = Drive(
        time=np.arange(n) * car.dt,
        inputs=inputs,
        input_names=INPUTS,
        measurements=outputs,
        output_names=OUTPUTS,
        truth=truth_of(vehicle, states, outputs, tyres),
        settings={"manoeuvre": motion.name, "vehicle": vehicle.source.name},
    )
    return Driven(drive=drive, left=left)


@njit(cache=True, nogil=True)
def _drive(
    car, driver, keeper, course, memory, speed, ahead, steering, free,
    inputs, outputs, states, tyres, left,
):  # fmt: skip
    """Drives all samples; returns how many were sound."""
    integral, force = 0.0, 0.0
    for k in range(speed.size):
        x, u = states[k], inputs[k]
        read_states(car, x)
        drive_along(
            keeper, course, memory, x[X.x], x[X.y], x[X.yaw], x[X.vx], x[X.vy], x[X.yaw_rate],
            x[SPINS], car.dt, u,
        )  # fmt: skip
        place = memory[0] / course.step
        heading = at(course.heading, place)
        left[k] = (x[X.y] - at(course.y, place)) * np.cos(heading)
        left[k] -= (x[X.x] - at(course.x, place)) * np.sin(heading)
        u[U.steering_wheel_angle] = steering[k] + (0.0 if free else u[U.steering_wheel_angle])
        u[ROAD_HEIGHTS] = 0.0
        wanted = min(speed[k], at(course.speed, place))
        limit = min(driver.largest_force, driver.power / max(x[X.vx], 1.0))
        known = 0.0
        if wanted == speed[k]:
            known = driver.mass * ahead[k]
            known += 0.5 * AIR_DENSITY * driver.drag_area * x[X.vx] ** 2
        integral, force = pedals(driver, wanted, known, x[X.vx], integral, force, limit, car.dt)
        if wanted == 0.0 and x[X.vx] < CREEP:
            u[1:5], u[5:9] = 0.0, driver.holding_torque
        else:
            torques(driver, force, u)
        step(car, u, outputs[k])
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return speed.size
