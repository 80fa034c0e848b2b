"""The grasp process (G 4): from locating the object to letting go of it, in steps to inspect and to replace."""

from .context import Context
from .episode import Episode, EpisodeStatus, StepRecord, StepStatus, Verdict, read_episode
from .fine import Refine
from .fingers import CloseFingers, RateFingers
from .locate import Locate, LocateByState
from .pipeline import Process, pick_and_place
from .shuffle import shuffled
from .step import Observer, Outcome, Step

__all__ = [
    "CloseFingers",
    "Context",
    "Episode",
    "EpisodeStatus",
    "Locate",
    "LocateByState",
    "Observer",
    "Outcome",
    "Process",
    "RateFingers",
    "Refine",
    "Step",
    "StepRecord",
    "StepStatus",
    "Verdict",
    "pick_and_place",
    "read_episode",
    "shuffled",
]
