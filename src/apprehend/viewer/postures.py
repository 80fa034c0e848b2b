"""Several postures of one robot side by side: the branches of inverse kinematics, a choice of grasps, keyframes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_pose, as_shaped
from ..errors import InputError
from ..kinematics import Robot
from .draw import stage_of
from .marks import arrow
from .picture import Camera, Image, Item, bounds, corners_of, render

MOST = 64
AXES = ((0.85, 0.2, 0.2, 1.0), (0.2, 0.65, 0.25, 1.0), (0.2, 0.35, 0.85, 1.0))


def render_postures(
    robot: Robot,
    q: ArrayLike,
    captions: Sequence[str] = (),
    *,
    target: ArrayLike | None = None,
    size: tuple[int, int] = (420, 380),
) -> Image:
    """*robot* at each of the joint vectors ``q (m, n)``, in panels of *size* seen from one place.

    *captions*: a line of text for each panel. *target* ``(4, 4)``: a pose, drawn as three arrows (x red, y green,
    z blue).
    """
    rows = as_shaped(q, "q", robot.n).reshape(-1, robot.n)
    if not 1 <= len(rows) <= MOST:
        raise InputError(f"q holds {len(rows)} joint vectors; a picture shows 1 to {MOST}")
    if captions and len(captions) != len(rows):
        raise InputError(f"{len(captions)} captions for {len(rows)} postures")
    stage = stage_of(robot)
    casts = [stage.items(row) for row in rows]
    low = np.min([bounds(cast)[0] for cast in casts], axis=0)
    high = np.max([bounds(cast)[1] for cast in casts], axis=0)
    marks = [] if target is None else _frame(as_pose(target, "target"), 0.16 * float(np.linalg.norm(high - low)) / 1.7)
    if marks:
        a, b = bounds(marks)
        low, high = np.minimum(low, a), np.maximum(high, b)
    camera = Camera.around(corners_of(low, high), aspect=size[0] / size[1])
    panels = [render([*cast, *marks], camera, size=size, focus=(low, high)) for cast in casts]
    across = min(len(panels), math.ceil(math.sqrt(1.6 * len(panels))))
    down = -(-len(panels) // across)
    sheet = np.full((down * size[1], across * size[0], 3), 255, dtype=np.uint8)
    for i, panel in enumerate(panels):
        y, x = divmod(i, across)
        sheet[y * size[1] : (y + 1) * size[1], x * size[0] : (x + 1) * size[0]] = panel
    return _captioned(sheet, captions, across, size)


def _frame(T: Array, length: float) -> list[Item]:
    items = []
    for axis, rgba in enumerate(AXES):
        vertices, faces = arrow(T[:3, 3], T[:3, axis] * length, 0.03 * length)
        items.append(Item(vertices, faces, rgba=rgba, shadow=False))
    return items


def _captioned(sheet: Image, captions: Sequence[str], across: int, size: tuple[int, int]) -> Image:
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    picture = Pillow.fromarray(sheet)
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(max(12, size[1] // 24))
    for i, text in enumerate(captions):
        y, x = divmod(i, across)
        draw.text((x * size[0] + 12, y * size[1] + 10), text, fill=(25, 25, 30), font=font)
    return np.array(picture)
