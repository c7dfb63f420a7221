"""Four numbers at once, one per wheel: a type of compiled code that becomes one vector register.

Arithmetic, comparisons and the functions below act on each lane by itself and mix with floats;
the functions take plain floats as well. So a formula is written once, as on paper, and serves one
wheel or four; lane by lane the result is to the bit that of a float.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

LANES = 4
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, LANES)
POINTER = types.CPointer(types.float64)
IDS = types.CPointer(types.int64)
UNALIGNED = 8  # bytes, of a float64 in an array


class Four(types.Type):
    """Four float64; a float becomes four equal ones where a `Four` is needed."""

    def __init__(self) -> None:
        super().__init__("Four")

    def can_convert_from(self, typingctx, other):
        """A float does, without loss."""
        return Conversion.safe if isinstance(other, types.Float) else None


class Mask(types.Type):
    """Four booleans, of a comparison."""

    def __init__(self) -> None:
        super().__init__("Mask")


four, mask = Four(), Mask()
# How what runs inside compiled code only is compiled: without a way in from Python.
_no_way_in: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
inlined: Any = njit(error_model="numpy", **_no_way_in)


_infer_global: Any = infer_global


def built_in(typer: Any) -> Any:
    """A function of compiled code, given by its types and its code."""
    return intrinsic(typer)


@register_model(Four)
class _FourModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type) -> None:
        super().__init__(dmm, fe_type, VECTOR)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(ir.IntType(1), LANES))


@lower_cast(types.Float, Four)
def _broadcast(context, builder, fromty, toty, value):
    value = context.cast(builder, value, fromty, types.float64)
    return _gathered(builder, [value] * LANES)


def _gathered(builder, values):
    vector = ir.Constant(VECTOR, ir.Undefined)
    for lane, value in enumerate(values):
        vector = builder.insert_element(vector, value, ir.IntType(32)(lane))
    return vector


def _define(operation, result, emit, operands=2):
    """Gives an operator of Python a meaning where at least one operand is a `Four`."""

    @_infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, args, kws):
            if len(args) == operands and four in args:
                return signature(result, *[four] * operands)
            return None

    @lower_builtin(operation, *[four] * operands)
    def _lower(context, builder, sig, args):
        return emit(builder, *args)


for _operations, _instruction in (
    ((operator.add, operator.iadd), ir.IRBuilder.fadd),
    ((operator.sub, operator.isub), ir.IRBuilder.fsub),
    ((operator.mul, operator.imul), ir.IRBuilder.fmul),
    ((operator.truediv, operator.itruediv), ir.IRBuilder.fdiv),
):
    for _operation in _operations:
        _define(_operation, four, _instruction)
_define(operator.neg, four, ir.IRBuilder.fneg, operands=1)
for _operation, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    _define(_operation, mask, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))


def _common(*args):
    return four if four in args else types.float64


@built_in
def where(typingctx, condition, yes, no):
    """Yes where the condition holds, else no."""
    kind = four if condition == mask else _common(yes, no)

    def codegen(context, builder, sig, args):
        return builder.select(*args)

    return kind(condition, kind, kind), codegen


def _choice(sign):
    """Of two numbers the one that compares so with the other."""

    @built_in
    def choose(typingctx, a, b):
        kind = _common(a, b)

        def codegen(context, builder, sig, args):
            return builder.select(builder.fcmp_ordered(sign, *args), *args)

        return kind(kind, kind), codegen

    return choose


maximum = _choice(">")
minimum = _choice("<")


def _function(name, operands):
    """A function of LLVM that is one instruction on every processor we know."""

    def emit(builder, kind, args):
        llvm_kind, suffix = (VECTOR, f"v{LANES}f64") if kind == four else (DOUBLE, "f64")
        function_type = ir.FunctionType(llvm_kind, [llvm_kind] * operands)
        function = cgutils.get_or_insert_function(
            builder.module, function_type, f"llvm.{name}.{suffix}"
        )
        return builder.call(function, args)

    return emit


_sqrt, _fabs, _rint, _copysign = (
    _function("sqrt", 1), _function("fabs", 1), _function("rint", 1), _function("copysign", 2),
)  # fmt: skip


@built_in
def sqrt(typingctx, x):
    """Square root."""
    kind = _common(x)
    return kind(kind), lambda c, builder, sig, args: _sqrt(builder, kind, args)


@built_in
def absolute(typingctx, x):
    """Size of a number."""
    kind = _common(x)
    return kind(kind), lambda c, builder, sig, args: _fabs(builder, kind, args)


@built_in
def rounded(typingctx, x):
    """The nearest whole number, of two the even one."""
    kind = _common(x)
    return kind(kind), lambda c, builder, sig, args: _rint(builder, kind, args)


@built_in
def copysign(typingctx, size, sign):
    """A number of that size and that sign."""
    kind = _common(size, sign)
    return kind(kind, kind), lambda c, builder, sig, args: _copysign(builder, kind, args)


@built_in
def power_of_two(typingctx, k):
    """2^k of a whole k from -1022 to 1023: k is shifted into the exponent's bits."""
    kind = _common(k)

    def codegen(context, builder, sig, args):
        bits, double = ir.IntType(64), context.get_value_type(kind)
        if kind == four:
            bits = ir.VectorType(bits, LANES)

        def same(value, of):
            return ir.Constant(of, [value] * LANES) if kind == four else ir.Constant(of, value)

        # Above 2^52 the last bits of a float64 count ones.
        biased = builder.fadd(args[0], same(1.5 * 2.0**52 + 1023.0, double))
        exponent = builder.shl(builder.bitcast(biased, bits), same(52, bits))
        return builder.bitcast(exponent, double)

    return kind(kind), codegen


@built_in
def load(typingctx, pointer, index):
    """Four numbers in a row."""

    def codegen(context, builder, sig, args):
        place = builder.bitcast(builder.gep(args[0], [args[1]]), VECTOR.as_pointer())
        return builder.load(place, align=UNALIGNED)

    return four(POINTER, types.intp), codegen


@built_in
def gather(typingctx, values, ids, stride, offset):
    """values[stride * id + offset] of each of four ids."""

    def codegen(context, builder, sig, args):
        values, ids, stride, offset = args
        lanes = []
        for lane in range(LANES):
            row = builder.load(builder.gep(ids, [ir.IntType(32)(lane)]))
            place = builder.add(builder.mul(row, stride), offset)
            lanes.append(builder.load(builder.gep(values, [place])))
        return _gathered(builder, lanes)

    return four(POINTER, IDS, types.intp, types.intp), codegen


@built_in
def scatter(typingctx, values, ids, stride, offset, x):
    """Writes the four numbers to values[stride * id + offset]."""

    def codegen(context, builder, sig, args):
        values, ids, stride, offset, x = args
        for lane in range(LANES):
            row = builder.load(builder.gep(ids, [ir.IntType(32)(lane)]))
            place = builder.gep(values, [builder.add(builder.mul(row, stride), offset)])
            builder.store(builder.extract_element(x, ir.IntType(32)(lane)), place)
        return context.get_dummy_value()

    return types.void(POINTER, IDS, types.intp, types.intp, four), codegen


@built_in
def polynomial(typingctx, coefficients, x):
    """Polynomial in x, a tuple of coefficients from the highest power down."""
    kind = _common(x)

    def codegen(context, builder, sig, args):
        numbers = cgutils.unpack_tuple(builder, args[0])
        if kind == four:
            numbers = [_gathered(builder, [number] * LANES) for number in numbers]
        value = numbers[0]
        for number in numbers[1:]:
            value = builder.fadd(builder.fmul(value, args[1]), number)
        return value

    return kind(coefficients, kind), codegen


@built_in
def unpack(typingctx, x):
    """The four numbers as a tuple."""
    kind = types.UniTuple(types.float64, LANES)

    def codegen(context, builder, sig, args):
        lanes = [builder.extract_element(args[0], ir.IntType(32)(lane)) for lane in range(LANES)]
        return context.make_tuple(builder, kind, lanes)

    return kind(four), codegen


@built_in
def anywhere(typingctx, condition):
    """Whether the condition holds in some lane."""

    def codegen(context, builder, sig, args):
        if sig.args[0] != mask:
            return args[0]
        bits = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.IntType(LANES)(0))

    return types.boolean(condition), codegen


@built_in
def pointer(typingctx, address):
    """The float64 at an address."""

    def codegen(context, builder, sig, args):
        return builder.inttoptr(args[0], DOUBLE.as_pointer())

    return POINTER(types.intp), codegen
