"""The answer of inverse kinematics: joint vectors, how near they come, and for every target one reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..errors import InputError
from ..result import Result, Status


class IKStatus(Status):
    """How the search for one target ended."""

    SUCCESS = "a joint vector within the limits reaches the target within the tolerance"
    OUT_OF_REACH = "no joint vector reaches the target"
    LIMITS = "the target can be reached, but only outside the joint limits"
    COLLISION = "the target is reached within the limits, but no solution found was accepted as free of collision"
    SINGULAR = (
        "the chain comes within a hair of the target, but cannot move in the direction that is missing: a singularity"
    )
    NOT_FOUND = "no start led to the target"
    CONFLICT = "every frame reaches its target alone, but no start led all of them there at once"

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

    ``q (..., n)``, or ``(..., s, n)`` when s solutions were asked for (rows from ``found`` on repeat the first).
    Where nothing was found, q is the joint vector within the limits that comes nearest (least distance over the
    chain's reach, squared, plus 2 − 2 cos of the angle), so that ``residual (..., 2)``, the distance in m and the
    angle in rad between target and frame at the (first) q, says what is missing; ``limiting (..., n)`` are the joints
    that are at a limit there.
    """

    q: Array
    codes: IntArray  # (...) positions in the list of `IKStatus`
    residual: Array  # (..., 2)
    found: IntArray  # (...) distinct solutions
    starts: IntArray  # (...) starts used
    certified: BoolArray  # (...) out of reach by a bound that holds for every joint vector
    limiting: BoolArray  # (..., n)
    frame: str
    joint_names: tuple[str, ...]
    at_fault: IntArray | None = None  # (...) of several frames: the one that cannot reach its target alone, or −1

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
        distance, angle = self.residual[index]
        name = f"{self.frame!r}"
        if self.at_fault is not None and self.at_fault[index] >= 0:
            name += f", because of {self.frame.split(', ')[int(self.at_fault[index])]!r} alone"
        nearest = f"the nearest pose found is {distance:.3g} m and {angle:.3g} rad away"
        stuck = [joint for joint, at in zip(self.joint_names, self.limiting[index], strict=True) if at]
        if stuck:
            nearest += f", with {', '.join(stuck)} at a limit"
        if status is IKStatus.SUCCESS:
            return f"{name} reaches the target: off by {distance:.2g} m and {angle:.2g} rad"
        if status is IKStatus.OUT_OF_REACH:
            proof = "certified by the lengths of the links" if self.certified[index] else "by search, limits apart"
            return f"{name}: {status.value} ({proof}); {nearest}"
        if status is IKStatus.COLLISION:
            return f"{name}: {status.value} ({int(self.starts[index])} starts were tried)"
        if status is IKStatus.NOT_FOUND:
            return f"{name}: {status.value} ({int(self.starts[index])} were tried); {nearest}"
        return f"{name}: {status.value}; {nearest}"

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
