"""The recording of an episode as arrays, with the stretches of time that its steps took."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from .plots import Band
from .stage import body_poses


@dataclass(frozen=True, eq=False)
class Record:
    """Time ``(k,)`` in s, joints ``(k, n)``, bodies ``(k, 4, 4)`` by name; limits ``(n,)`` by name, inf where none."""

    time: Array
    joints: tuple[str, ...]
    q: Array
    qd: Array
    tau: Array
    limits: Mapping[str, Array]
    arm: tuple[int, ...]
    bodies: Mapping[str, Array]
    force: Array
    step: IntArray
    titles: tuple[str, ...]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Record:
        """The recording of an episode's *data*."""
        recording = data["recording"]
        time = np.asarray(recording.get("t", ()), dtype=np.float64)
        k, joints = len(time), tuple(recording.get("joint_names", ()))
        if not k:
            raise InputError("the episode has no recorded motion: its recording is empty")
        n = len(joints)

        def rows(name: str, *tail: int) -> Array:
            values = np.asarray(recording.get(name, np.zeros((k, *tail))), dtype=np.float64)
            if values.shape != (k, *tail):
                raise InputError(
                    f"recording.{name} has shape {values.shape}; expected {(k, *tail)} as t and joint_names"
                )
            return values

        given = recording.get("limits", {})
        limits = {
            name: np.array([np.nan if v is None else v for v in given.get(name, [None] * n)], dtype=np.float64)
            for name in ("lower", "upper", "velocity", "acceleration", "effort")
        }
        for name, values in limits.items():
            values[np.isnan(values)] = -np.inf if name == "lower" else np.inf
        return cls(
            time=time,
            joints=joints,
            q=rows("q", n),
            qd=rows("qd", n),
            tau=rows("tau", n),
            limits=limits,
            arm=tuple(recording.get("arm", range(n))),
            bodies={name: body_poses(values) for name, values in recording.get("bodies", {}).items()},
            force=rows("contact_force"),
            step=rows("step_index").astype(np.int64),
            titles=tuple(step["title"] for step in data["steps"]),
        )

    @cached_property
    def bands(self) -> tuple[Band, ...]:
        """The stretch of time of every step that moved anything."""
        edges = np.flatnonzero(np.diff(self.step)) + 1
        starts, stops = np.r_[0, edges], np.r_[edges, len(self.time) - 1]
        return tuple(
            Band(float(self.time[a]), float(self.time[b]), self.titles[self.step[a]])
            for a, b in zip(starts, stops)
            if 0 <= self.step[a] < len(self.titles)
        )

    def at(self, time: float) -> int:
        """Index of the sample at or just after *time*."""
        return min(int(np.searchsorted(self.time, time)), len(self.time) - 1)

    def poses(self, sample: int) -> dict[str, Array]:
        """Pose of every body at a *sample*."""
        return {name: poses[sample] for name, poses in self.bodies.items()}
