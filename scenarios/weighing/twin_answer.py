"""The twin's own answer: the TiL observer around the car's twin weighs a trip.

The twin gets the log's torques at its rear wheels, less the losses of the calibration, and drives
on the level: its accelerometer then shows the specific force of the real car wherever that drives,
as slope and gravity cancel. Its drag is the calibration's: a data sheet's, wrong by a quarter,
makes the mass wrong by three percent. The measured speed stands for the speeds of the front wheels,
which hold the twin at the car's speed; the rear wheels slip as they drive, and to hold them to a
speed that knows no slip would pull the twin back whenever it drives. Where a friction brake may act
the accelerometer is hidden from the observer, and its mass law rests.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.til.law import ParameterLaw
from estimators.til.observer import Observer
from estimators.weigh.calibration import Calibration
from estimators.weigh.samples import usable
from estimators.weigh.trip import Trip
from scenarios.weighing.car import car_of
from twin import INPUTS, OUTPUTS, Drive, Twin, U, Vehicle, Y

Array = NDArray[np.float64]

ROLLING = ("fl", "fr")
# [1/s], gain that holds the twin at the measured speed, as its wheels have a twentieth of the car's
# inertia within two seconds; chosen: a larger one brings the speed's noise into the law
WHEEL_SPEED = 10.0
PRIOR_SD = 300.0  # [kg]: a full car
# [m/s2 over root of Hz]: a slow disturbance of 0.05 m/s2 over 5 s, as weighing assumes it
NOISE_DENSITY = 0.16
OFFSET_SD = 0.3  # [m/s2], of the accelerometer and the rolling resistance
LEAST_ACCELERATION = 0.1  # [m/s2] of the twin, below which drag tells more than the mass
# Of the mass, that a load adds or takes; chosen. A log whose speed is not its accelerometer's would
# else drive the mass to any number, and the twin to a standstill
LARGEST_SHARE = 0.6
PIECE = 60.0  # [s] of the trip at a time: a twin's history is long


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinAnswer:
    """What the observer says at the end of a trip.

    Attributes:
        name: of the trip.
        mass: of the car with everything in it, by the calibration's scale [kg].
        sd: standard deviation that the law claims [kg].
        at_bound: whether the mass has ever been at the bound of its estimate.
    """

    name: str
    mass: float
    sd: float
    at_bound: bool


def twin_answer(vehicle: Vehicle, trip: Trip, calibration: Calibration) -> TwinAnswer:
    """Runs the observer over a trip.

    Args:
        vehicle: the car, driven at its rear wheels.
        trip: 10 Hz or so; its signals are interpolated to the twin's steps.
        calibration: whose scale and losses turn the log's torques into the twin's.
    """
    car = car_of(vehicle)
    twin = Twin(_with_drag(vehicle, calibration.drag_area))
    law = ParameterLaw(
        parameter="mass",
        signal="ax",
        scale=car.mass,
        prior_sd=PRIOR_SD,
        noise_density=NOISE_DENSITY,
        offset_sd=OFFSET_SD,
        least_signal=LEAST_ACCELERATION,
        compensation=WHEEL_SPEED * float(twin.car.spin_inertia[0]) / (car.radius * car.mass),
        largest=LARGEST_SHARE * car.mass,
    )
    names = [f"wheel_speed_{wheel}" for wheel in ROLLING]
    observer = Observer(twin, [law], {(name, name): WHEEL_SPEED for name in names})
    force = calibration.effective_force(trip)
    speed = np.nan_to_num(trip.speed)
    hidden = np.where(usable(trip), trip.acceleration, np.nan)
    observer.reset(float(speed[0]))
    # a torque pushes with the height of the hub, which is less than the rolling radius
    lever = float(twin.data.xpos[twin.car.wheel_body[2:], 2].mean())
    last, mass, at_bound = float(trip.time[-1]), 0.0, False
    for start in np.arange(trip.time[0], last, PIECE):
        time = np.arange(start, min(start + PIECE, last), twin.dt)
        if time.size < 2:
            break
        drive = _drive(time, trip.time, force * lever, speed / car.radius, hidden)
        history = observer.run(drive)["mass"]
        mass = float(history[-1])
        at_bound |= bool((np.abs(history) >= (1.0 - 1e-6) * law.largest).any())
    return TwinAnswer(
        name=trip.name,
        mass=car.mass + mass,
        sd=observer.parameter_sd()["mass"],
        at_bound=at_bound,
    )


def _with_drag(vehicle: Vehicle, drag_area: float) -> Vehicle:
    """The vehicle with that c_d A [m2], within a factor of two of its file's."""
    factor = drag_area / float(Twin(vehicle).car.drag_area)
    return vehicle.scaled(drag=float(np.clip(factor, 0.5, 2.0)))


def _drive(time: Array, sampled: Array, torque: Array, spin: Array, acceleration: Array) -> Drive:
    """A piece of the trip in the twin's channels and steps."""
    inputs = np.zeros((time.size, len(INPUTS)))
    inputs[:, [U.drive_torque_rl, U.drive_torque_rr]] = (
        0.5 * np.interp(time, sampled, torque)[:, None]
    )
    measurements = np.full((time.size, len(OUTPUTS)), np.nan)
    measurements[:, [Y.wheel_speed_fl, Y.wheel_speed_fr]] = np.interp(time, sampled, spin)[:, None]
    measurements[:, Y.ax] = np.interp(time, sampled, acceleration)  # NaN spreads to neighbours
    if np.isnan(measurements[:, Y.ax]).all():
        measurements[0, Y.ax] = 0.0  # an observer wants a signal; a millisecond tells nothing
    return Drive(
        time=time,
        inputs=inputs,
        input_names=INPUTS,
        measurements=measurements,
        output_names=OUTPUTS,
    )
