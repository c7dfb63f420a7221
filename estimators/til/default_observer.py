"""The observer that logs are given: states and mass together, by the vehicle's own numbers.

The states are held by what is measured of them, so that no error of the torques adds up; the mass
comes from the longitudinal acceleration, cleared of what the wheel speeds' correction adds to it
(`estimators.til.law`). What the log does not measure is left out.
"""

import math
from collections.abc import Set
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from estimators.til.stream import rolling_radius
from twin import OUTPUTS, WHEELS, Twin, Vehicle

# Gains [1/s], of TiL Eq. (23); ay -> vy has no unit. Chosen: the prototype's of the joint observer
# on a sports car's laps, which the noise of a common IMU leaves alone.
WHEEL_SPEED, YAW_RATE, PITCH_RATE, SIDE = 100.0, 50.0, 10.0, 0.05
PRIOR_SD = 0.2  # of the mass, as a share of the vehicle's: a full car; chosen
NOISE_DENSITY = 0.03  # [m/s2 over root of Hz]: an IMU of 1 m/s2 at 1 kHz; chosen
DRIFT = 0.2  # [kg over root of s]: 2 kg in two minutes; chosen
OFFSET_SD = 0.3  # [m/s2]: 2 degrees of slope or a poor IMU; chosen
LEAST_ACCELERATION = 0.5  # [m/s2]; below it drag and slopes weigh more than the mass; chosen
LARGEST_COMPENSATION = 1.0  # [m/s2]: three times what a full car needs in town; chosen
LARGEST_SHARE = 0.6  # of the vehicle's mass, that a load adds or takes; chosen
LARGEST_YAW_RATE = math.radians(3.0)  # TiL Eq. (24)


class Default(NamedTuple):
    """An observer and what goes with it."""

    observer: Observer
    rolling_radius: float  # [m]
    parameters: tuple[str, ...]  # that are estimated
    left_out: tuple[str, ...]  # sentences
    largest: dict[str, float]  # that a parameter's estimate can be, in either direction


def default_observer(
    vehicle: Vehicle,
    measured: Set[str],
    *,
    mass: bool = True,
    ax_noise: float = NOISE_DENSITY,
) -> Default:
    """The guarded observer of a vehicle whose log measures these outputs.

    Args:
        vehicle: of the twin.
        measured: names of what the log measures.
        mass: whether the log's torques and accelerations can tell it.
        ax_noise: density of the noise of a_x, if the log tells [m/s2 over root of Hz].

    Raises:
        TwinError: the vehicle's files are missing or broken.
    """
    twin = Twin(vehicle)
    radius = rolling_radius(Observer(twin, []))
    wheels = [f"wheel_speed_{wheel}" for wheel in WHEELS]
    wanted = {
        **{(name, name): WHEEL_SPEED for name in wheels},
        ("yaw_rate", "yaw_rate"): YAW_RATE,
        ("pitch_rate", "pitch_rate"): PITCH_RATE,
        ("vy", "ay"): SIDE,
    }
    gains = {pair: gain for pair, gain in wanted.items() if pair[1] in measured}
    missing = [of for _, of in wanted if of not in measured]
    left_out = [f"Without {name} the twin is not corrected by it." for name in missing]
    laws = [mass_law(twin, radius, measured, ax_noise)] if mass else []
    return Default(
        observer=Observer(twin, laws, gains, guarded=True),
        rolling_radius=radius,
        parameters=tuple(law.parameter for law in laws),
        left_out=tuple(left_out),
        largest={law.parameter: law.largest for law in laws},
    )


def til_observer(car: str | Path | Vehicle, measured: Set[str] = frozenset(OUTPUTS)) -> Observer:
    """The observer of states and mass that `til estimate` uses.

    >>> from estimators import til_observer
    >>> observer = til_observer("suv")
    >>> observer.reset(speed=10.0)  # [m/s]; then observer.run(drive), or update(u, y) by samples

    Args:
        car: its name or file, or a `Vehicle`.
        measured: names of `twin.OUTPUTS` that the drive has; without ax there is no mass.

    Raises:
        TwinError: the car's files are missing or broken.
    """
    vehicle = car if isinstance(car, Vehicle) else Vehicle.load(car)
    return default_observer(vehicle, measured, mass="ax" in measured).observer


def mass_law(
    twin: Twin, radius: float, measured: Set[str], ax_noise: float = NOISE_DENSITY
) -> ParameterLaw:
    """The law of the mass for a car.

    Args:
        twin: of the car.
        radius: at which its wheels roll [m].
        measured: names of what the log measures.
        ax_noise: density of the noise of a_x [m/s2 over root of Hz]; never less than an IMU has.
    """
    car = twin.car
    mass = float(car.nominal[0] + car.other_mass[0])
    wheels = any(f"wheel_speed_{wheel}" in measured for wheel in WHEELS)
    share = float(np.mean(car.spin_inertia)) / (radius * mass)
    return ParameterLaw(
        parameter="mass",
        signal="ax",
        scale=mass,
        prior_sd=PRIOR_SD * mass,
        noise_density=max(ax_noise, NOISE_DENSITY),
        drift=DRIFT,
        offset_sd=OFFSET_SD,
        offset_jump=OFFSET_SD,
        least_signal=LEAST_ACCELERATION,
        largest_yaw_rate=LARGEST_YAW_RATE if "yaw_rate" in measured else math.inf,
        compensation=WHEEL_SPEED * share if wheels else 0.0,
        largest_compensation=LARGEST_COMPENSATION,
        largest=LARGEST_SHARE * mass,
    )
