"""Trips of a car along a line, made up for the tests of weighing: law, signals, errors known."""

import numpy as np

from estimators.weigh.calibration import Calibration
from estimators.weigh.losses import TERMS
from estimators.weigh.scatter import Scatter
from estimators.weigh.trip import Trip

DT = 0.1
MASS, ROTATING, DRAG, ROLLING = 1280.0, 60.0, 0.42, 0.1  # kg, kg, N/(m/s)2, m/s2
SCALE = 1.2  # of the log's force over the true one


def made_up_trip(
    seed,
    load=0.0,
    minutes=15.0,
    *,
    scale=SCALE,
    regeneration=0.1,
    pedal=True,
    braking=True,
    slope=0.03,
    noise=0.05,
    liveliness=1.0,
    dragging=0.0,
):
    """A drive in traffic: the driver follows random speeds, on hills, in wind, on worn sensors.

    Args:
        seed: of everything random.
        load: beyond MASS [kg].
        minutes: of the drive.
        scale: of the force in the log.
        regeneration: what a negative force of the motor falls short by in the log.
        pedal: whether the log has the accelerator.
        braking: whether the driver brakes harder than the motor does.
        slope: standard deviation of the road's.
        noise: of the accelerometer [m/s2].
        liveliness: of the speeds that the driver wants.
        dragging: deceleration by a brake that never lets go [m/s2].
    """
    random = np.random.default_rng(seed)
    n = round(60.0 * minutes / DT)
    wanted = np.repeat(random.uniform(3.0, 32.0, n // 150 + 1), 150)[:n]
    wanted = 15.0 + liveliness * (wanted - 15.0)
    hills = slope * smooth(slow(random, n, 20.0), 50)
    wind = 3.0 * slow(random, n, 60.0)
    mass, speed = MASS + load, 12.0
    columns = np.zeros((n, 4))
    for k in range(n):
        demand = np.clip(0.4 * (wanted[k] - speed), -2.5, 2.2)
        force = mass * np.clip(demand + 0.15, -1.3, 2.5)
        brake = mass * max(0.0, -demand - 1.3) if braking else 0.0
        air = DRAG * (speed + wind[k]) * abs(speed + wind[k])
        specific = (force - brake - air) / (mass + ROTATING) - ROLLING - dragging
        step = max(DT * (specific - 9.81 * hills[k]), -speed)
        columns[k] = force, speed + 0.5 * step, specific, demand > -1.15
        speed += step
    force, speed, specific, pressed = columns.T
    shown = np.where(force < 0.0, force / (1.0 + regeneration), force)
    return Trip(
        name=f"trip-{seed}",
        time=DT * np.arange(n),
        force=scale * shown,
        speed=np.round(speed * 36.0) / 36.0,  # to 0.1 km/h
        acceleration=specific + 0.05 + noise * random.standard_normal(n),
        pedal=0.5 * pressed if pedal else None,
    )


def slow(random, n, seconds):
    """(n,) of a process with a correlation time and a standard deviation of 1."""
    decay, values = np.exp(-DT / seconds), np.zeros(n)
    shocks = np.sqrt(1.0 - decay**2) * random.standard_normal(n)
    for k in range(1, n):
        values[k] = decay * values[k - 1] + shocks[k]
    return values


def smooth(values, samples):
    """The signal averaged over so many samples, twice, with its standard deviation kept."""
    window = np.ones(samples) / samples
    averaged = np.convolve(np.convolve(values, window, "same"), window, "same")
    return averaged * values.std() / averaged.std()


def ideal(mass, rotating_mass, drag_area=0.69):
    """The calibration of a car whose log tells the true torques."""
    scatter = Scatter(
        scale=1.0, scale_sd=0.001, effect=0.0, rolling=0.1, tau=0.01, phi=1.0, trips=20.0,
        as_declared=np.ones(20),
    )  # fmt: skip
    return Calibration(
        mass=mass, mass_sd=20.0, rotating_mass=rotating_mass, losses=np.zeros(len(TERMS)),
        scatter=scatter, drag_area=drag_area, noise=1.0, hardest_rolling=0.2,
    )  # fmt: skip
