"""Parallel jaws, found from the geometry of a hand: which links close on each other, how far, and how strongly.

Nothing is known about a hand but its links, joints and surfaces. The joints are swept; the links that move against
each other along one direction are the two jaws; lines along that direction, through both, measure the gap. The pads
are where the gap is smallest when the hand closes. Pads may translate (Franka hand), travel on an arc (Robotiq), or
turn about a hinge, and one jaw may stand still.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, BoolArray
from ..errors import DescriptionError
from .gap import Grid, extent_along_lines, largest_patch
from .jaw import ParallelJaw
from .jaw_measure import measure
from .jaw_parts import Patch, Surfaces, approach, surfaces_of
from .robot import Robot

PAD_TOLERANCE = 1e-3
"""A place belongs to a pad if the gap there is at most this much above the smallest, in m."""
SLOW = 0.4
"""Surfaces that move slower than this share of the fastest are not pads."""


def find_jaw(robot: Robot) -> ParallelJaw:
    """The parallel jaw of a hand whose root is the hand's base link; `DescriptionError` if it has none."""
    if robot.n not in (1, 2):
        raise DescriptionError(
            f"hand {robot.name!r} has {robot.n} coordinates; a parallel jaw closes with one, or one for each finger"
        )
    limits = robot.limits
    if not (np.isfinite(limits.lower) & np.isfinite(limits.upper) & (limits.upper > limits.lower)).all():
        raise DescriptionError(f"hand {robot.name!r}: a jaw needs finite limits on {', '.join(robot.joint_names)}")
    surfaces = surfaces_of(robot)
    candidates = []
    for corner in _corners(robot.n):
        closed = np.where(corner, limits.upper, limits.lower)
        opened = np.where(corner, limits.lower, limits.upper)
        found = _try_direction(surfaces, opened, closed)
        if found is not None:
            candidates.append(found)
    if not candidates:
        raise DescriptionError(
            f"hand {robot.name!r}: no two parts close on each other when {', '.join(robot.joint_names)} "
            f"move{'s' if robot.n == 1 else ''} through the limits: it has no fingers, or they are without geometry"
        )
    return max(candidates, key=lambda jaw: (jaw.max_width - jaw.min_width) - jaw.min_width)


def _corners(n: int) -> list[Array]:
    return [np.array([(k >> i) & 1 for i in range(n)], dtype=bool) for k in range(2**n)]


def _try_direction(surfaces: Surfaces, opened: Array, closed: Array) -> ParallelJaw | None:
    """The jaw that closes from *opened* to *closed*, or None if nothing closes that way."""
    robot = surfaces.robot
    groups = _groups(surfaces, opened, closed)
    if groups is None:
        return None
    axis, front, back = groups
    R = _axes_with(axis)
    fast = _fast_parts(surfaces, opened, closed, axis)
    front, back = front & fast.triangles.keys(), back & fast.triangles.keys()
    if not front or not back:
        return None
    s_closed = _first_touch(fast, opened, closed, R, front, back)
    if s_closed <= 0.0:
        return None
    q_closed = opened + s_closed * (closed - opened)
    patch = _pads(fast, q_closed, R, front, back)
    for _ in range(3):  # on an arc or about a hinge, the closing direction turns with the stroke: take that of the pads
        if patch is None:
            return None
        axis = _closing_direction(robot, patch, q_closed + 1e-4 * (opened - closed), q_closed)
        if axis @ R[0] > 1.0 - 1e-10:
            break
        R = _axes_with(axis)
        patch = _pads(fast, q_closed, R, front, back)
    return None if patch is None else measure(surfaces, opened, q_closed, R, patch)


def _closing_direction(robot: Robot, patch: Patch, before: Array, closed: Array) -> Array:
    """The direction in which pad 1 approaches pad 0 when the jaw is nearly closed."""
    travel = []
    for link, point in zip(patch.links, patch.points, strict=True):
        change = robot.fk(closed, link) - robot.fk(before, link)
        travel.append(change[:3, :3] @ point + change[:3, 3])
    relative = travel[1] - travel[0]
    direction: Array = relative / np.linalg.norm(relative)
    return direction


def _groups(surfaces: Surfaces, opened: Array, closed: Array) -> tuple[Array, frozenset[str], frozenset[str]] | None:
    """The closing direction near *closed* and the links on its positive and its negative side, or None."""
    robot = surfaces.robot
    before = closed + 1e-4 * (opened - closed)
    points, velocities, links = [], [], []
    for link, triangles in surfaces.triangles.items():
        if link not in surfaces.moving:
            continue
        centre = triangles.reshape(-1, 3).mean(axis=0)
        T0, T1 = robot.fk(before, link), robot.fk(closed, link)
        p = T1[:3, :3] @ centre + T1[:3, 3]
        points.append(p)
        velocities.append((p - T0[:3, :3] @ centre - T0[:3, 3]) * 1e4)
        links.append(link)
    v, p = np.array(velocities), np.array(points)
    speed = float(np.linalg.norm(v, axis=1).max(initial=0.0))
    if speed < 1e-4:
        return None
    spread = v - v.mean(axis=0)
    one_sided = float(np.linalg.norm(spread, axis=1).max()) < 0.5 * speed
    values, vectors = np.linalg.eigh((v if one_sided else spread).T @ (v if one_sided else spread))
    axis = vectors[:, int(np.argmax(values))]
    axis = axis * np.sign(axis[int(np.argmax(np.abs(axis)))])  # along a positive axis of the hand, as far as it can be
    along = v @ axis
    if one_sided:
        axis = axis * -np.sign(along.sum())  # the moving jaw travels towards −axis: it is the front one
        static = frozenset(surfaces.triangles.keys() - surfaces.moving)
        return (axis, frozenset(links), static) if static else None
    centred = along - 0.5 * (along.max() + along.min())
    clear = 0.1 * float(np.abs(centred).max())
    front = frozenset(n for n, a in zip(links, centred, strict=True) if a < -clear)
    back = frozenset(n for n, a in zip(links, centred, strict=True) if a > clear)
    return (axis, front, back) if front and back else None


def _fast_parts(surfaces: Surfaces, opened: Array, closed: Array, axis: Array) -> Surfaces:
    """*surfaces* without what the closing motion hardly moves: the neighbourhood of hinges, where parts overlap."""
    before = closed + 1e-4 * (opened - closed)
    speed = {}
    for link in surfaces.triangles.keys() & surfaces.moving:
        D = (surfaces.robot.fk(closed, link) - surfaces.robot.fk(before, link))[:3].T @ axis  # p ↦ p · D[:3] + D[3]
        speed[link] = (D[:3], float(D[3]))
    fastest = max(float(np.abs(surfaces.triangles[n] @ D + d).max()) for n, (D, d) in speed.items())
    kept = {n: _beyond(t, *speed[n], SLOW * fastest) if n in speed else t for n, t in surfaces.triangles.items()}
    return Surfaces(surfaces.robot, {n: t for n, t in kept.items() if len(t)}, surfaces.moving)


def _beyond(triangles: Array, D: Array, d: float, limit: float) -> Array:
    """The part of ``triangles (T, 3, 3)`` where |p · D + d| > *limit*; triangles across the border are divided."""
    done = []
    for _ in range(6):
        speed = np.abs(triangles @ D + d) > limit
        done.append(triangles[speed.all(axis=1)])
        a, b, c = np.moveaxis(triangles[speed.any(axis=1) & ~speed.all(axis=1)], 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.concatenate(done)


def _axes_with(x: Array) -> Array:
    """A rotation whose first row is *x*; the others lie near the axes of the hand frame."""
    helper = np.eye(3)[int(np.argmin(np.abs(x)))]
    y = helper - x * (x @ helper)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)])


def _gap_on_lines(
    surfaces: Surfaces, q: Array, R: Array, front: frozenset[str], back: frozenset[str], cell: float
) -> tuple[Grid, Array, Array, Array]:
    """The grid, the gap on each line (inf where not both are met), and the two faces that bound it."""
    a, b = surfaces.placed(q, front, R), surfaces.placed(q, back, R)
    low = np.maximum(a[:, :, 1:].min(axis=(0, 1)), b[:, :, 1:].min(axis=(0, 1)))
    high = np.minimum(a[:, :, 1:].max(axis=(0, 1)), b[:, :, 1:].max(axis=(0, 1)))
    if (high - low < cell).any():
        empty = np.full((1, 1), np.inf)
        return Grid.over(low, low + cell, cell), empty, empty, empty
    grid = Grid.over(low, high, cell)
    face_a, _ = extent_along_lines(a, grid)
    _, face_b = extent_along_lines(b, grid)
    with np.errstate(invalid="ignore"):
        gap = np.where(np.isfinite(face_a) & np.isfinite(face_b), face_a - face_b, np.inf)
    return grid, gap, face_a, face_b


def _first_touch(
    surfaces: Surfaces, opened: Array, closed: Array, R: Array, front: frozenset[str], back: frozenset[str]
) -> float:
    """How far from *opened* to *closed* (0 to 1) the jaws can go until they touch; 0 if they never close."""

    def gap(s: float) -> float:
        q = opened + s * (closed - opened)
        return float(_gap_on_lines(surfaces, q, R, front, back, 1.5e-3)[1].min())

    steps = np.linspace(0.0, 1.0, 17)
    gaps = np.array([gap(s) for s in steps])
    usable = np.isfinite(gaps)
    if not usable.any() or not (gaps[usable] > 1e-4).any():
        return 0.0
    start = int(np.argmax(np.where(usable, gaps, -np.inf)))
    touching = [k for k in range(start, len(steps)) if gaps[k] <= 0.0]
    if not touching:
        return 1.0 if usable[-1] and gaps[-1] < gaps[start] - 1e-4 else 0.0
    if touching[0] == 0:
        return 0.0
    low, high = float(steps[touching[0] - 1]), float(steps[touching[0]])
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    return low


def _pads(surfaces: Surfaces, q: Array, R: Array, front: frozenset[str], back: frozenset[str]) -> Patch | None:
    """Where the gap is smallest; or, where fingers meet at their bases first, the larger faces beyond."""
    lines = _gap_on_lines(surfaces, q, R, front, back, 0.5e-3)
    grid, gap = lines[0], lines[1]
    if not np.isfinite(gap).any():
        return None
    mask = largest_patch(gap <= gap.min() + PAD_TOLERANCE)
    patch = _patch(surfaces, q, R, (front, back), lines, mask)
    y, z = grid.centres()
    distal = np.tensordot(R[1:] @ approach(surfaces, q, R, patch), np.stack([y, z]), axes=1)
    beyond = np.isfinite(gap) & (distal > distal[mask].max())
    if beyond.any():
        further = largest_patch(beyond & (gap <= gap[beyond].min() + PAD_TOLERANCE))
        if further.sum() > 2 * mask.sum():
            return _patch(surfaces, q, R, (front, back), lines, further)
    return patch


def _patch(
    surfaces: Surfaces,
    q: Array,
    R: Array,
    groups: tuple[frozenset[str], frozenset[str]],
    lines: tuple[Grid, Array, Array, Array],
    mask: BoolArray,
) -> Patch:
    """The pads on the *lines* chosen by *mask*: middle, extents, and the links that most lines end on."""
    grid, _, *faces = lines
    y, z = grid.centres()
    low = np.array([y[mask].min(), z[mask].min()]) - 0.5 * grid.cell
    high = np.array([y[mask].max(), z[mask].max()]) + 0.5 * grid.cell
    middle = 0.5 * (low + high)
    nearest = np.argmin(np.where(mask, (y - middle[0]) ** 2 + (z - middle[1]) ** 2, np.inf))
    links, centres = [], []
    for side, (face, group) in enumerate(zip(faces, groups, strict=True)):
        hits = {}
        for link in group:
            own = extent_along_lines(surfaces.placed(q, {link}, R), grid)[side]
            hits[link] = int((np.abs(own[mask] - face[mask]) < 1e-6).sum())
        links.append(max(hits, key=lambda n: hits[n]))
        centres.append([float(face.ravel()[nearest]), *middle])
    poses = [surfaces.robot.fk(q, link) for link in links]
    points = [T[:3, :3].T @ (R.T @ c - T[:3, 3]) for T, c in zip(poses, centres, strict=True)]
    return Patch(np.array(centres), low, high, (links[0], links[1]), np.array(points))
