"""A call boundary in compiled code: what is behind it is compiled once, whoever calls it.

numba otherwise compiles all that a function calls into it anew, for each caller and each kind of
array. Beyond the saving, one machine code for compiled loops and for Python means one result.
"""

from collections.abc import Callable
from typing import Any

import llvmlite.binding
from numba import cfunc, types

VECTOR = types.CPointer(types.float64)


def behind(result: types.Type, *arguments: types.Type) -> Callable[[Any], types.ExternalFunction]:
    """Compiles a function with the C calling convention and names it to the linker.

    Args:
        result: type of what it returns.
        arguments: their types; arrays go in as `array.ctypes`, a `VECTOR`.
    """

    def compile_it(function: Any) -> types.ExternalFunction:
        compiled = cfunc(result(*arguments), cache=True, error_model="numpy")(function)
        symbol = f"{function.__module__}.{function.__name__}"
        llvmlite.binding.add_symbol(symbol, compiled.address)
        _alive.append(compiled)
        return types.ExternalFunction(symbol, result(*arguments))

    return compile_it


_alive: list[Any] = []  # machine code lives as long as the object that made it
