"""Simulated trips: the twin's car in everyday traffic, logged as a real car's bus would log it.

The car drives with its motor on the rear wheels and brakes with friction brakes beyond what the
motor can, on hills and in wind, after a driver who follows the speeds of a town and its roads. A
hill turns the gravity of the model, which on a plane road is the same. The log has 10 Hz, a
quantised speed, torques with a scale and losses that the car does not tell, and no brakes.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators.weigh.trip import Trip
from scenarios.driving.driver import CREEP
from scenarios.weighing.car import car_of
from twin import (
    BRAKE_TORQUES,
    INPUTS,
    OUTPUTS,
    STATES,
    TORQUES,
    PointMass,
    Twin,
    TwinError,
    U,
    Vehicle,
    X,
    Y,
)
from twin.kernel import is_sound, read_states, step

Array = NDArray[np.float64]

GRAVITY = 9.81
FIRST_TORQUE, FIRST_BRAKE, AFTER_TORQUES = TORQUES.start, BRAKE_TORQUES.start, TORQUES.stop
HALF_AIR_DENSITY = 0.6  # [kg/m3]
SPEEDS = (30.0, 50.0, 50.0, 70.0, 100.0)  # [km/h] that are allowed on a stretch
STRETCH = (10.0, 40.0)  # [s] between two of them
STOP = 0.25  # share of stretches that end at a red light
# Of the driver: gain on the speed's error [1/s], accelerations [m/s2] that he asks for
GAIN, BRISKEST, HARDEST = 0.5, 2.0, -2.5
REGENERATION = 1.3  # [m/s2] to which the motor brakes, the friction brakes beyond
BRAKE_FRONT = 0.65
_REAR_SEAT = np.array([-0.4, 0.0, 0.1])  # in the chassis frame [m]
_LOG_RATE = 10.0  # [Hz]


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What a trip meets, and how its log deviates from the car.

    Attributes:
        hills: standard deviation of the slope.
        wind: of the wind along the road [m/s].
        torque_scale: of the log's torques over the true ones.
        regeneration_loss: share by which a braking motor's torque in the log falls short.
        scale_sd: of the torques' scale from trip to trip.
        acceleration_sd: of the accelerometer's noise [m/s2].
        offset_sd: of its offset from trip to trip [m/s2].
        speed_step: to which the speed is rounded [m/s].
    """

    hills: float = 0.02
    wind: float = 3.0
    torque_scale: float = 1.2
    regeneration_loss: float = 0.1
    scale_sd: float = 0.006
    acceleration_sd: float = 0.08
    offset_sd: float = 0.05
    speed_step: float = 0.1 / 3.6


def simulated_trip(
    vehicle: Vehicle,
    load: float,
    seed: int,
    minutes: float = 15.0,
    around: Surroundings = Surroundings(),
) -> Trip:
    """Drives and logs a trip.

    Args:
        vehicle: the car with its driver, driven at its rear wheels.
        load: on the rear seats [kg]; may be 0.
        seed: of all that is random.
        minutes: of the trip.
        around: hills, wind, sensors.

    Raises:
        TwinError: the car blew up.
    """
    rng = np.random.default_rng(seed)
    loaded = vehicle
    if load > 0.0:
        loaded = vehicle.with_loads([PointMass(name="load", mass=load, position=_REAR_SEAT)])
    twin = Twin(loaded)
    n = int(minutes * 60.0 / twin.dt)
    every = round(1.0 / (_LOG_RATE * twin.dt))
    wanted = _wanted_speed(rng, n, twin.dt)
    slope = around.hills * _slow(rng, n, twin.dt, 15.0)
    wind = around.wind * _slow(rng, n, twin.dt, 10.0)
    wheel = float(twin.data.xpos[twin.car.wheel_body[2:], 2].mean())
    mass = float(twin.model.body_subtreemass[0])
    log = np.zeros((n // every, 4))
    twin.reset(float(wanted[0]))
    done = _drive(
        twin.car, twin.model.opt.gravity, twin.data.xfrc_applied[int(twin.car.chassis)],
        wanted, slope, wind, every, mass, wheel, twin.car.drag_area, log,
        np.zeros(len(INPUTS)), np.zeros(len(OUTPUTS)), np.zeros(len(STATES)),
    )  # fmt: skip
    if not done:
        raise TwinError(f"{vehicle.source}: blew up on the simulated trip of seed {seed}")
    return _logged(rng, log, car_of(vehicle).radius, f"seed-{seed}", around)


def _logged(rng: np.random.Generator, log: Array, radius: float, name: str, around: Surroundings):
    torque, speed, acceleration, pedal = log.T
    shown = np.where(torque < 0.0, torque / (1.0 + around.regeneration_loss), torque)
    scale = around.torque_scale * (1.0 + around.scale_sd * rng.standard_normal())
    noise = around.acceleration_sd * rng.standard_normal(speed.size)
    return Trip(
        name=name,
        time=np.arange(speed.size) / _LOG_RATE,
        force=scale * shown / radius,
        speed=around.speed_step * np.round(speed / around.speed_step),
        acceleration=acceleration + around.offset_sd * rng.standard_normal() + noise,
        pedal=pedal,
    )


def _wanted_speed(rng: np.random.Generator, n: int, dt: float) -> Array:
    """(n,) speeds that the driver would like to have [m/s]."""
    wanted, k = np.empty(n), 0
    while k < n:
        stretch = int(rng.uniform(*STRETCH) / dt)
        wanted[k : k + stretch] = rng.choice(SPEEDS) / 3.6 * rng.uniform(0.85, 1.05)
        if rng.random() < STOP:
            wanted[k + stretch // 2 : k + stretch] = 0.0
        k += stretch
    return wanted


def _slow(rng: np.random.Generator, n: int, dt: float, seconds: float) -> Array:
    """(n,) smooth and of standard deviation 1, with a correlation time [s]."""
    coarse = np.arange(int(n * dt) + 12)
    window = np.hanning(2 * int(seconds) + 1)
    values = np.convolve(rng.standard_normal(coarse.size + window.size), window, "valid")
    values = values[: coarse.size] / np.sqrt((window**2).sum())
    return np.interp(np.arange(n) * dt, coarse, values)


@njit(cache=True, nogil=True)
def _drive(car, gravity, push, wanted, slope, wind, every, mass, wheel, drag_area, log, u, y, x):
    """Drives all samples, fills the log's rows of torque, speed, acceleration, pedal.

    Returns whether the car stayed sound.
    """
    row, force = 0, 0.0
    means = np.zeros(4)
    for k in range(wanted.size):
        read_states(car, x)
        speed = x[X.vx]
        gravity[0], gravity[2] = -GRAVITY * slope[k], -GRAVITY
        ahead = speed + wind[k]
        push[0] = -HALF_AIR_DENSITY * drag_area * (ahead * abs(ahead) - speed * abs(speed))
        demand = min(max(GAIN * (wanted[k] - speed), HARDEST), BRISKEST)
        # the pedal holds the speed on hills and in wind, as far as the driver feels them
        wish = mass * (demand + 0.1 + GRAVITY * slope[k]) - push[0]
        wish += HALF_AIR_DENSITY * drag_area * speed * abs(speed)
        motor = max(wish, -mass * REGENERATION)
        brake = max(motor - wish, 0.0)
        force += (motor - force) * car.dt / 0.15
        stands = wanted[k] == 0.0 and speed < CREEP
        u[FIRST_TORQUE:AFTER_TORQUES] = 0.0
        if stands:
            force = 0.0
            u[FIRST_BRAKE:AFTER_TORQUES] = 500.0
        else:
            u[U.drive_torque_rl] = u[U.drive_torque_rr] = 0.5 * wheel * force
            u[U.brake_torque_fl] = u[U.brake_torque_fr] = 0.5 * wheel * BRAKE_FRONT * brake
            u[U.brake_torque_rl] = u[U.brake_torque_rr] = 0.5 * wheel * (1 - BRAKE_FRONT) * brake
        step(car, u, y)
        if not is_sound(car):
            return False
        means[0] += 2.0 * u[U.drive_torque_rl]
        means[1] += speed
        means[2] += y[Y.ax]
        means[3] += 0.0 if stands or brake > 0.0 or wish < -0.95 * mass * REGENERATION else 0.3
        if (k + 1) % every == 0 and row < log.shape[0]:
            log[row] = means / every
            means[:] = 0.0
            row += 1
    return True
