"""CommonRoad's multi-body car, compiled: 29 states, and code that shares nothing with ours.

The equations are `vehicle_dynamics_mb` of the package commonroad-vehicle-models as it stands,
compiled untouched (M. Althoff and G. Wuersching, "CommonRoad: Vehicle Models", 2020, Section 9).
It knows no torque but one demanded acceleration with fixed shares. Here zero is demanded, and each
wheel's torque is added to that wheel's equation: I dw/dt = -R F_x + torque.

It has no drag, no rolling resistance and no road but a flat one; its tyres neither relax nor lose
grip under load. It divides by zero as it comes to rest, and its tyres pull once a wheel has lifted.
Ply steer has the sign of the camber: a front wheel's side force jumps by 0.12 kN as that passes 0.
`twin.commonroad.axes` turns its states into ours.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numba import from_dtype, njit, types
from numba.extending import register_jitable
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from twin.channels import U
from twin.compiled.boundary import VECTOR, behind
from twin.errors import TwinError

try:
    from vehiclemodels.utils import tire_model
    from vehiclemodels.utils.acceleration_constraints import acceleration_constraints
    from vehiclemodels.utils.longitudinal_parameters import LongitudinalParameters
    from vehiclemodels.utils.steering_constraints import steering_constraints
    from vehiclemodels.utils.steering_parameters import SteeringParameters
    from vehiclemodels.utils.tireParameters import TireParameters
    from vehiclemodels.utils.vehicle_dynamics_ks_cog import vehicle_dynamics_ks_cog
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_parameters import VehicleParameters, setup_vehicle_parameters
except ImportError as error:
    raise TwinError(
        "CommonRoad's car is not installed: pip install 'twin-in-the-loop[commonroad]'"
    ) from error

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s2], written into their equations
LEAST_SPEED = 2.0  # [m/s]; below some 1.5 the slip of a wheel is too stiff for steps of 1 ms
# Their states, in their order
STATES = 29
X, Y, STEER, VX, YAW, YAW_RATE = range(6)
ROLL, ROLL_RATE, PITCH, PITCH_RATE, VY, Z, VZ = range(6, 13)
FRONT, REAR = 13, 18  # of each axle: roll, roll rate, lateral velocity, z, velocity along z
AXLE_ROLL_RATE, AXLE_VY, AXLE_Z, AXLE_VZ = 1, 2, 3, 4
WHEEL = 23

_compilable: Any = register_jitable
for _function in (
    *(tire_model.sign, tire_model.formula_longitudinal, tire_model.formula_lateral),
    *(tire_model.formula_longitudinal_comb, tire_model.formula_lateral_comb),
    *(steering_constraints, acceleration_constraints, vehicle_dynamics_ks_cog, vehicle_dynamics_mb),
):
    _compilable(_function)


def _record_of(parameters: Any, nested: Mapping[str, np.dtype]) -> np.dtype:
    """The dtype with the names of one of their parameter classes, the trailer's left out."""
    names = [field.name for field in fields(parameters) if field.name != "trailer"]
    content = [(name, nested.get(name, np.dtype(np.float64))) for name in names]
    return np.dtype((np.record, np.dtype(content, align=True)))


MULTI_BODY_DTYPE = _record_of(
    VehicleParameters,
    {
        "steering": _record_of(SteeringParameters, {}),
        "longitudinal": _record_of(LongitudinalParameters, {}),
        "tire": _record_of(TireParameters, {}),
    },
)
"""The parameters of a car as their equations read them, under their own names."""

MultiBody = np.record
_CAR = from_dtype(MULTI_BODY_DTYPE)


def bmw_320i() -> MultiBody:
    """Their vehicle 2, a BMW 320i."""
    car = np.zeros(1, MULTI_BODY_DTYPE)[0]
    _copy(setup_vehicle_parameters(vehicle_id=2), car)
    return car


def _copy(theirs: Any, ours: np.record) -> None:
    for name in ours.dtype.names or ():
        if ours.dtype[name].names:
            _copy(getattr(theirs, name), ours[name])
        else:
            ours[name] = getattr(theirs, name)


@behind(types.void, _CAR, VECTOR, VECTOR, VECTOR)
def fill_rates(car, x, torque, rates):
    """See `derivative`."""
    theirs = vehicle_dynamics_mb(carray(x, STATES), (0.0, 0.0), car)
    for i in range(STATES):
        rates[i] = theirs[i]
    for w in range(4):
        rates[WHEEL + w] += torque[w] / car.I_y_w


_fill_rates: Any = fill_rates


@njit(cache=True, nogil=True)
def derivative(car, x, torque):
    """The (29,) rates of their states x (29,) under the (4,) torques on the wheels [N m]."""
    rates = np.empty(STATES)
    _fill_rates(car, x.ctypes, torque.ctypes, rates.ctypes)
    return rates


@njit(cache=True, nogil=True)
def advance(car, x, u, steering_ratio, dt, torque):
    """Advances their states by a step of the classical Runge-Kutta method.

    Args:
        car: parameters.
        x: (29,) changed in place; the steering angle is set to that of the inputs before.
        u: (13,) `twin.INPUTS`, held over the step. A brake opposes rotation.
        steering_ratio: hand wheel over road wheels.
        dt: [s].
        torque: (4,) receives the torques on the wheels [N m].

    Returns:
        The (29,) rates before the step.
    """
    x[STEER] = -u[U.steering_wheel_angle] / steering_ratio
    for w in range(4):
        braking = u[U.brake_torque_fl + w] if x[WHEEL + w] > 0.0 else 0.0
        torque[w] = u[U.drive_torque_fl + w] - braking
    first = derivative(car, x, torque)
    total, before = first.copy(), first
    for weight, share in ((2.0, 0.5), (2.0, 0.5), (1.0, 1.0)):
        between = np.empty(STATES)
        for i in range(STATES):
            between[i] = x[i] + share * dt * before[i]
        before = derivative(car, between, torque)
        for i in range(STATES):
            total[i] += weight * before[i]
    for i in range(STATES):
        x[i] += dt / 6.0 * total[i]
    return first


@njit(cache=True, nogil=True)
def is_sound(x):
    """Whether the states are where the model is one: finite, rolling forwards on all wheels."""
    for i in range(STATES):
        if not abs(x[i]) < 1e9:
            return False
    for w in range(4):
        if not 0.0 < x[WHEEL + w] < 1e4:
            return False
    return x[VX] >= LEAST_SPEED


def rolling(car: MultiBody, speed: float) -> Array:
    """The (29,) states of a car that rolls straight ahead, with no torque on any wheel.

    Heights and pitch are those of statics: each tyre is squeezed by its load, and the springs,
    whose preload carries the sprung mass, are at their reference. The wheels turn at the slip at
    which the tyres, which have a small shift, give no force.

    Args:
        car: parameters.
        speed: [m/s].
    """
    from scipy.optimize import brentq

    share = np.array([car.b, car.a]) / (car.a + car.b)
    load = 0.5 * GRAVITY * (car.m_s * share + np.array([car.m_uf, car.m_ur]))
    front, rear = load / car.K_zt
    x = np.zeros(STATES)
    x[VX] = speed
    x[PITCH] = (rear - front) / (car.a + car.b)
    x[Z] = front + car.a * x[PITCH]
    x[FRONT + AXLE_Z], x[REAR + AXLE_Z] = front, rear
    for axle in range(2):
        slip: Any = brentq(
            tire_model.formula_longitudinal, -0.05, 0.05, (0.0, load[axle], car.tire)
        )
        x[WHEEL + 2 * axle : WHEEL + 2 * axle + 2] = (1.0 - slip) * speed / car.R_w
    return x
