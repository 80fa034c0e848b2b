"""Penetration depth of two convex cores that overlap: a polytope inside their difference grows towards its boundary.

The depth is the length of the shortest translation that separates. Every direction gives an upper bound (the support
of the difference along it), the nearest face of the polytope a lower one; the answer carries both (van den Bergen's
expanding polytope). Shapes and ``ws`` as in `gjk`.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .gjk import AXIS, BARY, NEAR, ROWS, difference, nearest_on_triangle

MAX_POINTS = 260
MAX_FACES = 1024
MAX_TURNS = 1000
FLAT = 1e-12
SIDES = 4  # directions from which the depth of a round shape is searched anew, at most

NORMAL = 0  # columns of a face: outward unit normal and distance from the origin, its corners, an edge of the rim
CORNER = 4
EDGE = 7


@kernel(fast=False)
def pair_scratch():
    """Scratch ``ws`` of one thread, see `gjk`."""
    return np.zeros((ROWS, 12))


@kernel(fast=False)
def depth_scratch():
    """Scratch ``big`` of one thread: rows of the polytope's points, then of its faces."""
    return np.empty((MAX_POINTS + MAX_FACES, 9))


@kernel(fast=False, borrow=True)
def put_face(P, F, f, i, j, k, inner):
    """Face *f* of the polytope, wound so that its normal points away from *inner*; False for a sliver."""
    ux, uy, uz = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1], P[j, 2] - P[i, 2]
    vx, vy, vz = P[k, 0] - P[i, 0], P[k, 1] - P[i, 1], P[k, 2] - P[i, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    norm = math.sqrt(x * x + y * y + z * z)
    reach = math.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
    F[f, CORNER], F[f, CORNER + 1], F[f, CORNER + 2] = i, j, k
    if norm <= 1e-13 * reach or norm == 0.0:
        F[f, 0], F[f, 1], F[f, 2], F[f, 3] = 0.0, 0.0, 0.0, 1e300
        return False
    x, y, z = x / norm, y / norm, z / norm
    d = x * P[i, 0] + y * P[i, 1] + z * P[i, 2]
    if x * inner[0] + y * inner[1] + z * inner[2] > d:
        x, y, z, d = -x, -y, -z, -d
        F[f, CORNER + 1], F[f, CORNER + 2] = k, j
    F[f, 0], F[f, 1], F[f, 2], F[f, 3] = x, y, z, d
    return True


@kernel(fast=False, borrow=True)
def away_from_line(P, axis, out):
    """Two unit vectors across the line through points 0 and 1, into ``out`` (6,)."""
    ex, ey, ez = P[1, 0] - P[0, 0], P[1, 1] - P[0, 1], P[1, 2] - P[0, 2]
    norm = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / norm, ey / norm, ez / norm
    if abs(ex) <= abs(ey) and abs(ex) <= abs(ez):
        x, y, z = 0.0, ez, -ey
    elif abs(ey) <= abs(ez):
        x, y, z = -ez, 0.0, ex
    else:
        x, y, z = ey, -ex, 0.0
    norm = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / norm, y / norm, z / norm
    out[0], out[1], out[2] = x, y, z
    out[3], out[4], out[5] = ey * z - ez * y, ez * x - ex * z, ex * y - ey * x


@kernel(fast=False, borrow=True)
def tetrahedron(ints, floats, points, graph, a, b, ws, P, n, across):
    """Extend the *n* rows of ``P``, which span a simplex that holds the origin, to a tetrahedron.

    Returns 4, or a smaller number when the difference is flat; ``ws[AXIS]`` is then a direction without extent.
    """
    normal = ws[AXIS]
    fine = floats[a, 7] + floats[b, 7]
    for i in range(n):
        fine = max(fine, abs(P[i, 3]) + abs(P[i, 4]) + abs(P[i, 5]))
    fine *= FLAT
    if n == 1:
        for trial in range(6):
            s = 1.0 if trial % 2 == 0 else -1.0
            c = trial // 2
            x, y, z = (s if c == 0 else 0.0), (s if c == 1 else 0.0), (s if c == 2 else 0.0)
            difference(ints, floats, points, graph, a, b, x, y, z, ws, P[1])
            gap = abs(P[1, 0] - P[0, 0]) + abs(P[1, 1] - P[0, 1]) + abs(P[1, 2] - P[0, 2])
            if gap > fine:
                n = 2
                break
        if n == 1:
            normal[0], normal[1], normal[2] = 0.0, 0.0, 1.0
            return 1
    if n == 2:
        away_from_line(P, 0, across)
        for trial in range(8):
            turn = trial * 0.7853981633974483
            c, s = math.cos(turn), math.sin(turn)
            x = c * across[0] + s * across[3]
            y = c * across[1] + s * across[4]
            z = c * across[2] + s * across[5]
            difference(ints, floats, points, graph, a, b, x, y, z, ws, P[2])
            gap = 0.0
            for k in range(2):
                h = 0.0
                for i in range(3):
                    h += across[3 * k + i] * (P[2, i] - P[0, i])
                gap = max(gap, abs(h))
            if gap > fine:
                n = 3
                break
        if n == 2:
            normal[0], normal[1], normal[2] = across[0], across[1], across[2]
            return 2
    if n == 3:
        ux, uy, uz = P[1, 0] - P[0, 0], P[1, 1] - P[0, 1], P[1, 2] - P[0, 2]
        vx, vy, vz = P[2, 0] - P[0, 0], P[2, 1] - P[0, 1], P[2, 2] - P[0, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        norm = math.sqrt(x * x + y * y + z * z)
        x, y, z = x / norm, y / norm, z / norm
        for trial in range(2):
            s = 1.0 if trial == 0 else -1.0
            difference(ints, floats, points, graph, a, b, s * x, s * y, s * z, ws, P[3])
            gap = abs(x * (P[3, 0] - P[0, 0]) + y * (P[3, 1] - P[0, 1]) + z * (P[3, 2] - P[0, 2]))
            if gap > fine:
                return 4
        normal[0], normal[1], normal[2] = x, y, z
        return 3
    return 4


@kernel(fast=False, borrow=True)
def depth(ints, floats, points, graph, a, b, ws, n, big):
    """Penetration depth of the cores, given the simplex of *n* rows of ``ws`` around the origin.

    Returns it, and whether a face of the polytope proves it. ``ws[AXIS]`` is the unit direction in which a must move by
    the depth to come free of b (in the frame of a); ``ws[NEAR]`` holds the deepest points.
    """
    P, F, axis = big[:MAX_POINTS], big[MAX_POINTS:], ws[AXIS]
    for i in range(n):
        for c in range(9):
            P[i, c] = ws[i, c]
    dim = tetrahedron(ints, floats, points, graph, a, b, ws, P, n, ws[4])
    if dim < 4:  # flat: the nearest points stay what they are, and the plane may pass the origin at a distance
        gap = axis[0] * P[0, 0] + axis[1] * P[0, 1] + axis[2] * P[0, 2]
        if gap < 0.0:
            axis[0], axis[1], axis[2] = -axis[0], -axis[1], -axis[2]
        return -abs(gap), abs(gap) <= FLAT * (floats[a, 7] + floats[b, 7])
    inner = ws[4]
    for c in range(3):
        inner[c] = 0.25 * (P[0, c] + P[1, c] + P[2, c] + P[3, c])
    size = 0.0
    for i in range(4):
        put_face(P, F, i, (i + 1) % 4, (i + 2) % 4, (i + 3) % 4, inner)
        size = max(size, abs(P[i, 0]) + abs(P[i, 1]) + abs(P[i, 2]))
    faces, count = 4, 4
    best, low = 1e300, 0.0
    while True:
        near = 0
        for f in range(1, faces):
            if F[f, 3] < F[near, 3]:
                near = f
        x, y, z, low = F[near, 0], F[near, 1], F[near, 2], max(F[near, 3], 0.0)
        if count == MAX_POINTS or low >= best:
            break
        w = P[count]
        difference(ints, floats, points, graph, a, b, x, y, z, ws, w)
        h = x * w[0] + y * w[1] + z * w[2]
        if h < best:
            best = h  # below zero: they do not overlap after all
            axis[0], axis[1], axis[2] = -x, -y, -z
        if h - F[near, 3] <= 1e-13 * size + 1e-10 * abs(h) or best - low <= 1e-10 * best + 1e-13 * size:
            break
        faces, sound = cut_away(P, F, faces, near, count, 1e-14 * size, inner)
        if not sound:
            break
        count += 1
    deepest(P, F, faces, best, ws)
    if best - low <= 1e-9 * best + 1e-13 * size:
        return best, True
    best = polish(ints, floats, points, graph, a, b, ws, P[0], best)
    return other_sides(ints, floats, points, graph, a, b, ws, F, faces, P[0], best), False


@kernel(fast=False, borrow=True)
def other_sides(ints, floats, points, graph, a, b, ws, F, faces, row, best):
    """As `polish` from faces that look elsewhere and may be less deep: there are several in shapes around one centre."""
    axis, kept, tried = ws[AXIS], ws[4], ws[5 : 5 + SIDES]
    for turn in range(SIDES):
        for c in range(3):
            tried[turn, c] = kept[c] = axis[c]
        near, low = -1, 1e300
        for f in range(faces):
            x, y, z = F[f, 0], F[f, 1], F[f, 2]
            new = F[f, 3] < best * (1.0 - 1e-12)
            for i in range(turn + 1):
                new = new and x * tried[i, 0] + y * tried[i, 1] + z * tried[i, 2] > -0.9
            if new:
                difference(ints, floats, points, graph, a, b, x, y, z, ws, row)
                h = x * row[0] + y * row[1] + z * row[2]
                if h < low:
                    near, low = f, h
        if near < 0:
            break
        for c in range(3):
            axis[c] = -F[near, c]
        low = polish(ints, floats, points, graph, a, b, ws, row, low)
        if low < best:
            best = low
        else:
            for c in range(3):
                tried[turn, c], axis[c] = axis[c], kept[c]
    return best


@kernel(fast=False, borrow=True)
def polish(ints, floats, points, graph, a, b, ws, row, best):
    """The least depth along a direction near ``ws[AXIS]``, which follows: a search along shrinking crosses.

    For round shapes: the polytope has too few points for faces that are curved in two directions at once.
    """
    axis = ws[AXIS]
    step = 0.02
    for _ in range(MAX_TURNS):
        if step < 1e-10:
            break
        ux, uy, uz = axis[1], -axis[0], 0.0
        if abs(axis[2]) > 0.7:
            ux, uy, uz = 0.0, axis[2], -axis[1]
        norm = math.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux / norm, uy / norm, uz / norm
        vx, vy, vz = axis[1] * uz - axis[2] * uy, axis[2] * ux - axis[0] * uz, axis[0] * uy - axis[1] * ux
        moved = False
        for trial in range(8):
            turn = trial * 0.7853981633974483
            c, s = step * math.cos(turn), step * math.sin(turn)
            x, y, z = axis[0] + c * ux + s * vx, axis[1] + c * uy + s * vy, axis[2] + c * uz + s * vz
            norm = math.sqrt(x * x + y * y + z * z)
            x, y, z = x / norm, y / norm, z / norm
            difference(ints, floats, points, graph, a, b, -x, -y, -z, ws, row)
            h = -(x * row[0] + y * row[1] + z * row[2])
            if h < best:
                best = h  # below zero: a plane between them, the cores do not overlap
                axis[0], axis[1], axis[2] = x, y, z
                moved = True
                break
        if not moved:
            step *= 0.5
    return best


@kernel(fast=False, borrow=True)
def cut_away(P, F, faces, near, new, slack, inner):
    """Replace the faces that see point *new* (*near* among them) by faces from their rim to it.

    The rim are the edges that only one of them has. Returns the number of faces, and whether the polytope is sound.
    """
    x, y, z = P[new, 0], P[new, 1], P[new, 2]
    rims, alive = 0, 0
    for f in range(faces):
        if F[f, 0] * x + F[f, 1] * y + F[f, 2] * z > F[f, 3] + slack or f == near:
            for c in range(3):
                i, j = F[f, CORNER + c], F[f, CORNER + (c + 1) % 3]
                found = -1
                for e in range(rims):
                    if F[e, EDGE] == j and F[e, EDGE + 1] == i:
                        found = e
                if found >= 0:
                    rims -= 1
                    F[found, EDGE], F[found, EDGE + 1] = F[rims, EDGE], F[rims, EDGE + 1]
                elif rims < MAX_FACES:
                    F[rims, EDGE], F[rims, EDGE + 1] = i, j
                    rims += 1
        else:
            if alive != f:
                for c in range(7):
                    F[alive, c] = F[f, c]
            alive += 1
    if rims < 3 or alive + rims > MAX_FACES:
        return alive, False
    sound = True
    for e in range(rims):
        if not put_face(P, F, alive + e, int(F[e, EDGE]), int(F[e, EDGE + 1]), new, inner):
            sound = False
    return alive + rims, sound


@kernel(fast=False, borrow=True)
def deepest(P, F, faces, height, ws):
    """Points of a and b whose difference comes nearest to ``−height · axis`` on the polytope, into ``ws[NEAR]``."""
    axis, bary = ws[AXIS], ws[BARY]
    tx, ty, tz = -axis[0] * height, -axis[1] * height, -axis[2] * height
    best = 1e300
    for f in range(faces):
        plane = F[f, 0] * tx + F[f, 1] * ty + F[f, 2] * tz - F[f, 3]
        if plane * plane >= best:
            continue
        for k in range(3):
            row = P[int(F[f, CORNER + k])]
            ws[k, 0], ws[k, 1], ws[k, 2] = row[0] - tx, row[1] - ty, row[2] - tz
            for c in range(3, 9):
                ws[k, c] = row[c]
        d = nearest_on_triangle(ws, 0, 1, 2, bary)
        if d < best:
            best = d
            for c in range(6):
                ws[NEAR, c] = bary[0] * ws[0, 3 + c] + bary[1] * ws[1, 3 + c] + bary[2] * ws[2, 3 + c]
