"""Answers: frozen values with a status, never ``None``, NaN or a log line.

A computation whose outcome depends on numbers returns a dataclass that derives from `Result`. Its ``status`` is an
enum whose values are one sentence each, so that a person can read ``print(result.status.value)``.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Self

from .errors import UnsuccessfulError


class Status(Enum):
    """Base of all status enums: the value is one English sentence that explains the outcome."""

    def __str__(self) -> str:
        return self.name.lower()


class Result:
    """Mixin for frozen dataclasses that have a ``status`` and a boolean ``success``."""

    status: Status

    @property
    def success(self) -> bool:
        """Whether the status is the enum's success (named ``SUCCESS`` or ``OPTIMAL``)."""
        return self.status.name in ("SUCCESS", "OPTIMAL")

    def explain(self) -> str:
        """One sentence on the outcome; classes override it to add facts."""
        return str(self.status.value)

    def require_success(self) -> Self:
        """Return ``self``, or raise `UnsuccessfulError` with the explanation; of a batch, all must have succeeded."""
        good: Any = self.success
        if not (good if isinstance(good, bool) else good.all()):
            raise UnsuccessfulError(self.explain())
        return self
