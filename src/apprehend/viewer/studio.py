"""One camera and one light for all pictures of an episode, so that they can be compared."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .picture import Camera, Image, Item, render
from .record import Record
from .stage import Stage


@dataclass(frozen=True, eq=False)
class Studio:
    """The stage with one camera position and one light for all pictures of a report."""

    stage: Stage
    record: Record | None
    seen: Array  # points that must be in the picture
    azimuth: float

    @classmethod
    def of(cls, stage: Stage, record: Record | None) -> Studio:
        """Everything that moves, at a dozen moments, is to be seen; the camera stands beside the robot's front."""
        moments = np.linspace(0, len(record.time) - 1, 12).astype(int).tolist() if record else [None]
        scenery = len(stage.boxes)
        points = []
        for moment in moments:
            items = cls._items(stage, record, moment)
            end = len(items) - len(stage.ghosts)
            cast = (items[: end - scenery] + items[end:]) or items  # boxes reach out of the picture
            points += [i.vertices[:: max(1, len(i.vertices) // 60)] @ i.pose[:3, :3].T + i.pose[:3, 3] for i in cast]
        facing = 0.0
        if stage.robot is not None and stage.bodies:
            ahead = np.mean([t.pose[:2, 3] for t in (*stage.bodies, *stage.ghosts)], axis=0) - stage.robot.base[:2, 3]
            facing = math.atan2(ahead[1], ahead[0])
        return cls(stage, record, np.vstack(points), facing - math.radians(50.0))

    @staticmethod
    def _items(stage: Stage, record: Record | None, moment: int | None) -> list[Item]:
        if record is None or moment is None:
            return stage.items()
        return stage.items(record.q[moment], record.poses(moment))

    def shot(self, moment: int | None, size: tuple[int, int]) -> Image:
        """The picture at one sample of the recording."""
        focus = self.seen.min(axis=0), self.seen.max(axis=0)
        return render(self._items(self.stage, self.record, moment), self.camera(size), size=size, focus=focus)

    def camera(self, size: tuple[int, int]) -> Camera:
        """The camera for pictures of *size* (width, height)."""
        return Camera.around(
            self.seen, azimuth=self.azimuth, elevation=math.radians(20.0), aspect=size[0] / size[1], margin=1.12
        )
