"""The record of one run of the grasp process: what every step got, decided and measured, and the verdict of physics.

An `Episode` is a value that can be saved as ``episode.json`` beside the meshes it refers to, shown, and read back.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import replace_directory
from ..result import Result, Status

FORMAT = "apprehend-episode/1"


class StepStatus(Status):
    """How a step of the process ended."""

    SUCCESS = "The step did what it is for."
    FAILED = "The step could not do what it is for; its message says why."
    SKIPPED = "The step was not needed."


class EpisodeStatus(Status):
    """How an episode ended."""

    SUCCESS = "The object stands at its goal, was held all the way, and was let go of."
    FAILED_STEP = "A step could not do its part, and the process stopped there."
    DROPPED = "The object left the hand before it was meant to."
    MISPLACED = "The object was set down, but too far from its goal pose."
    TOPPLED = "The object was to stand upright, and does not."


@dataclass(frozen=True)
class StepRecord(Result):
    """One step: its outcome, why, and the numbers behind it.

    *duration* is wall time and *simulated* the time in the physics engine, both in seconds.
    """

    name: str
    title: str
    status: StepStatus
    message: str
    duration: float
    simulated: float = 0.0
    inputs: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, Any] = field(default_factory=dict)
    margins: Mapping[str, float] = field(default_factory=dict)

    def explain(self) -> str:
        """The message of the step."""
        return f"{self.title}: {self.message}"


@dataclass(frozen=True)
class Verdict(Result):
    """What the physics engine says of the result.

    Errors are of the object's frame against its goal pose, in m and rad; *slip* is the largest change of the object's
    position in the hand between lift and release, in m.
    """

    status: EpisodeStatus
    reason: str
    position_error: float = float("nan")
    angle_error: float = float("nan")
    tilt: float = float("nan")
    slip: float = float("nan")

    def explain(self) -> str:
        """The reason of the verdict."""
        return self.reason


@dataclass(frozen=True, eq=False)
class Episode(Result):
    """The whole process, inspectable: steps in order, the verdict, the scene, and the recorded motion.

    *scene* and *recording* are plain data (lists and numbers) as in ``episode.json``; *meshes* holds the vertices and
    faces of every body by file name.
    """

    title: str
    inputs: Mapping[str, Any]
    steps: tuple[StepRecord, ...]
    verdict: Verdict
    scene: Mapping[str, Any]
    recording: Mapping[str, Any]
    meshes: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    @property
    def status(self) -> EpisodeStatus:  # type: ignore[override]
        """The verdict's status."""
        return self.verdict.status

    def explain(self) -> str:
        """The reason of the verdict."""
        return self.verdict.reason

    def step(self, name: str) -> StepRecord:
        """The record of the last step of that name."""
        from ..errors import unknown_name

        for record in reversed(self.steps):
            if record.name == name:
                return record
        unknown_name("step", name, (s.name for s in self.steps), "this episode")

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "format": FORMAT,
            "title": self.title,
            "inputs": plain(self.inputs),
            "verdict": {"success": self.success, **plain(self.verdict)},
            "steps": [plain(s) for s in self.steps],
            "scene": plain(self.scene),
            "recording": plain(self.recording),
        }

    def save(self, directory: str | Path) -> Path:
        """Write ``episode.json`` and the meshes it refers to into *directory*; return the path of the JSON file.

        Everything is written to a temporary directory first and then moved, so that an earlier episode is replaced
        whole or not at all. A directory that holds anything but an episode is refused.
        """
        target = Path(directory)
        with replace_directory(target, marker="episode.json") as work:
            for name, (vertices, faces) in self.meshes.items():
                path = work / name
                path.parent.mkdir(parents=True, exist_ok=True)
                write_obj(path, vertices, faces)
            (work / "episode.json").write_text(json.dumps(self.as_dict(), allow_nan=False))
        return target / "episode.json"


def read_episode(path: str | Path) -> dict[str, Any]:
    """The plain data of an ``episode.json`` (or of the directory that holds one)."""
    file = Path(path)
    if file.is_dir():
        file = file / "episode.json"
    if not file.exists():
        raise InputError(f"there is no episode at {file}; `apprehend pick --out DIR` writes DIR/episode.json")
    try:
        data = json.loads(file.read_text())
    except json.JSONDecodeError as error:
        raise InputError(f"{file}:{error.lineno}: not JSON ({error.msg}); was the file cut short?") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        found = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"{file} is not an episode of this version: its format is {found!r}, expected {FORMAT!r}")
    data["path"] = str(file)
    return data


def plain(value: Any) -> Any:
    """*value* as JSON data: arrays become lists, enums their names, dataclasses mappings, NaN and infinity null."""
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return round(float(value), 9) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    return value


def write_obj(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """A Wavefront OBJ file of a triangle mesh, micrometre digits."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces.tolist()]
    path.write_text("\n".join(lines) + "\n")
