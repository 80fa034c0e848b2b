"""Wide numbers: eight float64 side by side, one per problem, that kernels compute with as if they were one number.

LLVM's loop vectoriser needs long loops over lanes, checks at run time that arrays don't overlap, and keeps every
intermediate in memory. Where a method is made of many short, branching steps (`kernels.cone`) that costs more than it
gains. Here the lanes are a type instead: ``<8 x double>`` in LLVM, with the usual operators, so that sums stay in
registers and each operation is one AVX-512 instruction, two of AVX, four of NEON.

An array of wide numbers is a float64 array whose last axis has length `WIDTH`; `load` and `store` move one between
memory and a register (indices are not checked). Comparisons give a mask for `where`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from numba.core import cgutils, types
from numba.core.imputils import lower_builtin
from numba.core.typing import signature
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import intrinsic, models, register_model

ir = cgutils.ir
WIDTH = 8
"""Numbers in a wide number."""
FLOAT = types.float64
LLVM_WIDE = ir.VectorType(ir.DoubleType(), WIDTH)


class Wide(types.Type):
    """Numba's type of eight float64."""

    def __init__(self) -> None:
        super().__init__(name=f"Wide{WIDTH}")


class Mask(types.Type):
    """Numba's type of eight booleans."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask{WIDTH}")


WIDE, MASK = Wide(), Mask()


@register_model(Wide)
class _WideModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, LLVM_WIDE)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), WIDTH))


def _spread(builder: Any, kind: Any, value: Any) -> Any:
    """*value* of type *kind* as a vector."""
    if kind == WIDE:
        return value
    nothing = ir.Constant(LLVM_WIDE, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))


def _binary(op: Callable[..., Any], result: Any, make: Callable[[Any, Any, Any], Any]) -> None:
    """Give *op* a meaning for wide numbers, and for a wide number and a float."""
    pairs = ((WIDE, WIDE), (WIDE, FLOAT), (FLOAT, WIDE))

    @infer_global(op)
    class _Typing(ConcreteTemplate):
        cases = [signature(result, a, b) for a, b in pairs]

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return make(builder, *(_spread(builder, kind, v) for kind, v in zip(sig.args, args)))

    for a, b in pairs:
        lower_builtin(op, a, b)(lower)


for _ops, _name in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _op in _ops:
        _binary(_op, WIDE, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
for _op, _sign in ((operator.gt, ">"), (operator.lt, "<")):
    _binary(_op, MASK, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))


@infer_global(operator.neg)
class _Negation(ConcreteTemplate):
    cases = [signature(WIDE, WIDE)]


@lower_builtin(operator.neg, WIDE)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _pointer(context: Any, builder: Any, kinds: Any, args: Any) -> Any:
    """Where the wide number with the given indices stands in the array that comes first in *args*."""
    array = context.make_array(kinds[0])(context, builder, args[0])
    shape = cgutils.unpack_tuple(builder, array.shape, kinds[0].ndim)
    index = None
    for d, (kind, value) in enumerate(zip(kinds[1:], args[1:])):
        i = context.cast(builder, value, kind, types.intp)
        index = i if index is None else builder.add(builder.mul(index, shape[d]), i)
    place = builder.gep(array.data, [builder.mul(index, ir.Constant(index.type, WIDTH))])
    return builder.bitcast(place, LLVM_WIDE.as_pointer())


def _read(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    value = builder.load(_pointer(context, builder, sig.args, args))
    value.align = 8
    return value


def _write(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[-1], _pointer(context, builder, sig.args[:-1], args[:-1]), align=8)
    return context.get_dummy_value()


@intrinsic
def load(typing: Any, a: Any, i: Any) -> Any:
    """The wide number ``a[i]`` of an array ``(n, WIDTH)``."""
    return WIDE(a, i), _read


@intrinsic
def load2(typing: Any, a: Any, i: Any, j: Any) -> Any:
    """The wide number ``a[i, j]`` of an array ``(m, n, WIDTH)``."""
    return WIDE(a, i, j), _read


@intrinsic
def store(typing: Any, a: Any, i: Any, value: Any) -> Any:
    """``a[i] = value`` for an array ``(n, WIDTH)``."""
    return types.void(a, i, WIDE), _write


@intrinsic
def store2(typing: Any, a: Any, i: Any, j: Any, value: Any) -> Any:
    """``a[i, j] = value`` for an array ``(m, n, WIDTH)``."""
    return types.void(a, i, j, WIDE), _write


@intrinsic
def wide(typing: Any, x: Any) -> Any:
    """A float in all places."""

    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, FLOAT, args[0])

    return WIDE(FLOAT), make


def _unary(name: str) -> Callable[..., Any]:
    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        shape = ir.FunctionType(LLVM_WIDE, [LLVM_WIDE])
        return builder.call(cgutils.get_or_insert_function(builder.module, shape, f"llvm.{name}.v{WIDTH}f64"), args)

    return make


@intrinsic
def root(typing: Any, x: Any) -> Any:
    """√x."""
    return WIDE(WIDE), _unary("sqrt")


@intrinsic
def size(typing: Any, x: Any) -> Any:
    """|x|."""
    return WIDE(WIDE), _unary("fabs")


def _choose(sign: str) -> Callable[..., Any]:
    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (_spread(builder, kind, v) for kind, v in zip(sig.args, args))
        return builder.select(builder.fcmp_ordered(sign, a, b), a, b)

    return make


@intrinsic
def larger(typing: Any, a: Any, b: Any) -> Any:
    """The larger of two, place by place; b where one of them is NaN."""
    return WIDE(a, b), _choose(">")


@intrinsic
def smaller(typing: Any, a: Any, b: Any) -> Any:
    """The smaller of two, place by place; b where one of them is NaN."""
    return WIDE(a, b), _choose("<")


@intrinsic
def where(typing: Any, mask: Any, a: Any, b: Any) -> Any:
    """a in the places of the mask, b elsewhere."""

    def make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y = (_spread(builder, kind, v) for kind, v in zip(sig.args[1:], args[1:]))
        return builder.select(args[0], x, y)

    return WIDE(MASK, a, b), make
