"""Scales a car while it drives; `twin.scales` says what each parameter multiplies."""

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from twin.car_record import CAR
from twin.compiled.boundary import VECTOR, behind
from twin.compiled.simd import pointer
from twin.parameters import ALL_FACTORS, FACTORS, PARAMETER, P
from twin.scales import TARGETS, Target, places
from twin.tyre.four_tyres import NAMES

_LOW = np.array([record.low for record in PARAMETER.values()])
_HIGH = np.array([record.high for record in PARAMETER.values()])


def bind_factors(car: NDArray[np.void], model: mujoco.MjModel) -> None:
    """Fills in where the numbers lie that parameters scale, and what they are now.

    Args:
        car: (1,) record of `twin.car_record.CAR_DTYPE`, all else of it filled in.
        model: of the car.
    """
    k = 0
    for name in FACTORS:
        for target in TARGETS[name]:
            numbers = _array(car, model, target)
            for place in places(model, target):
                car["factor_address"][0, k] = numbers.ctypes.data + numbers.itemsize * place
                car["factor_nominal"][0, k] = numbers[place]
                car["factor_parameter"][0, k] = getattr(P, name)
                car["factor_divides"][0, k] = target.divides
                k += 1
    car["factors"] = k


def _array(car: NDArray[np.void], model: mujoco.MjModel, target: Target) -> NDArray[np.float64]:
    if target.where == "model":
        return getattr(model, target.name)
    if target.where == "number":
        return car[target.name]
    if target.where == "share":
        return car[target.name][0]
    return car["tyres"][0, NAMES.index(target.name)]


@behind(types.void, CAR, VECTOR)
def set_scales(car, p):
    """The part of `twin.kernel.set_parameters` that scales."""
    now = car.parameters
    changed = False
    for i in range(ALL_FACTORS.start, ALL_FACTORS.stop):
        p[i] = min(max(p[i], _LOW[i]), _HIGH[i])
        changed = changed or p[i] != now[i]
        now[i] = p[i]
    if not changed:
        return
    for k in range(car.factors):
        pointer(car.factor_address[k])[0] = car.factor_nominal[k]
    for k in range(car.factors):
        number, factor = pointer(car.factor_address[k]), 1.0 + p[car.factor_parameter[k]]
        if car.factor_divides[k] != 0:
            number[0] = number[0] / factor
        else:
            number[0] = number[0] * factor
