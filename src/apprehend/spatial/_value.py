"""What the values of this room share: one read-only array, batch shape, indexing, frames that are checked if named."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import DTypeLike

from ..arrays import Array
from ..errors import InputError


class Value:
    """A frozen batch of items of shape ``_tail``, kept in one array whose leading dimensions are the batch."""

    _tail: ClassVar[tuple[int, ...]]
    __slots__ = ("_array",)
    _array: Array

    def __init__(self, array: Array) -> None:
        kept = array.copy()
        kept.flags.writeable = False
        object.__setattr__(self, "_array", kept)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen; make a new one instead of setting {name!r}")

    def _like(self, array: Array) -> Self:
        """A value of the same kind and frames around *array*."""
        raise NotImplementedError

    @property
    def shape(self) -> tuple[int, ...]:
        """The batch shape; ``()`` for a single one."""
        return self._array.shape[: self._array.ndim - len(self._tail)]

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError(f"a single {type(self).__name__} has no length")
        return self.shape[0]

    def __getitem__(self, index: Any) -> Self:
        if not self.shape:
            raise TypeError(f"a single {type(self).__name__} cannot be indexed")
        chosen = np.arange(math.prod(self.shape)).reshape(self.shape)[index]  # an index never reaches into the items
        return self._like(self._array.reshape(-1, *self._tail)[chosen])

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Any:
        return np.array(self._array, dtype=dtype) if copy or dtype is not None else self._array

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restore, (type(self), {name: getattr(self, name) for name in self._names()}))

    def _names(self) -> list[str]:
        return [name for cls in type(self).__mro__ for name in getattr(cls, "__slots__", ())]

    def __repr__(self) -> str:
        named = ", ".join(f"{n}={getattr(self, n)!r}" for n in self._names() if n != "_array" and getattr(self, n))
        body = np.array2string(self._array, precision=6, suppress_small=True, threshold=40)
        return f"{type(self).__name__}({body}{', ' + named if named else ''})"


def _restore(kind: type[Value], fields: dict[str, Any]) -> Value:
    value = object.__new__(kind)
    for name, field in fields.items():
        object.__setattr__(value, name, field)
    return value


def same_frame(first: str, second: str, what: str) -> None:
    """Raise `InputError` if both names are given and differ."""
    if first and second and first != second:
        raise InputError(f"{what}: frame {first!r} meets frame {second!r}; transform one of them first")
