"""What a compiled loop does with one twin of an ensemble, whatever the twin is.

The functions are those of `twin.kernel`: for our own twin the same machine code, for any other
black box (`estimators.ensemble.black_box_calls`) a call of Python. Which of both is decided when
the loop is compiled, by the type of the record.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from estimators.ensemble.black_box_calls import (
    CORRECT,
    IS_SOUND,
    READ_STATES,
    SET_PARAMETERS,
    STEP,
    call_box,
)
from twin.kernel import correct as correct_car
from twin.kernel import is_sound as car_is_sound
from twin.kernel import read_states as read_states_of_car
from twin.kernel import set_parameters as set_parameters_of_car
from twin.kernel import step as step_car

COMPILED_ONLY = "works in compiled code only"


def step(car: Any, u: Any, y: Any) -> None:
    """Advances by a step under inputs u (nu,); fills the outputs y (ny,) before it."""
    raise NotImplementedError(COMPILED_ONLY)


def correct(car: Any, dx: Any) -> None:
    """Adds dx (nx,) to the states."""
    raise NotImplementedError(COMPILED_ONLY)


def read_states(car: Any, x: Any) -> None:
    """Fills the states x (nx,)."""
    raise NotImplementedError(COMPILED_ONLY)


def set_parameters(car: Any, p: Any) -> None:
    """Sets the parameters p (np,), which become what is possible of them."""
    raise NotImplementedError(COMPILED_ONLY)


def is_sound(car: Any) -> bool:
    """False once it has blown up or failed."""
    raise NotImplementedError(COMPILED_ONLY)


def read_extended(car: Any, forces: Any) -> None:
    """Fills the outputs of the tyres (4, 9); NaN where there are none."""
    raise NotImplementedError(COMPILED_ONLY)


def _is_box(car: types.Type) -> bool:
    return isinstance(car, types.Record) and "box" in car.fields


@overload(step)
def _step(car, u, y):
    def of_box(car, u, y):
        call_box(car.box, STEP, u.ctypes, u.size, y.ctypes, y.size)

    def of_car(car, u, y):
        step_car(car, u, y)

    return of_box if _is_box(car) else of_car


@overload(correct)
def _correct(car, dx):
    def of_box(car, dx):
        call_box(car.box, CORRECT, dx.ctypes, dx.size, dx.ctypes, 0)

    def of_car(car, dx):
        correct_car(car, dx)

    return of_box if _is_box(car) else of_car


@overload(read_states)
def _read_states(car, x):
    def of_box(car, x):
        call_box(car.box, READ_STATES, x.ctypes, 0, x.ctypes, x.size)

    def of_car(car, x):
        read_states_of_car(car, x)

    return of_box if _is_box(car) else of_car


@overload(set_parameters)
def _set_parameters(car, p):
    def of_box(car, p):
        call_box(car.box, SET_PARAMETERS, p.ctypes, p.size, p.ctypes, p.size)

    def of_car(car, p):
        set_parameters_of_car(car, p)

    return of_box if _is_box(car) else of_car


@overload(is_sound)
def _is_sound(car):
    def of_box(car):
        nothing = np.empty(0)
        return call_box(car.box, IS_SOUND, nothing.ctypes, 0, nothing.ctypes, 0) != 0

    def of_car(car):
        return car_is_sound(car)

    return of_box if _is_box(car) else of_car


@overload(read_extended)
def _read_extended(car, forces):
    def of_box(car, forces):
        forces[:] = np.nan

    def of_car(car, forces):
        forces[:] = car.tyre_output

    return of_box if _is_box(car) else of_car
