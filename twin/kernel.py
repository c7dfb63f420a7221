"""The black box: compiled functions that step, correct and set the parameters of a car.

They are the whole boundary between an observer and the simulator; `read_states` and `is_sound`
look without touching. All are `@njit`: Python and compiled loops call the same code, which is
compiled once (`twin.compiled.boundary`). Arrays are contiguous, of float64.
"""

from collections.abc import Callable
from typing import Any

from numba import njit, types

from twin.car_record import CAR
from twin.chassis import set_load
from twin.parameters import AXLE_FORCES
from twin.parts import restore_dampers, set_parts
from twin.scale_setter import set_scales
from twin.states import copy_states, correct_states, states_are_sound
from twin.stepping import step_car

_IN = types.Array(types.float64, 1, "C", readonly=True)  # read only: or writable
_OUT = types.Array(types.float64, 1, "C")


def _compiled(result: types.Type, *arguments: types.Type) -> Callable[[Any], Any]:
    """Compiles for these arguments only: pointers to anything else must not get any further."""
    return njit(result(*arguments), cache=True, nogil=True)


@_compiled(types.void, CAR, _IN, _OUT)
def step(car, u, y):
    """Advances the car by one step of MuJoCo with tyre forces: TiL Eq. (1).

    Outputs and tyre forces belong to the state before the step, as MuJoCo's sensors do.

    Args:
        car: the car.
        u: (13,) inputs, `twin.channels.INPUTS`.
        y: (10,) receives the measurements, `twin.channels.OUTPUTS`.
    """
    step_car(car, u.ctypes, y.ctypes)


@_compiled(types.void, CAR, _IN)
def correct(car, dx):
    """Adds a correction to the states: TiL Eq. (4).

    Args:
        car: the car.
        dx: (28,) in the order of `twin.channels.STATES`. Rotation (roll, pitch, yaw) is a small
            turn about the body's axes; velocity is in the body frame, and a turn keeps it there.
    """
    correct_states(car, dx.ctypes)


@_compiled(types.void, CAR, _OUT)
def read_states(car, x):
    """Reads the states.

    Args:
        car: the car.
        x: (28,) receives them, `twin.channels.STATES`; roll, pitch and yaw as the angles of ISO
            8855 (yaw first, then pitch, then roll).
    """
    copy_states(car, x.ctypes)


@_compiled(types.void, CAR, _OUT)
def set_parameters(car, p):
    """Sets the parameters of the car, kept physically valid: TiL Eq. (2).

    Args:
        car: the car.
        p: (np,) deltas from the nominal car, `twin.parameters.PARAMETERS`; the inertia tensor is
            about the new CM. On return it holds what was set: the mass has a floor, the tensor is
            one that a rigid body can have, scales stay within their bounds.
    """
    set_load(car, p.ctypes)
    restore_dampers(car)
    set_scales(car, p.ctypes)
    set_parts(car, p.ctypes)
    for i in range(AXLE_FORCES.start, AXLE_FORCES.stop):
        car.parameters[i] = p[i]


@_compiled(types.boolean, CAR)
def is_sound(car):
    """False once a state is no longer a finite number of sensible size."""
    return states_are_sound(car) != 0
