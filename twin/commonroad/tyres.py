"""What the tyres of CommonRoad's multi-body car do, sample by sample, in our axes.

`vehicle_dynamics_mb` does not give out its tyre forces. Here are its lines between the states and
the forces; the forces come from its own tyre functions, run over whole histories.
"""

import math
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.commonroad.axes import Channels
from twin.commonroad.model import (
    AXLE_ROLL_RATE,
    AXLE_Z,
    FRONT,
    PITCH,
    REAR,
    ROLL,
    STEER,
    VX,
    VY,
    WHEEL,
    YAW_RATE,
    MultiBody,
    Z,
    tire_model,
)

Array = NDArray[np.float64]

_ARRAY_MATH = SimpleNamespace(sin=np.sin, cos=np.cos, atan=np.arctan, fabs=np.fabs)


def _over_arrays(function: Any) -> Any:
    """One of their tyre functions with numpy's elementary functions for those of `math`."""
    assert function.__globals__["math"] is math
    return FunctionType(function.__code__, {"math": _ARRAY_MATH, "sign": np.sign})


_longitudinal = _over_arrays(tire_model.formula_longitudinal)
_lateral = _over_arrays(tire_model.formula_lateral)
_longitudinal_combined = _over_arrays(tire_model.formula_longitudinal_comb)
_lateral_combined = _over_arrays(tire_model.formula_lateral_comb)


def tyre_outputs(car: MultiBody, x: Channels) -> Array:
    """The tyres' forces and slips; the model has no moments, they are NaN.

    Args:
        car: parameters.
        x: their 29 states, each a number or an array (N,).

    Returns:
        (4, 9) or (4, 9, N): of each wheel, `twin.TYRE_OUTPUTS`.
    """
    return np.array([_wheel(car, x, front, side) for front in (1, 0) for side in (1.0, -1.0)])


def _wheel(car: MultiBody, x: Channels, front: int, side: float) -> tuple[Any, ...]:
    axle, arm, track = (FRONT, car.a, car.T_f) if front else (REAR, -car.b, car.T_r)
    steer = front * x[STEER]
    ahead = x[VX] + side * 0.5 * track * x[YAW_RATE]
    across = x[VY] + arm * x[YAW_RATE]
    slip = 1.0 - car.R_w * x[WHEEL + (0 if front else 2) + (0 if side > 0.0 else 1)] / (
        ahead * np.cos(steer) + (front * across) * np.sin(steer)
    )
    low = x[axle + AXLE_ROLL_RATE] * (car.R_w - x[axle + AXLE_Z])
    angle = np.arctan((across - low) / ahead) - steer
    hub = car.h_s - car.R_w
    travel = (hub + x[axle + AXLE_Z] - x[Z]) / np.cos(x[ROLL]) - hub
    travel = travel + arm * x[PITCH] + side * 0.5 * (x[ROLL] - x[axle]) * track
    d, e = (car.D_f, car.E_f) if front else (car.D_r, car.E_r)
    camber = x[ROLL] + side * (d * travel + e * travel**2)
    squeeze = x[axle + AXLE_Z] + car.R_w * (np.cos(x[axle]) - 1.0)
    load = (squeeze - side * 0.5 * track * np.sin(x[axle])) * car.K_zt
    fx = _longitudinal(slip, camber, load, car.tire)
    fy, friction = _lateral(angle, camber, load, car.tire)
    fx = _longitudinal_combined(slip, angle, fx, car.tire)
    fy = _lateral_combined(slip, angle, camber, friction, load, fy, car.tire)
    none = np.nan * load
    return fx, -fy, load, none, none, none, -slip, -angle, camber
