"""Lanes as values: the numbers of all lanes at one place, in vector registers, with the usual operators.

A loop over lanes becomes vector instructions only if the compiler can prove that its arrays do not overlap, which it
often cannot. Inside kernels, ``load(a, i)`` reads the lanes ``a[i], …, a[i + LANES − 1]`` of a float64 array as one
value of the type `Lanes`; ``store`` writes one. In between ``+ − * /``, comparisons (which give a `Mask`), ``&``,
``|`` and `select` work on all lanes at once, with numbers on either side. Indices are not checked.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

from .lanes import LANES

DOUBLES = ir.VectorType(ir.DoubleType(), LANES)
BITS = ir.VectorType(ir.IntType(1), LANES)


class Lanes(types.Type):
    """One number on every lane."""

    def __init__(self):
        super().__init__(name="Lanes")


class Mask(types.Type):
    """One truth value on every lane."""

    def __init__(self):
        super().__init__(name="Mask")


lanes_type, mask_type = Lanes(), Mask()


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, DOUBLES)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, BITS)


def _is_array(a):
    return isinstance(a, types.Array) and a.dtype == types.float64 and a.ndim == 1


def _pointer(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), DOUBLES.as_pointer())


@intrinsic
def _load(typingctx, a, i):
    def generate(context, builder, signature, args):
        index = context.cast(builder, args[1], signature.args[1], types.intp)
        value = builder.load(_pointer(context, builder, signature.args[0], args[0], index))
        value.align = 8
        return value

    return lanes_type(a, i), generate


@intrinsic
def _store(typingctx, a, i, v):
    def generate(context, builder, signature, args):
        index = context.cast(builder, args[1], signature.args[1], types.intp)
        done = builder.store(args[2], _pointer(context, builder, signature.args[0], args[0], index))
        done.align = 8
        return context.get_dummy_value()

    return types.void(a, i, v), generate


@intrinsic
def _splat(typingctx, x):
    def generate(context, builder, signature, args):
        value = context.cast(builder, args[0], signature.args[0], types.float64)
        one = builder.insert_element(ir.Constant(DOUBLES, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return builder.shuffle_vector(one, ir.Constant(DOUBLES, ir.Undefined), zeros)

    return lanes_type(x), generate


def load(a, i):
    """The lanes ``a[i], …, a[i + LANES − 1]``."""
    raise NotImplementedError


def store(a, i, v):
    """Write *v* to ``a[i], …, a[i + LANES − 1]``."""
    raise NotImplementedError


def splat(x):
    """The number *x* on every lane."""
    raise NotImplementedError


def select(mask, a, b):
    """*a* where *mask* is true, else *b*."""
    raise NotImplementedError


def larger(a, b):
    """The larger of two on every lane; *b* where either is not a number."""
    raise NotImplementedError


def smaller(a, b):
    """The smaller of two on every lane; *b* where either is not a number."""
    raise NotImplementedError


def root(a):
    """Square roots."""
    raise NotImplementedError


def magnitude(a):
    """Absolute values."""
    raise NotImplementedError


def floor(a):
    """The largest whole numbers that are not larger."""
    raise NotImplementedError


def some(mask):
    """Whether *mask* is true on any lane."""
    raise NotImplementedError


@overload(load, inline="always")
def _(a, i):
    if _is_array(a):
        return lambda a, i: _load(a, i)
    return None


@overload(store, inline="always")
def _(a, i, v):
    if _is_array(a):
        return lambda a, i, v: _store(a, i, v)
    return None


@overload(splat, inline="always")
def _(x):
    return lambda x: _splat(x)


def _binary(build, result):
    """An intrinsic on two lanes."""

    @intrinsic
    def of_two(typingctx, a, b):
        return result(a, b), lambda context, builder, signature, args: build(builder, *args)

    return of_two


def _operators(function, build, result, operand):
    of_two = _binary(build, result)

    @overload(function, inline="always")
    def _(a, b):
        left, right = isinstance(a, operand), isinstance(b, operand)
        if left and right:
            return lambda a, b: of_two(a, b)
        if operand is Lanes and left and isinstance(b, types.Number):
            return lambda a, b: of_two(a, _splat(b))
        if operand is Lanes and right and isinstance(a, types.Number):
            return lambda a, b: of_two(_splat(a), b)
        return None


def _larger(builder, a, b):
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _smaller(builder, a, b):
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


_operators(operator.add, lambda builder, a, b: builder.fadd(a, b), lanes_type, Lanes)
_operators(operator.sub, lambda builder, a, b: builder.fsub(a, b), lanes_type, Lanes)
_operators(operator.mul, lambda builder, a, b: builder.fmul(a, b), lanes_type, Lanes)
_operators(operator.truediv, lambda builder, a, b: builder.fdiv(a, b), lanes_type, Lanes)
_operators(operator.lt, lambda builder, a, b: builder.fcmp_ordered("<", a, b), mask_type, Lanes)
_operators(operator.le, lambda builder, a, b: builder.fcmp_ordered("<=", a, b), mask_type, Lanes)
_operators(operator.gt, lambda builder, a, b: builder.fcmp_ordered(">", a, b), mask_type, Lanes)
_operators(operator.ge, lambda builder, a, b: builder.fcmp_ordered(">=", a, b), mask_type, Lanes)
_operators(operator.eq, lambda builder, a, b: builder.fcmp_ordered("==", a, b), mask_type, Lanes)
_operators(operator.ne, lambda builder, a, b: builder.fcmp_unordered("!=", a, b), mask_type, Lanes)
_operators(operator.and_, lambda builder, a, b: builder.and_(a, b), mask_type, Mask)
_operators(operator.or_, lambda builder, a, b: builder.or_(a, b), mask_type, Mask)
_operators(larger, _larger, lanes_type, Lanes)
_operators(smaller, _smaller, lanes_type, Lanes)


@intrinsic
def _not(typingctx, a):
    return mask_type(a), lambda context, builder, signature, args: builder.not_(args[0])


@intrinsic
def _select(typingctx, mask, a, b):
    return lanes_type(mask, a, b), lambda context, builder, signature, args: builder.select(*args)


@intrinsic
def _some(typingctx, mask):
    def generate(context, builder, signature, args):
        bits = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(mask), generate


def _unary(name):
    @intrinsic
    def of_one(typingctx, a):
        def generate(context, builder, signature, args):
            kind = ir.FunctionType(DOUBLES, [DOUBLES])
            return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), args)

        return lanes_type(a), generate

    return of_one


_sqrt, _fabs, _floor = _unary("sqrt"), _unary("fabs"), _unary("floor")


@overload(operator.invert, inline="always")
def _(a):
    if isinstance(a, Mask):
        return lambda a: _not(a)
    return None


@overload(operator.neg, inline="always")
def _(a):
    if isinstance(a, Lanes):
        return lambda a: _splat(0.0) - a
    return None


@overload(select, inline="always")
def _(mask, a, b):
    left, right = isinstance(a, Lanes), isinstance(b, Lanes)
    if not isinstance(mask, Mask):
        return None
    if left and right:
        return lambda mask, a, b: _select(mask, a, b)
    if left:
        return lambda mask, a, b: _select(mask, a, _splat(b))
    if right:
        return lambda mask, a, b: _select(mask, _splat(a), b)
    return lambda mask, a, b: _select(mask, _splat(a), _splat(b))


@overload(some, inline="always")
def _(mask):
    return lambda mask: _some(mask)


@overload(root, inline="always")
def _(a):
    return lambda a: _sqrt(a)


@overload(magnitude, inline="always")
def _(a):
    return lambda a: _fabs(a)


@overload(floor, inline="always")
def _(a):
    return lambda a: _floor(a)
