"""`Outline`: a planar figure, the section or the silhouette of a body (K, 2-D models)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, as_shaped
from ..errors import InputError
from ..files import replace_file
from . import files, fit
from .repair import mesh_of
from .surface_mesh import SurfaceMesh


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed polygons ``(n, 2)`` in a plane; outer ones run counter-clockwise, holes clockwise.

    ``pose`` is T_body_plane: its z axis is the plane's normal, and x, y are the coordinates of the polygons in m.
    ``lines`` are open polylines, where the section of an open surface does not close.
    """

    loops: tuple[Array, ...]
    pose: Array = field(default_factory=lambda: np.eye(4))
    lines: tuple[Array, ...] = ()

    def __len__(self) -> int:
        return len(self.loops)

    @property
    def area(self) -> float:
        """Area in m² of the figure, holes left out."""
        return sum(_area(loop) for loop in self.loops)

    @property
    def length(self) -> float:
        """Length in m of all polygons and lines."""
        closed = sum(float(np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1).sum()) for p in self.loops)
        return closed + sum(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in self.lines)

    @cached_property
    def points(self) -> Array:
        """All corners ``(V, 2)``."""
        return np.concatenate([*self.loops, *self.lines, np.empty((0, 2))])

    @property
    def polylines(self) -> tuple[Array, ...]:
        """The polygons (each ends where it starts) and lines as ``(n, 3)`` in the frame of the body."""
        flat = [np.vstack([p, p[:1]]) for p in self.loops] + list(self.lines)
        return tuple(p @ self.pose[:3, :2].T + self.pose[:3, 3] for p in flat)

    def inside(self, points: ArrayLike) -> BoolArray:
        """Whether *points* ``(..., 2)`` of the plane lie in the figure: nonzero winding number."""
        p = as_shaped(points, "points", 2)
        flat = p.reshape(-1, 2)
        winding = np.zeros(len(flat), dtype=np.int64)
        for loop in self.loops:
            for a, b in zip(loop, np.roll(loop, -1, axis=0)):
                left = (b[0] - a[0]) * (flat[:, 1] - a[1]) - (b[1] - a[1]) * (flat[:, 0] - a[0])
                winding += (a[1] <= flat[:, 1]) & (flat[:, 1] < b[1]) & (left > 0.0)
                winding -= (b[1] <= flat[:, 1]) & (flat[:, 1] < a[1]) & (left < 0.0)
        within: BoolArray = (winding != 0).reshape(p.shape[:-1])
        return within

    def rectangle(self) -> tuple[Array, Array]:
        """The smallest rectangle around the figure: T_body_rectangle ``(4, 4)`` of its centre, and extents ``(2,)``."""
        self._must_not_be_empty()
        x = fit.rectangle_side(self.points)
        turn = np.array([[x[0], -x[1]], [x[1], x[0]]])
        local = self.points @ turn
        low, high = local.min(axis=0), local.max(axis=0)
        inner = np.eye(4)
        inner[:2, :2], inner[:2, 3] = turn, turn @ (0.5 * (low + high))
        return self.pose @ inner, np.asarray(high - low)

    def circle(self) -> fit.Ball:
        """A circle around the figure, the smallest but for about 1 %; its centre in the plane ``(2,)``."""
        self._must_not_be_empty()
        return fit.ball(self.points)

    def simplified(self, tolerance: float) -> Outline:
        """Polygons with fewer corners (Douglas & Peucker 1973): none of the old ones is farther than *tolerance* away.

        The new corners are some of the old, so the Hausdorff distance of the outlines is at most *tolerance* m.
        """
        if not tolerance >= 0.0:
            raise InputError(f"tolerance is {tolerance}; expected zero or a length in m")
        loops = []
        for loop in self.loops:
            far = int(np.argmax(np.linalg.norm(loop - loop[0], axis=1)))
            round_trip = np.vstack([loop, loop[:1]])
            kept = np.vstack([_thinned(round_trip[: far + 1], tolerance)[:-1], _thinned(round_trip[far:], tolerance)])
            if len(kept) > 3:
                loops.append(kept[:-1])
        return Outline(tuple(loops), self.pose, tuple(_thinned(line, tolerance) for line in self.lines))

    def extruded(self, low: float, high: float) -> SurfaceMesh:
        """The prism over the figure between the heights *low* and *high* in m along the plane's normal."""
        self._must_not_be_empty()
        if not high > low:
            raise InputError(f"low is {low} and high is {high}; the prism needs high above low")
        import manifold3d

        vertices, faces = mesh_of(cross_section(self.loops, manifold3d.FillRule.Positive).extrude(high - low))
        local = vertices + [0.0, 0.0, low]
        return SurfaceMesh(local @ self.pose[:3, :3].T + self.pose[:3, 3], faces)

    def save(self, path: str | Path) -> Path:
        """Write the figure as ``.npz`` (`load` reads it) or as a picture ``.svg`` in millimetres."""
        path = Path(path)
        if path.suffix.lower() == ".svg":
            with replace_file(path) as work:
                work.write_text(self.svg())
            return path
        arrays = {f"loop{i}": loop for i, loop in enumerate(self.loops)}
        arrays |= {f"line{i}": line for i, line in enumerate(self.lines)}
        return files.write(path, "outline", pose=self.pose, counts=[len(self.loops), len(self.lines)], **arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The outline that `save` wrote as ``.npz``."""
        data = files.read(path, "outline", "pose", "counts")
        loops, lines = (int(n) for n in data["counts"])
        return cls(
            tuple(as_shaped(data[f"loop{i}"], f"loop{i}", 2) for i in range(loops)),
            as_shaped(data["pose"], "pose", 4, 4),
            tuple(as_shaped(data[f"line{i}"], f"line{i}", 2) for i in range(lines)),
        )

    def svg(self) -> str:
        """The figure as an SVG of true size, y upwards."""
        self._must_not_be_empty()
        low, high = 1e3 * self.points.min(axis=0), 1e3 * self.points.max(axis=0)
        edge = 0.03 * float((high - low).max())
        width, height = high - low + 2.0 * edge

        def path(points: Array, end: str) -> str:
            return "M" + " L".join(f"{1e3 * x:.4f},{-1e3 * y:.4f}" for x, y in points) + end

        filled = " ".join(path(loop, " Z") for loop in self.loops)
        drawn = "".join(
            f'<path d="{path(line, "")}" fill="none" stroke="#1f4e6b" stroke-width="{0.1 * edge:.4f}"/>'
            for line in self.lines
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
            f'viewBox="{low[0] - edge:.4f} {-high[1] - edge:.4f} {width:.4f} {height:.4f}">'
            f'<path d="{filled}" fill="#c9dbe5" stroke="#1f4e6b" stroke-width="{0.1 * edge:.4f}"/>{drawn}</svg>\n'
        )

    def _must_not_be_empty(self) -> None:
        if not len(self.points):
            raise InputError("the outline is empty: the plane misses the body")


def _area(loop: Array) -> float:
    x, y = (loop - loop[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _thinned(line: Array, tolerance: float) -> Array:
    """The ends of ``line (n, 2)`` and those points between that are needed to stay within *tolerance*."""
    keep = np.zeros(len(line), dtype=bool)
    keep[[0, -1]] = True
    stack = [(0, len(line) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        a, along = line[first], line[last] - line[first]
        to = line[first + 1 : last] - a
        t = np.clip(to @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        away = np.linalg.norm(to - t[:, None] * along, axis=1)
        worst = int(np.argmax(away))
        if away[worst] > tolerance:
            middle = first + 1 + worst
            keep[middle] = True
            stack += [(first, middle), (middle, last)]
    return line[keep]


def cross_section(loops: tuple[Array, ...] | list[Array], rule: Any) -> Any:
    """Polygons as a `manifold3d.CrossSection`: their union by the fill *rule*."""
    import manifold3d

    return manifold3d.CrossSection([np.ascontiguousarray(loop) for loop in loops], rule)
