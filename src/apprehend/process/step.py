"""What a step of the grasp process is: a name, and a `run` that reads and writes the context of the run.

Any object with these members can take the place of a step (`Process.replaced`): G 4's decomposition is the order of
the default ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from .context import Context
    from .episode import StepRecord


@dataclass(frozen=True)
class Outcome:
    """What a step reports: whether it did its part, a sentence, and the numbers behind it.

    *retry* says that another grasp may help: the process then lets go, backs off, and plans again.
    """

    success: bool
    message: str
    inputs: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, Any] = field(default_factory=dict)
    margins: Mapping[str, float] = field(default_factory=dict)
    skipped: bool = False
    retry: bool = False


class Step(Protocol):
    """One step of the process."""

    @property
    def name(self) -> str:
        """Short name, unique in the process."""

    @property
    def title(self) -> str:
        """What a person reads."""

    def run(self, context: Context) -> Outcome:
        """Do the step; problems that another input could have avoided are outcomes, not exceptions."""


class Observer:
    """Hears of the progress of a run; the default keeps silent."""

    def started(self, name: str, title: str) -> None:
        """A step begins."""

    def progress(self, text: str) -> None:
        """Something worth telling within the step."""

    def finished(self, record: StepRecord) -> None:
        """A step ended."""
