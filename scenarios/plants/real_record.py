"""Drives a real car: what the driver asks for is told to the twin, what acts is something else.

Between the driver and the wheels is what `scenarios.plants.real_parts` sets every sample; the road
is not flat.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scenarios.driving.driver import CREEP, Driver, drive_along, new_memory, pedals, torques
from scenarios.driving.drivers import driver_of
from scenarios.driving.record import CourseManoeuvre, Manoeuvre, truth_of
from scenarios.plants.random_car import RealCar
from scenarios.plants.real_parts import act_on, blow, parts_of, suspend, turn_wheels
from scenarios.plants.real_vehicle import real_vehicle
from scenarios.plants.surroundings import BEFORE, SPACING, surroundings
from twin import (
    INPUTS,
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
    Vehicle,
    X,
)
from twin.kernel import is_sound, read_states, step

Array = NDArray[np.float64]

FIRST_SPIN, AFTER_SPINS = SPINS.start, SPINS.stop
FIRST_ROAD, AFTER_ROADS = ROAD_HEIGHTS.start, ROAD_HEIGHTS.stop


def record_real(
    vehicle: Vehicle,
    real: RealCar,
    manoeuvre: Manoeuvre | CourseManoeuvre,
    driver: Driver | None = None,
) -> Drive:
    """Drives a manoeuvre and records what is told of the inputs, perfect measurements, the truth.

    The recorded road is that of the manoeuvre; the car's own road comes on top of it and is not
    told. `scenarios.plants.sensors.told` makes of it what a log has.

    Args:
        vehicle: the twin's, with the loads on board.
        real: how the car differs.
        manoeuvre: what is driven.
        driver: who drives; by default who knows the car by its files.

    Raises:
        TwinError: the manoeuvre has another sample time than the vehicle, or the car blew up.
    """
    driver = driver_of(vehicle) if driver is None else driver
    changed = real_vehicle(vehicle, real)
    twin = Twin(changed)
    if abs(manoeuvre.dt - twin.dt) > 1e-9:
        raise TwinError(f"{manoeuvre.name}: sample time is {manoeuvre.dt} s, the car's {twin.dt} s")
    n = manoeuvre.road.shape[0]
    around = surroundings(real, n, twin.dt, float(twin.car.track))
    parts = parts_of(twin, real)
    inputs, outputs, states = (np.zeros((n, len(names))) for names in (INPUTS, OUTPUTS, STATES))
    tyres = np.empty((n, len(WHEELS), len(TYRE_OUTPUTS)))
    timed = isinstance(manoeuvre, Manoeuvre)
    first = manoeuvre.speed[0] if timed else manoeuvre.course.speed[0]
    road = np.empty(4)
    _road(around.heights, 0.0, parts.wheelbase, manoeuvre.road[0], road)
    twin.reset(float(np.nan_to_num(first)), road)
    arguments = (twin.car, parts, driver, around, manoeuvre.road)
    records = (inputs, outputs, states, tyres)
    if timed:
        done = _act(*arguments, manoeuvre.speed, manoeuvre.steering, *records)
    else:
        done = _follow(*arguments, manoeuvre.course, new_memory(), *records)
    if done < n:
        raise TwinError(f"{manoeuvre.name}: {vehicle.source} blew up at {done * twin.dt:.3f} s")
    inputs[:, ROAD_HEIGHTS] = manoeuvre.road
    return Drive(
        time=np.arange(n) * twin.dt,
        inputs=inputs,
        input_names=INPUTS,
        measurements=outputs,
        output_names=OUTPUTS,
        truth=truth_of(changed, states, outputs, tyres) | _scales(real, n),
        settings={
            "manoeuvre": manoeuvre.name,
            "vehicle": vehicle.source.name,
            "real_car": {name: list(values) for name, values in real.values},
        },
    )


def _scales(real: RealCar, n: int) -> dict[str, Array]:
    """Truth of the twin's parameters that are no load, NaN where the car has no single number."""
    of = {
        "tyre_friction": real["tyre_friction"].mean(),
        "cornering_stiffness": real["cornering_stiffness"].mean(),
        "drag": real.number("drag"),
        "spring": real["springs"].mean(),
        "damper": real["dampers"].mean(),
        "relaxation": real.number("relaxation"),
        "drive_torque": real.number("drive_scale") * real["drive_efficiency"].mean(),
        "brake_torque": real["brake_balance"].mean(),
    }
    return {name: np.full(n, of[name]) for name in SCALES if name in of}


@njit(cache=True, nogil=True)
def _act(car, parts, driver, around, road, speed, steering, inputs, outputs, states, tyres):
    """Drives all samples by time; returns how many were sound."""
    integral, force, distance = 0.0, 0.0, 0.0
    now, heat = np.zeros(inputs.shape[1]), np.zeros(4)
    for k in range(speed.size):
        x, told = states[k], inputs[k]
        read_states(car, x)
        told[0] = steering[k]
        integral, force = pedals(
            driver, speed[k], 0.0, x[X.vx], integral, force, driver.largest_force, car.dt
        )
        if speed[k] == 0.0 and x[X.vx] < CREEP:
            told[1:5], told[5:9] = 0.0, driver.holding_torque
        else:
            torques(driver, force, told)
        _advance(car, parts, around, k, distance, road[k], x, told, now, heat, outputs[k])
        distance += x[X.vx] * car.dt
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return speed.size


@njit(cache=True, nogil=True)
def _follow(car, parts, driver, around, road, course, memory, inputs, outputs, states, tyres):
    """Drives all samples along a course; returns how many were sound."""
    now, heat, distance = np.zeros(inputs.shape[1]), np.zeros(4), 0.0
    for k in range(road.shape[0]):
        x, told = states[k], inputs[k]
        read_states(car, x)
        drive_along(
            driver, course, memory, x[X.x], x[X.y], x[X.yaw], x[X.vx], x[X.vy], x[X.yaw_rate],
            x[FIRST_SPIN:AFTER_SPINS], car.dt, told,
        )  # fmt: skip
        _advance(car, parts, around, k, distance, road[k], x, told, now, heat, outputs[k])
        distance += x[X.vx] * car.dt
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return road.shape[0]


@njit(cache=True, nogil=True)
def _advance(car, parts, around, k, distance, road, x, told, now, heat, y):
    """One step of the car with what acts on it; fills the outputs."""
    act_on(parts, car.dt, k, x, told, now, heat)
    _road(around.heights, distance, parts.wheelbase, road, now[FIRST_ROAD:AFTER_ROADS])
    suspend(car, parts, x)
    turn_wheels(car, parts, x)
    blow(parts, around.wind[k], x)
    step(car, now, y)


@njit(cache=True, nogil=True)
def _road(heights, distance, wheelbase, told, road):
    """Fills the heights under the wheels: the manoeuvre's and the car's own road."""
    for w in range(4):
        place = (distance + BEFORE - (wheelbase if w > 1 else 0.0)) / SPACING
        i = min(max(int(place), 0), heights.shape[0] - 2)
        part = place - i
        here = heights[i, w % 2] + part * (heights[i + 1, w % 2] - heights[i, w % 2])
        road[w] = told[w] + here
