"""Drives a simulated vehicle along a manoeuvre and records it as a `Drive`."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from twin import (
    INPUTS,
    LOAD,
    OUTPUTS,
    SCALES,
    STATES,
    TYRE_OUTPUTS,
    WHEELS,
    Drive,
    Twin,
    TwinError,
    Vehicle,
)
from twin.kernel import is_sound, read_states, step

Array = NDArray[np.float64]


# Slower than this a driver who wants to stand still just holds the brake [m/s]; chosen.
CREEP = 0.3


class Driver(NamedTuple):
    """A proportional-integral speed driver; forces are those at the road, of all wheels."""

    proportional: float = 4000.0  # [N per m/s]
    integral: float = 600.0  # [N per m]
    largest_force: float = 9000.0  # [N], of the engine
    pedal_rate: float = 20000.0  # [N/s]
    wheel_radius: float = 0.36  # [m], turns force into torque
    drive_front: float = 0.4  # share of the front axle
    brake_front: float = 0.65
    holding_torque: float = 500.0  # [N m] per wheel, at a standstill


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """What a driver is to do, sample by sample.

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


def record(vehicle: Vehicle, manoeuvre: Manoeuvre, driver: Driver = Driver()) -> Drive:  # noqa: B008
    """Drives the vehicle and records inputs, noise-free measurements and the truth.

    Truth holds every state by its name, sideslip [rad], the chassis' mass, CM and inertia, its
    scales (1: as in the files), each
    tyre's forces, moments and slips (`fx_fl` ...) and the noise-free outputs that are no state.

    Raises:
        TwinError: the manoeuvre has another sample time than the vehicle, or the car blew up.
    """
    car = Twin(vehicle)
    if abs(manoeuvre.dt - car.dt) > 1e-9:
        raise TwinError(f"{manoeuvre.name}: sample time is {manoeuvre.dt} s, the car's {car.dt} s")
    n = manoeuvre.speed.size
    inputs, outputs, states = (np.empty((n, len(names))) for names in (INPUTS, OUTPUTS, STATES))
    tyres = np.empty((n, len(WHEELS), len(TYRE_OUTPUTS)))
    car.reset(float(np.nan_to_num(manoeuvre.speed[0])), manoeuvre.road[0])
    done = _follow(
        car.car, driver, manoeuvre.speed, manoeuvre.steering, manoeuvre.road,
        inputs, outputs, states, tyres,
    )  # fmt: skip
    if done < n:
        raise TwinError(f"{manoeuvre.name}: {vehicle.source} blew up at {done * car.dt:.3f} s")
    return Drive(
        time=np.arange(n) * car.dt,
        inputs=inputs,
        input_names=INPUTS,
        measurements=outputs,
        output_names=OUTPUTS,
        truth=_truth(vehicle, states, outputs, tyres),
        settings={"manoeuvre": manoeuvre.name, "vehicle": vehicle.source.name},
    )


def _truth(vehicle: Vehicle, states: Array, outputs: Array, tyres: Array) -> dict[str, Array]:
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
def _follow(car, driver, speed, steering, road, inputs, outputs, states, tyres):
    """Drives all samples; returns how many were sound."""
    integral, force = 0.0, 0.0
    for k in range(speed.size):
        read_states(car, states[k])
        inputs[k, 0] = steering[k]
        inputs[k, 9:13] = road[k]
        integral, force = _pedals(driver, speed[k], states[k, 14], integral, force, car.dt)
        if speed[k] == 0.0 and states[k, 14] < CREEP:
            inputs[k, 1:5], inputs[k, 5:9] = 0.0, driver.holding_torque
        else:
            _torques(driver, force, inputs[k])
        step(car, inputs[k], outputs[k])
        tyres[k] = car.tyre_output
        if not is_sound(car):
            return k
    return speed.size


@njit(cache=True)
def _pedals(driver, wanted, speed, integral, before, dt):
    """The integral of the speed error [m] and the force wanted at the road [N], after a sample."""
    if np.isnan(wanted):
        integral, force = 0.0, 0.0
    else:
        error = wanted - speed
        force = driver.proportional * error + driver.integral * integral
        if abs(force) < driver.largest_force:
            integral += error * dt
    change = driver.pedal_rate * dt
    force = min(max(force, before - change), before + change, driver.largest_force)
    return integral, force


@njit(cache=True)
def _torques(driver, force, u):
    """Fills the torques of one sample of inputs for a force at the road [N]."""
    torque = 0.5 * driver.wheel_radius * force
    drive, brake = max(torque, 0.0), max(-torque, 0.0)
    u[1:3] = drive * driver.drive_front
    u[3:5] = drive * (1.0 - driver.drive_front)
    u[5:7] = brake * driver.brake_front
    u[7:9] = brake * (1.0 - driver.brake_front)
