"""CommonRoad's multi-body BMW 320i as the real vehicle: nothing of its code is the twin's.

It is driven along a course by the same driver as the cars of this project, and recorded with the
same channels. In this its drive differs from one of `scenarios.driving.record`:

* *Wheel torques* are what the model's own tyre forces and wheel accelerations amount to,
  I dw/dt + R F_x for each wheel: drive torque where positive, brake torque where negative.
* The road wheels turn no faster than their parameters allow, 0.4 rad/s. The recorded angle of the
  hand wheel is theirs times the steering ratio.
* There is no drag and no rolling resistance; a twin must not have them either, or they are part of
  what it gets wrong.
* Truth that the model does not have is NaN: moments of tyres, yaw inertia of the chassis alone.
"""

import dataclasses

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scenarios.driving.driver import Driver, drive_along, new_memory
from scenarios.driving.drivers import driver_of, limits_of
from scenarios.driving.record import CourseManoeuvre
from scenarios.driving.speed_profile import Limits
from twin import (
    BRAKE_TORQUES,
    DRIVE_TORQUES,
    INPUTS,
    OUTPUTS,
    PARAMETERS,
    TYRE,
    TYRE_OUTPUTS,
    WHEELS,
    Drive,
    TwinError,
    U,
    Vehicle,
)
from twin.commonroad.axes import COMMONROAD_STATES, measurements, our_states, suspensions
from twin.commonroad.model import STATES as THEIRS
from twin.commonroad.model import (
    STEER,
    VX,
    VY,
    WHEEL,
    YAW,
    YAW_RATE,
    MultiBody,
    X,
    Y,
    advance,
    bmw_320i,
    is_sound,
    rolling,
)
from twin.commonroad.twin import STEERING_RATIO
from twin.commonroad.tyres import tyre_outputs

Array = NDArray[np.float64]

DT = 1e-3  # [s]

# So that the car stays below 0.6 g: the driver corrects himself, and takes a lane change a quarter
# harder than its line. Chosen: far from 1 g, where wheels lift.
LANE_CHANGE_LATERAL = 0.45  # [g]


def commonroad_limits() -> Limits:
    """What is asked of the driver of CommonRoad's car."""
    return dataclasses.replace(limits_of(Vehicle.load("bmw_320i")), lateral=0.54, braking=0.54)


def record(
    manoeuvre: CourseManoeuvre, driver: Driver | None = None, car: MultiBody | None = None
) -> Drive:
    """Drives the car and records inputs, noise-free measurements and the truth.

    Args:
        manoeuvre: above 2 m/s, on a flat road, sampled at 1 kHz.
        driver: who drives, and what he knows of the car; our twin's driver if None.
        car: parameters; the nominal car if None.

    Raises:
        TwinError: the manoeuvre is not such a one, or the car got where the model is none: at rest,
            a wheel locked or off the road, blown up.
    """
    car = bmw_320i() if car is None else car
    driver = driver_of(Vehicle.load("bmw_320i")) if driver is None else driver
    if abs(manoeuvre.dt - DT) > 1e-9 or manoeuvre.road.any():
        raise TwinError(
            f"{manoeuvre.name}: CommonRoad's car needs a flat road and samples every {DT} s, "
            f"not {manoeuvre.dt} s"
        )
    n = manoeuvre.road.shape[0]
    inputs, states, rates = (np.zeros((n, width)) for width in (len(INPUTS), THEIRS, THEIRS))
    states[0] = rolling(car, float(manoeuvre.course.speed[0]))
    done = _follow(car, driver, manoeuvre.course, new_memory(), inputs, states, rates)
    forces = tyre_outputs(car, states[: done or 1].T)
    lifted = np.flatnonzero((forces[:, TYRE.fz] <= 0.0).any(axis=0))
    done = min([done, *lifted])
    if done < n:
        raise TwinError(
            f"{manoeuvre.name}: at t = {done * DT:.3f} s CommonRoad's car has come to rest, locked "
            "or lifted a wheel or blown up; its model needs 2 m/s and wheels that roll on the road"
        )
    _set_torques(car, rates, forces[:, TYRE.fx], inputs)
    measured = measurements(states.T, rates.T)
    return Drive(
        time=np.arange(n) * DT,
        inputs=inputs,
        input_names=INPUTS,
        measurements=measured.T,
        output_names=OUTPUTS,
        truth=_truth(car, states, measured, forces),
        settings={"manoeuvre": manoeuvre.name, "vehicle": "commonroad bmw_320i"},
    )


@njit(cache=True, nogil=True)
def _follow(car, driver, course, memory, inputs, states, rates):
    """Drives all samples along a course; returns how many were sound."""
    x, torque = states[0].copy(), np.empty(4)
    angle, turn = 0.0, STEERING_RATIO * car.steering.v_max * DT
    for k in range(inputs.shape[0]):
        u = inputs[k]
        drive_along(
            driver, course, memory, x[X], -x[Y], -x[YAW], x[VX], -x[VY], -x[YAW_RATE],
            x[WHEEL : WHEEL + 4], DT, u,
        )  # fmt: skip
        angle += min(max(u[U.steering_wheel_angle] - angle, -turn), turn)
        u[U.steering_wheel_angle] = angle
        states[k] = x
        rates[k] = advance(car, x, u, STEERING_RATIO, DT, torque)
        states[k, STEER] = x[STEER]
        if not is_sound(x):
            return k
    return inputs.shape[0]


def _set_torques(car: MultiBody, rates: Array, fx: Array, inputs: Array) -> None:
    """Fills drive and brake torques with what tyre forces and wheel accelerations amount to."""
    torque = car.I_y_w * rates[:, WHEEL : WHEEL + 4] + car.R_w * fx.T
    inputs[:, DRIVE_TORQUES] = np.maximum(torque, 0.0)
    inputs[:, BRAKE_TORQUES] = np.maximum(0.0, -torque)


def _truth(car: MultiBody, x: Array, measured: Array, forces: Array) -> dict[str, Array]:
    truth = dict(zip(COMMONROAD_STATES, our_states(car, x.T), strict=True))
    truth |= {
        name: values for name, values in zip(OUTPUTS, measured, strict=True) if name not in truth
    }
    truth["sideslip"] = np.arctan2(truth["vy"], truth["vx"])
    for w, (wheel, travel, rate) in enumerate(zip(WHEELS, *suspensions(car, x.T), strict=True)):
        spin = truth[f"wheel_speed_{wheel}"]
        truth[f"wheel_angle_{wheel}"] = DT * np.concatenate([[0.0], np.cumsum(spin[:-1])])
        truth[f"suspension_travel_{wheel}"], truth[f"suspension_rate_{wheel}"] = travel, rate
        truth |= {f"{name}_{wheel}": forces[w, i] for i, name in enumerate(TYRE_OUTPUTS)}
    # The model is symmetric; its frame stands at the centre of mass.
    body = {"mass": car.m_s, "Jxx": car.I_Phi_s, "Jyy": car.I_y_s, "Jzz": np.nan, "Jxz": car.I_xz_s}
    truth |= {name: np.full(len(x), body.get(name, 0.0)) for name in PARAMETERS}
    return truth
