"""Lanes as values: numbers of several problems side by side, that kernels compute with as if they were one number.

LLVM's loop vectoriser needs long loops over lanes and a proof that their arrays don't overlap (or checks of it at run
time), and keeps every intermediate in memory. Here the lanes are a type instead, ``<n x double>`` in LLVM, with the usual
operators, so that sums stay in registers; eight of them are one AVX-512 register, two of AVX, four of NEON.

The width is part of the type. `of_width` makes the two functions that need it said: one reads from an array, one
spreads a number; those of this file are `LANES` wide. All others take it from their arguments: ``+ − * /`` and
comparisons (which give a `Mask`) with numbers on either side, ``& | ~`` of masks, and the functions below.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from numba.core import cgutils, types
from numba.core.imputils import lower_builtin
from numba.core.typing import signature
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import intrinsic, models, register_model

from .lanes import LANES

ir = cgutils.ir


class Places(types.Type):
    """Numba's type of *width* entries side by side."""

    entry: Any

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"{type(self).__name__}{width}")


class Lanes(Places):
    """Float64."""

    entry = ir.DoubleType()


class Mask(Places):
    """Truth values."""

    entry = ir.IntType(1)


@register_model(Lanes)
@register_model(Mask)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Places) -> None:
        super().__init__(manager, kind, ir.VectorType(kind.entry, kind.width))


def _splat(builder: Any, width: int, value: Any) -> Any:
    """A float, or what is a vector already, as a vector."""
    if isinstance(value.type, ir.VectorType):
        return value
    nothing = ir.Constant(ir.VectorType(value.type, width), ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _of_two(function: Any, result: type[Places], of: type[Places], make: Callable[[Any, Any, Any], Any]) -> None:
    """Give *function* a meaning for two values of the kind *of*; a number may stand for one that is `Lanes`."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            found = [kind for kind in args if type(kind) is of]
            if len(args) != 2 or not found:
                return None
            same = all(kind == found[0] or (of is Lanes and isinstance(kind, types.Number)) for kind in args)
            kinds = [kind if kind == found[0] else types.float64 for kind in args]
            return signature(result(found[0].width), *kinds) if same else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return make(builder, *(_splat(builder, sig.return_type.width, value) for value in args))

    for kinds in ((of, of),) if of is Mask else ((of, of), (of, types.Float), (types.Float, of)):
        lower_builtin(function, *kinds)(lower)


def _of_one(function: Any, of: type[Places], make: Callable[[Any, Any], Any]) -> None:
    """Give *function* a meaning for one value of the kind *of*."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(args[0], args[0]) if type(args[0]) is of else None

    @lower_builtin(function, of)
    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return make(builder, args[0])


def larger(a: Any, b: Any) -> Any:
    """The larger of two, lane by lane; b where one of them is NaN."""
    raise NotImplementedError


def smaller(a: Any, b: Any) -> Any:
    """The smaller of two, lane by lane; b where one of them is NaN."""
    raise NotImplementedError


def root(a: Any) -> Any:
    """√a."""
    raise NotImplementedError


def magnitude(a: Any) -> Any:
    """|a|."""
    raise NotImplementedError


def floor(a: Any) -> Any:
    """The largest whole number that is not larger, lane by lane."""
    raise NotImplementedError


def _choice(sign: str) -> Callable[[Any, Any, Any], Any]:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


def _function(name: str) -> Callable[[Any, Any], Any]:
    """LLVM's own function of that name."""

    def make(builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(a.type, [a.type])
        return builder.call(
            cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{a.type.count}f64"), [a]
        )

    return make


for _name, _make in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _operator in (getattr(operator, _name), getattr(operator, f"i{_name}")):
        _of_two(_operator, Lanes, Lanes, lambda builder, a, b, make=_make: getattr(builder, make)(a, b))
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
    _of_two(getattr(operator, _name), Mask, Lanes, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))
_of_two(operator.ne, Mask, Lanes, lambda builder, a, b: builder.fcmp_unordered("!=", a, b))
_of_two(operator.and_, Mask, Mask, lambda builder, a, b: builder.and_(a, b))
_of_two(operator.or_, Mask, Mask, lambda builder, a, b: builder.or_(a, b))
_of_two(larger, Lanes, Lanes, _choice(">"))
_of_two(smaller, Lanes, Lanes, _choice("<"))
_of_one(operator.neg, Lanes, lambda builder, a: builder.fneg(a))
_of_one(operator.invert, Mask, lambda builder, a: builder.not_(a))
_of_one(root, Lanes, _function("sqrt"))
_of_one(magnitude, Lanes, _function("fabs"))
_of_one(floor, Lanes, _function("floor"))


@intrinsic
def select(typing: Any, mask: Any, a: Any, b: Any) -> Any:
    """a on the lanes of the mask, b elsewhere."""

    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(args[0], *(_splat(builder, mask.width, value) for value in args[1:]))

    kinds = [kind if isinstance(kind, Lanes) else types.float64 for kind in (a, b)]
    return Lanes(mask.width)(mask, *kinds), make


@intrinsic
def some(typing: Any, mask: Any) -> Any:
    """Whether the mask is true on any lane."""

    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = ir.IntType(mask.width)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))

    return types.boolean(mask), make


def _indexed(result: Any, a: Any, index: Any, *behind: Any) -> Any:
    """The signature of a function of an array, the indices of a place in it, and what comes behind them."""
    if not (isinstance(a, types.Array) and a.dtype == types.float64 and a.layout == "C"):
        return None
    rest = types.StarArgTuple.from_types((types.intp,) * len(index) + behind)
    return result(a, rest) if len(index) in (a.ndim - 1, a.ndim) else None


def _place(context: Any, builder: Any, width: int, kind: Any, value: Any, index: Any) -> Any:
    """Where the lanes with that index stand in an array."""
    array = context.make_array(kind)(context, builder, value)
    shape = cgutils.unpack_tuple(builder, array.shape, kind.ndim)
    offset = index[0]
    for d in range(1, len(index)):
        offset = builder.add(builder.mul(offset, shape[d]), index[d])
    if len(index) < kind.ndim:  # the last axis is not named: it is as long as the lanes
        offset = builder.mul(offset, ir.Constant(offset.type, width))
    return builder.bitcast(builder.gep(array.data, [offset]), ir.VectorType(Lanes.entry, width).as_pointer())


@intrinsic
def store(typing: Any, a: Any, *place: Any) -> Any:
    """``store(a, i, …, value)``: write lanes where ``load(a, i, …)`` reads them."""
    *index, kind = place

    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        *index, value = cgutils.unpack_tuple(builder, args[1])
        builder.store(value, _place(context, builder, kind.width, a, args[0], index), align=8)
        return context.get_dummy_value()

    sig = _indexed(types.void, a, index, kind)
    return (sig, make) if sig else None


def of_width(width: int) -> tuple[Any, Any]:
    """``load(a, i, …)`` and ``splat(x)`` for that many lanes."""

    @intrinsic
    def load(typing: Any, a: Any, *index: Any) -> Any:
        """The lanes from ``a[i, …]`` on; without the last index, that row. Indices are not checked."""

        def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            value = builder.load(_place(context, builder, width, a, args[0], cgutils.unpack_tuple(builder, args[1])))
            value.align = 8
            return value

        sig = _indexed(Lanes(width), a, index)
        return (sig, make) if sig else None

    @intrinsic
    def splat(typing: Any, x: Any) -> Any:
        """The number *x* on every lane."""

        def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _splat(builder, width, args[0])

        return Lanes(width)(types.float64), make

    return load, splat


load, splat = of_width(LANES)
