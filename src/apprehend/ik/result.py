"""The answer of inverse kinematics: joint vectors, how near they come, and for every target one reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError, UnsuccessfulError
from ..result import Result, Status


class IKStatus(Status):
    """How the search for one target ended."""

    SUCCESS = "a joint vector within the limits reaches the target within the tolerance"
    OUT_OF_REACH = "no joint vector reaches the target: it is farther away than the chain is long (certified)"
    NOT_FOUND = "no start led to the target; it may be out of reach, or need more starts"

    @property
    def code(self) -> int:
        """Position of this status in the list of all, as in `IKResult.codes`."""
        return _CODES[self]


_STATUSES = tuple(IKStatus)
_CODES = {status: i for i, status in enumerate(_STATUSES)}
_OBJECTS = np.array(_STATUSES, dtype=object)


@dataclass(frozen=True, eq=False)
class IKResult(Result):
    """Solutions of `solve` for a batch of targets; leading dimensions are the targets'.

    ``q (..., n)``, or ``(..., s, n)`` when s solutions were asked for (rows from ``found`` on repeat the first);
    where nothing was found, q is the guess or the home position. ``residual (..., 2)`` is the distance in m and the
    angle in rad between the target and the frame at the (first) q, by the robot's own forward kinematics.
    """

    q: Array
    codes: IntArray  # (...) positions in the list of `IKStatus`
    residual: Array  # (..., 2)
    found: IntArray  # (...) distinct solutions
    starts: IntArray  # (...) starts used
    facts: tuple[str, float, Array]  # frame, reach in m (no point is farther from the chain's origin), that origin

    @property
    def success(self) -> Any:
        """``(...)`` booleans; a plain bool for one target."""
        good: BoolArray = self.codes == 0
        return bool(good) if good.ndim == 0 else good

    @property
    def status(self) -> Any:  # type: ignore[override]
        """`IKStatus` of every target, an object array ``(...)``; the status itself for one target."""
        return _OBJECTS[self.codes]

    def solutions(self, *index: int) -> Array:
        """The distinct solutions ``(found, n)`` of one target of the batch."""
        if len(index) != self.codes.ndim:
            raise InputError(f"{len(index)} indices for a batch of shape {self.codes.shape}; give one per dimension")
        q: Array = self.q[index]
        rows: Array = q.reshape(-1, q.shape[-1])[: int(self.found[index])]
        return rows

    def reason(self, *index: int) -> str:
        """One sentence with the facts on one target of the batch."""
        if len(index) != self.codes.ndim:
            raise InputError(f"{len(index)} indices for a batch of shape {self.codes.shape}; give one per dimension")
        status = _STATUSES[int(self.codes[index])]
        frame, reach, _ = self.facts
        distance, angle = self.residual[index]
        if status is IKStatus.SUCCESS:
            return f"{frame!r} reaches the target: off by {distance:.2g} m and {angle:.2g} rad"
        if status is IKStatus.OUT_OF_REACH:
            return f"{frame!r} cannot reach the target: {status.value}; the chain is {reach:.4g} m long"
        return f"{frame!r}: {status.value} ({int(self.starts[index])} starts were tried)"

    def explain(self) -> str:
        """The reason for one target; for a batch, how many succeeded and the reason of the first that did not."""
        if self.codes.ndim == 0:
            return self.reason()
        good = self.codes == 0
        text = f"{int(good.sum())} of {good.size} targets solved"
        if good.all():
            return text
        first = tuple(int(i) for i in np.argwhere(~good)[0])
        return f"{text}; target {first if len(first) > 1 else first[0]}: {self.reason(*first)}"

    def require_success(self) -> Self:
        """Return ``self`` if every target is solved, or raise `UnsuccessfulError` with the explanation."""
        if not np.all(self.codes == 0):
            raise UnsuccessfulError(self.explain())
        return self
