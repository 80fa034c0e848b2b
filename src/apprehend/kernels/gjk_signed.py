"""Signed distance of two convex shapes with witnesses: `gjk` apart, `gjk_depth` where they overlap, both made sure.

Shapes and ``ws`` as in `gjk`.
"""

from __future__ import annotations

import math

from ._jit import kernel
from .gjk import AXIS, NEAR, REL, SPARE, difference, gjk, witnesses
from .gjk_depth import depth

SURE = 1e-13
"""A distance is settled until its bounds differ by no more than this share of it, or a hundredth of it of the size."""

CLOSE = 1e-8
"""Below this share of the size the plane that the nearest points make is tried before it is believed."""

SETTLE = 8  # steps, at most
SETTLE_DEEP = 40  # the same where they overlap


@kernel(fast=False, borrow=True)
def farther(ints, floats, points, graph, a, b, ws, ux, uy, uz, lower, row):
    """The best direction on the way from ``ws[SPARE, 3:6]`` to u, whose plane has gap *lower*, and on in longer steps.

    Where the depth hardly changes from direction to direction a single step is short.
    """
    fromx, fromy, fromz = ws[SPARE, 3], ws[SPARE, 4], ws[SPARE, 5]
    dx, dy, dz = ux - fromx, uy - fromy, uz - fromz
    step = 1.0
    for _ in range(30):
        x, y, z = ux + step * dx, uy + step * dy, uz + step * dz
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < 1e-3:
            break
        x, y, z = x / norm, y / norm, z / norm
        difference(ints, floats, points, graph, a, b, -x, -y, -z, ws, row)
        gap = x * row[0] + y * row[1] + z * row[2]
        if gap <= lower:
            break
        lower = gap
        ux, uy, uz = x, y, z
        step *= 2.0
    return ux, uy, uz


@kernel(fast=False, borrow=True)
def settle(ints, floats, points, graph, a, b, ws, distance):
    """Signed distance of cores that are about *distance* apart: nearly touching, overlapping, or round where nearest.

    The second shape is moved away along the normal (unit, ``ws[AXIS]``) to where the nearest points are well
    conditioned; their normal is the next one, and the way shrinks (the proximal point method for the support function
    of the difference). Every normal is a lower bound of the signed distance, and where they are apart every pair of
    points an upper one. ``ws[NEAR]`` and ``ws[AXIS]`` become those where normal and points agree best.
    """
    rel, axis, near = ws[REL], ws[AXIS], ws[NEAR]
    normal, place, row, kept = ws[SPARE], ws[SPARE + 1], ws[SPARE + 2], ws[SPARE + 3]
    size = floats[a, 7] + floats[b, 7]
    fine = SURE * max(abs(distance), 0.01 * size)
    for c in range(3):
        normal[c] = normal[3 + c] = axis[c]
        place[c] = rel[9 + c]
    for c in range(6):
        kept[c] = near[c]
    answer, least, away = distance, 1e300, 0.02 * size
    for _ in range(SETTLE if distance > 0.0 else SETTLE_DEEP):
        nx, ny, nz = normal[3], normal[4], normal[5]
        shift = away + max(-answer, 0.0)
        rel[9], rel[10], rel[11] = place[0] - shift * nx, place[1] - shift * ny, place[2] - shift * nz
        axis[0], axis[1], axis[2] = nx, ny, nz
        rows, _, upper = gjk(ints, floats, points, graph, a, b, ws, 1e300, 0.0, 1e-15)
        rel[9], rel[10], rel[11] = place[0], place[1], place[2]
        if upper == 0.0:
            break
        px, py, pz = axis[0] - shift * nx, axis[1] - shift * ny, axis[2] - shift * nz
        ux, uy, uz = axis[0] / upper, axis[1] / upper, axis[2] / upper
        difference(ints, floats, points, graph, a, b, -ux, -uy, -uz, ws, row)
        lower = ux * row[0] + uy * row[1] + uz * row[2]
        reach = math.sqrt(px * px + py * py + pz * pz)
        error = abs(px - lower * ux) + abs(py - lower * uy) + abs(pz - lower * uz)
        if (error < least and (distance > 0.0 or lower >= answer - fine)) or lower > answer + fine:
            least = error
            held = lower > 0.0 and reach - lower <= 1e-10 * size  # else the plane is what is known
            beyond = lower <= -reach and error >= reach and distance >= 0.0
            answer = reach if held or beyond else lower
            witnesses(ws, rows)
            for c in range(3):
                normal[c] = axis[c] / upper
                kept[c], kept[3 + c] = near[c], near[3 + c] + shift * normal[3 + c]
        if reach - abs(lower) <= fine:
            break
        if distance <= 0.0:
            ux, uy, uz = farther(ints, floats, points, graph, a, b, ws, ux, uy, uz, lower, row)
        normal[3], normal[4], normal[5] = ux, uy, uz
        away = max(0.1 * away, -1e-6 * answer)
    for c in range(3):
        axis[c] = normal[c]
    for c in range(6):
        near[c] = kept[c]
    return answer


@kernel(fast=False, borrow=True)
def signed_distance(ints, floats, points, graph, a, b, ws, big):
    """Signed distance of shapes *a* and *b* (negative: depth); ``ws[REL]`` holds the pose of b in a.

    ``ws[NEAR]`` receives the witness points on the surfaces and ``ws[AXIS]`` the unit normal from b to a, all in the
    frame of a.
    """
    rows, lower, upper = gjk(ints, floats, points, graph, a, b, ws, 1e300, 0.0, 1e-15)
    if rows < 4:
        witnesses(ws, rows)
    size = floats[a, 7] + floats[b, 7]
    apart = lower > 0.0
    if apart:
        distance = upper
        for c in range(3):
            ws[AXIS, c] /= upper
        sure = upper - lower <= SURE * max(upper, 0.01 * size)
        if upper < CLOSE * size:  # rounding may have turned the plane between them
            x, y, z = ws[AXIS, 0], ws[AXIS, 1], ws[AXIS, 2]
            row = ws[SPARE]
            difference(ints, floats, points, graph, a, b, -x, -y, -z, ws, row)
            sure = apart = upper - (x * row[0] + y * row[1] + z * row[2]) <= SURE * size
    if not apart:  # no plane between them that holds: the "depth" may be below zero, too
        upper, sure = depth(ints, floats, points, graph, a, b, ws, rows, big)
        distance = -upper
    if not sure:
        distance = settle(ints, floats, points, graph, a, b, ws, distance)
    ra, rb = floats[a, 3], floats[b, 3]
    for c in range(3):
        ws[NEAR, c] -= ra * ws[AXIS, c]
        ws[NEAR, 3 + c] += rb * ws[AXIS, c]
    return distance - ra - rb
