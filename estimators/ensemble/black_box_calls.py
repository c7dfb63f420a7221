"""Calls from compiled loops into any black box, through one C function that comes back to Python.

A compiled loop over twins sees each of them as a record: of our own twin the car itself, of another
black box (`BOX_DTYPE`) no more than its number here. `estimators.ensemble.stepping` chooses by the
type of the record, when it is compiled.

The arrays of the loop have the order of `twin.OUTPUTS`, `twin.STATES` and `twin.PARAMETERS`,
whatever the black box has: what it lacks is zero, and changes of it are dropped.
"""

import ctypes
import itertools
import weakref
from collections.abc import Sequence

import llvmlite.binding
import numpy as np
from numba import types
from numpy.typing import NDArray

from estimators.black_box import BlackBox
from twin import OUTPUTS, PARAMETERS, STATES, WHEEL_SPEEDS, TwinError

Array = NDArray[np.float64]

BOX_DTYPE = np.dtype([("box", np.int64)], align=True)
STEP, CORRECT, READ_STATES, SET_PARAMETERS, IS_SOUND = range(5)
# A black box without wheel speeds shows its speed in their place, over this radius [m], so that a
# loop knows whether it moves; no measurement is compared with it
RADIUS = 0.3
_SYMBOL = f"{__name__}.call"
_VECTOR = types.CPointer(types.float64)
call_box = types.ExternalFunction(
    _SYMBOL, types.int64(types.int64, types.int64, _VECTOR, types.int64, _VECTOR, types.int64)
)
"""(box, operation, input, its size, output, its size): whether the black box is sound."""


def places(names: Sequence[str], among: Sequence[str]) -> tuple[NDArray[np.int64], ...]:
    """Columns of names, and of the same names in another table, as far as it has them."""
    both = [(i, among.index(name)) for i, name in enumerate(names) if name in among]
    columns = np.array(both, dtype=np.int64).reshape(-1, 2)
    return columns[:, 0], columns[:, 1]


class CalledBox:
    """A black box as compiled loops call it.

    Args:
        box: that is called; no other observer may step it.

    Attributes:
        error: what it raised; from then on it is not called any more.
    """

    def __init__(self, box: BlackBox) -> None:
        self.box = box
        self.number = next(_numbers)
        self.error: Exception | None = None
        self._outputs = places(box.outputs, OUTPUTS)
        self._states = places(box.states, STATES)
        self._parameters = places(box.parameters, PARAMETERS)
        wheels = OUTPUTS[WHEEL_SPEEDS]
        self._speed = None
        if not set(wheels) <= set(box.outputs) and "vx" in box.states:
            self._speed = box.states.index("vx")
        _boxes[self.number] = self

    def call(self, operation: int, given: Array, out: Array) -> bool:
        """Does what a compiled loop asks for; tells whether the black box is sound."""
        if self.error is None:
            try:
                self._do(operation, given, out)
            except Exception as error:  # it must not pass through compiled code; the loop ends
                self.error = error
        return self.error is None

    def _do(self, operation: int, given: Array, out: Array) -> None:
        box = self.box
        if operation == STEP:
            own, ours = self._outputs
            if self._speed is not None:
                out[WHEEL_SPEEDS] = box.read_states()[self._speed] / RADIUS
            out[ours] = box.step(given.copy())[own]
        elif operation == CORRECT:
            own, ours = self._states
            dx = np.zeros(len(box.states))
            dx[own] = given[ours]
            box.correct(dx)
        elif operation == READ_STATES:
            own, ours = self._states
            out[ours] = box.read_states()[own]
        elif operation == SET_PARAMETERS:
            own, ours = self._parameters
            p = np.zeros(len(box.parameters))
            p[own] = given[ours]
            out[:] = 0.0
            out[ours] = box.set_parameters(p)[own]


def error_of(boxes: Sequence[CalledBox]) -> TwinError | None:
    """What ended a loop over black boxes, if one of them did.

    Raises:
        Exception: what a black box raised that is no `TwinError`.
    """
    for one in boxes:
        if isinstance(one.error, TwinError):
            return one.error
        if one.error is not None:
            raise one.error
    return None


_numbers = itertools.count()
_boxes: "weakref.WeakValueDictionary[int, CalledBox]" = weakref.WeakValueDictionary()
_POINTER = ctypes.POINTER(ctypes.c_double)


@ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, _POINTER, ctypes.c_int64, _POINTER,
    ctypes.c_int64,
)  # fmt: skip
def _call(number, operation, given, n, out, m):
    """From compiled code."""
    if operation == IS_SOUND:
        return int(_boxes[number].error is None)
    empty = np.empty(0)
    arrays = (
        np.ctypeslib.as_array(values, (size,)) if size else empty
        for values, size in ((given, n), (out, m))
    )
    return int(_boxes[number].call(operation, *arrays))


llvmlite.binding.add_symbol(_SYMBOL, ctypes.cast(_call, ctypes.c_void_p).value or 0)
