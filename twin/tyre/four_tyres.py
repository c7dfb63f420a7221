"""The coefficients of four tyres, of which compiled code reads each as a `Four`."""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import lower_getattr_generic, models, register_model
from numpy.typing import NDArray

from twin.compiled.simd import POINTER, UNALIGNED, VECTOR, built_in, four
from twin.tyre.record import TYRE_DTYPE

NAMES = TYRE_DTYPE.names or ()


class FourTyres(types.Type):
    """A table (n, 4): a row per field of `twin.tyre.record.TYRE_DTYPE`, a column per tyre."""

    def __init__(self) -> None:
        super().__init__("FourTyres")


@register_model(FourTyres)
class _Model(models.PrimitiveModel):
    def __init__(self, dmm, fe_type) -> None:
        super().__init__(dmm, fe_type, VECTOR.as_pointer())


@infer_getattr
class _Attributes(AttributeTemplate):
    key = FourTyres

    def generic_resolve(self, tyres, name):
        return four if name in NAMES else None


@lower_getattr_generic(FourTyres)
def _read(context, builder, tyres, value, name):
    row = builder.gep(value, [ir.IntType(32)(NAMES.index(name))])
    return builder.load(row, align=UNALIGNED)


@built_in
def four_tyres(typingctx, table):
    """The tyres of a table by its address; their fields are read as attributes."""

    def codegen(context, builder, sig, args):
        return builder.bitcast(args[0], VECTOR.as_pointer())

    return FourTyres()(POINTER), codegen


def table_of(tyres: NDArray[np.void]) -> NDArray[np.float64]:
    """The table (n, 4) of four records of `TYRE_DTYPE`."""
    return np.array([tyres[name] for name in NAMES])
