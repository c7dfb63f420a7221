"""Drives a simulated vehicle along a manoeuvre and records it as a `Drive`."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scenarios.driving.driver import CREEP, Driver, drive_along, new_memory, pedals, torques
from scenarios.driving.drivers import driver_of
from scenarios.driving.speed_profile import Course
from twin import (
    BRAKE_TORQUES,
    DRIVE_TORQUES,
    INPUTS,
    LOAD,
    OUTPUTS,
    ROAD_HEIGHTS,
    SCALES,
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

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """What a driver is to do, sample by sample: an angle of the hand wheel over time.

    Attributes:
        name: of the manoeuvre.
        dt: sample time [s].
        speed: (N,) to follow [m/s]; NaN: no foot on any pedal, the car coasts.
        steering: (N,) hand-wheel angle [rad].
        road: (N, 4) height under each wheel [m].
    """

    name: str
    dt: float
    speed: Array
    steering: Array
    road: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseManoeuvre:
    """What a driver is to do, place by place: a path to follow, and how fast.

    Attributes:
        name: of the manoeuvre.
        dt: sample time [s].
        course: path and speeds; the car starts at its first point, along it.
        road: (N, 4) height under each wheel [m].
    """

    name: str
    dt: float
    course: Course
    road: Array


def record(
    vehicle: Vehicle,
    manoeuvre: Manoeuvre | CourseManoeuvre,
    driver: Driver | None = None,
) -> Drive:
    """Drives a manoeuvre and records inputs, noise-free measurements and the truth.

    Truth holds every state by its name, sideslip [rad], the chassis' mass, CM and inertia, its
    scales (1: as in the files), each tyre's forces, moments and slips (`fx_fl` ...) and the
    noise-free outputs that are no state.

    Args:
        vehicle: the real one.
        manoeuvre: what its driver is to do.
        driver: who drives; by default who knows the car by its files.

    Raises:
        TwinError: the manoeuvre has another sample time than the vehicle, or the car blew up.
    """
    driver = driver_of(vehicle) if driver is None else driver
    car = Twin(vehicle)
    if abs(manoeuvre.dt - car.dt) > 1e-9:
        raise TwinError(f"{manoeuvre.name}: sample time is {manoeuvre.dt} s, the car's {car.dt} s")
    n = manoeuvre.road.shape[0]
    inputs, outputs, states = (np.empty((n, len(names))) for names in (INPUTS, OUTPUTS, STATES))
    tyres = np.empty((n, len(WHEELS), len(TYRE_OUTPUTS)))
    records = inputs, outputs, states, tyres
    if isinstance(manoeuvre, CourseManoeuvre):
        car.reset(manoeuvre.course.speed[0], manoeuvre.road[0])
        done = _follow(car.car, driver, manoeuvre.course, new_memory(), manoeuvre.road, *records)
    else:
        car.reset(float(np.nan_to_num(manoeuvre.speed[0])), manoeuvre.road[0])
        done = _act(car.car, driver, manoeuvre.speed, manoeuvre.steering, manoeuvre.road, *records)
    if done < n:
        raise TwinError(f"{manoeuvre.name}: {vehicle.source} blew up at {done * car.dt:.3f} s")
    return Drive(
        time=np.arange(n) * car.dt,
        inputs=inputs,
        input_names=INPUTS,
        measurements=outputs,
        output_names=OUTPUTS,
        truth=truth_of(vehicle, states, outputs, tyres),
        settings={"manoeuvre": manoeuvre.name, "vehicle": vehicle.source.name},
    )


def truth_of(vehicle: Vehicle, states: Array, outputs: Array, tyres: Array) -> dict[str, Array]:
    """What is true of a drive, by name: see `record`."""
    truth = {name: states[:, i] for i, name in enumerate(STATES)}
    truth |= {name: outputs[:, i] for i, name in enumerate(OUTPUTS) if name not in truth}
    truth["sideslip"] = np.arctan2(truth["vy"], np.maximum(truth["vx"], 1e-3))
    body = vehicle.chassis()
    values = (body.mass, *body.cm, *np.diag(body.inertia), *body.inertia[[0, 0, 1], [1, 2, 2]])
    truth |= {
        name: np.full(states.shape[0], value) for name, value in zip(LOAD, values, strict=True)
    }
    scales = dict(vehicle.scales)
    truth |= {name: np.full(states.shape[0], scales.get(name, 1.0)) for name in SCALES}
    for w, wheel in enumerate(WHEELS):
        truth |= {f"{name}_{wheel}": tyres[:, w, i] for i, name in enumerate(TYRE_OUTPUTS)}
    return truth


@njit(cache=True, nogil=True)
def _act(car, driver, speed, steering, road, inputs, outputs, states, tyres):
    """Drives all samples by time; returns how many were sound."""
    integral, force = 0.0, 0.0
    for k in range(speed.size):
        read_states(car, states[k])
        inputs[k, U.steering_wheel_angle] = steering[k]
        inputs[k, ROAD_HEIGHTS] = road[k]
        integral, force = pedals(
            driver, speed[k], 0.0, states[k, X.vx], integral, force, driver.largest_force, car.dt
        )
        if speed[k] == 0.0 and states[k, X.vx] < CREEP:
            inputs[k, DRIVE_TORQUES], inputs[k, BRAKE_TORQUES] = 0.0, driver.holding_torque
        else:
            torques(driver, force, inputs[k])
        step(car, inputs[k], outputs[k])
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return speed.size


@njit(cache=True, nogil=True)
def _follow(car, driver, course, memory, road, inputs, outputs, states, tyres):
    """Drives all samples along a course; returns how many were sound."""
    for k in range(road.shape[0]):
        x = states[k]
        read_states(car, x)
        inputs[k, ROAD_HEIGHTS] = road[k]
        drive_along(
            driver, course, memory, x[X.x], x[X.y], x[X.yaw], x[X.vx], x[X.vy], x[X.yaw_rate],
            x[SPINS], car.dt, inputs[k],
        )  # fmt: skip
        step(car, inputs[k], outputs[k])
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return road.shape[0]
