"""One camera and one light for all pictures of an episode, so that they can be compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from .marks import ball, friction_cone
from .picture import Camera, Image, Item, render
from .record import Record
from .stage import Stage


@dataclass(frozen=True, eq=False)
class Contacts:
    """Where the fingers touch, in the body's frame: points and inward normals ``(k, 3)``, and the friction µ."""

    points: Array
    normals: Array
    friction: float

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Contacts | None:
        """The contacts that the last step with contacts among its outputs names; None if there are none."""
        for step in reversed(data["steps"]):
            outputs = step.get("outputs", {})
            points, normals = (np.asarray(outputs.get(k) or [], dtype=np.float64) for k in ("contacts", "normals"))
            if points.size and points.shape == normals.shape and points.shape[1:] == (3,):
                return cls(points, normals, float(data["inputs"].get("friction") or 0.6))
        return None


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

    def close_up(self, body: str, contacts: Contacts, moment: int, size: tuple[int, int], *, across: bool) -> Image:
        """The object in the hand, the hand see-through, with the friction cones of its *contacts*.

        The camera looks *across* the line on which the hand closes, or along it, whichever side is nearer to the
        camera of the other pictures.
        """
        assert self.record is not None
        T = self.record.poses(moment)[body]
        items = self.stage.items(self.record.q[moment], self.record.poses(moment), ghosts=False, robot_alpha=0.45)
        thing = next(t for t in self.stage.bodies if t.name == body)
        reach = 0.3 * float(np.ptp(thing.vertices, axis=0).max())
        seen = [thing.vertices]
        for point, normal in zip(contacts.points, contacts.normals):
            cone = friction_cone(point, normal, contacts.friction, reach)
            items.append(Item(*cone, pose=T, rgba=(0.10, 0.42, 0.85, 0.6), gloss=0.0, shadow=False))
            items.append(Item(*ball(point, 0.05 * reach), pose=T, rgba=(0.05, 0.15, 0.45, 1.0), shadow=False))
            seen.append(cone[0])
        closing = T[:3, :3] @ contacts.normals[0]
        bearing = math.atan2(closing[1], closing[0]) + (0.5 * math.pi if across else 0.0)
        azimuth = min((bearing, bearing + math.pi), key=lambda a: -math.cos(a - self.azimuth))
        points = np.vstack(seen) @ T[:3, :3].T + T[:3, 3]
        camera = Camera.around(
            points, azimuth=azimuth, elevation=math.radians(26.0), aspect=size[0] / size[1], margin=1.25
        )
        return render(items, camera, size=size, focus=(points.min(axis=0), points.max(axis=0)))
