"""What planning answers: a path, or the facts why there is none."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array
from ..collision import Touch
from ..result import Result, Status


class PlanStatus(Status):
    """Outcomes of planning."""

    SUCCESS = "A path was found and is free of collision."
    START_IN_COLLISION = "The start is in collision."
    START_OUT_OF_LIMITS = "The start violates joint limits."
    NO_GOAL = "No goal was given."
    GOALS_OUT_OF_LIMITS = "Every goal violates joint limits."
    GOALS_IN_COLLISION = "Every goal is in collision, or violates joint limits."
    TIME_SPENT = "The time is spent and no path was found; one may exist."
    NODES_SPENT = "The memory for the search is spent and no path was found; one may exist."
    UNREACHABLE = "The straight line leaves what the arm can reach within its joint limits."
    BRANCH_CHANGE = "The straight line needs a jump of the joints: it passes a singularity or changes the branch."
    COLLISION = "The straight line collides."
    START_OFF_CONSTRAINT = "The start violates a constraint on the path."
    GOALS_OFF_CONSTRAINT = "Every goal violates a constraint on the path, or is in collision, or beyond joint limits."


@dataclass(frozen=True, eq=False)
class PlanResult(Result):
    """A path ``(M, n)`` of joint vectors that are connected by straight motions, or why there is none."""

    status: PlanStatus
    path: Array = field(default_factory=lambda: np.zeros((0, 0)))
    goal: int = -1
    """Index of the goal that the path reaches."""
    detail: str = ""
    """The facts: what is in collision with what and how deep, which joint is out of its limits, what was spent."""
    touches: tuple[Touch, ...] = ()
    """What is in collision, where that is the reason."""
    nodes: int = 0
    """Configurations in the search trees."""
    samples: int = 0
    """Random configurations tried."""
    seconds: float = 0.0
    progress: float = 1.0
    """Share of a straight line that is possible."""

    @property
    def length(self) -> float:
        """Length of the path in joint space, in rad and m."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum()) if len(self.path) > 1 else 0.0

    def timed(self, seconds: float) -> PlanResult:
        """The answer with the time that it took."""
        return replace(self, seconds=seconds)

    def along(self, path: Array) -> PlanResult:
        """The answer with another path."""
        return replace(self, path=path)

    def explain(self) -> str:
        """The status, and the facts behind it."""
        return f"{self.status.value} {self.detail}".rstrip()
