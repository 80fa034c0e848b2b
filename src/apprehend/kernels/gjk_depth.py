"""Penetration depth of two convex cores that overlap: a polytope inside their difference grows towards its boundary.

The depth is the length of the shortest translation that separates. Every direction gives an upper bound (the support
of the difference along it), the nearest face of the polytope a lower one; the answer carries both (van den Bergen's
expanding polytope). Shapes and ``ws`` as in `gjk`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .gjk import difference, gjk, witnesses

MAX_POINTS = 260
MAX_FACES = 1024
FLAT = 1e-12


class DepthSpace(NamedTuple):
    """Scratch of one thread."""

    points: np.ndarray  # (MAX_POINTS, 9)
    faces: np.ndarray  # (MAX_FACES, 3) int64
    planes: np.ndarray  # (MAX_FACES, 4): outward unit normal, distance from the origin
    edges: np.ndarray  # (MAX_FACES, 2) int64


class PairSpace(NamedTuple):
    """Scratch of one thread for whole queries of one pair at a time."""

    simplex: np.ndarray  # (9, 9)
    bary: np.ndarray  # (8,)
    axis: np.ndarray  # (3,)
    hints: np.ndarray  # (2,) int64
    rel: np.ndarray  # (12,)
    world: np.ndarray  # (2, 12)
    near: np.ndarray  # (2, 3)
    depth: DepthSpace


@kernel(fast=False)
def new_pair_space():
    """Fresh scratch."""
    depth = DepthSpace(
        np.empty((MAX_POINTS, 9)),
        np.empty((MAX_FACES, 3), np.int64),
        np.empty((MAX_FACES, 4)),
        np.empty((MAX_FACES, 2), np.int64),
    )
    return PairSpace(
        np.zeros((9, 9)),
        np.zeros(8),
        np.zeros(3),
        np.zeros(2, np.int64),
        np.zeros(12),
        np.zeros((2, 12)),
        np.zeros((2, 3)),
        depth,
    )


@kernel(fast=False)
def put_face(P, F, N, f, i, j, k, inner):
    """Face *f* of the polytope, wound so that its normal points away from *inner*; False for a sliver."""
    ux, uy, uz = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1], P[j, 2] - P[i, 2]
    vx, vy, vz = P[k, 0] - P[i, 0], P[k, 1] - P[i, 1], P[k, 2] - P[i, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    norm = math.sqrt(x * x + y * y + z * z)
    reach = math.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
    F[f, 0], F[f, 1], F[f, 2] = i, j, k
    if norm <= 1e-13 * reach or norm == 0.0:
        return False
    x, y, z = x / norm, y / norm, z / norm
    d = x * P[i, 0] + y * P[i, 1] + z * P[i, 2]
    if x * inner[0] + y * inner[1] + z * inner[2] > d:
        x, y, z, d = -x, -y, -z, -d
        F[f, 1], F[f, 2] = k, j
    N[f, 0], N[f, 1], N[f, 2], N[f, 3] = x, y, z, d
    return True


@kernel(fast=False)
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


@kernel(fast=False)
def tetrahedron(ints, floats, points, first, around, a, b, rel, P, n, hints, normal, across):
    """Extend the *n* rows of ``P``, which span a simplex that holds the origin, to a tetrahedron.

    Returns 4, or a smaller number when the difference is flat; ``normal`` (3,) is then a direction without extent.
    """
    size = 0.0
    for i in range(n):
        size = max(size, abs(P[i, 0]) + abs(P[i, 1]) + abs(P[i, 2]))
    if n == 1:
        for trial in range(6):
            s = 1.0 if trial % 2 == 0 else -1.0
            c = trial // 2
            x, y, z = (s if c == 0 else 0.0), (s if c == 1 else 0.0), (s if c == 2 else 0.0)
            difference(ints, floats, points, first, around, a, b, rel, x, y, z, P[1], hints)
            gap = abs(P[1, 0] - P[0, 0]) + abs(P[1, 1] - P[0, 1]) + abs(P[1, 2] - P[0, 2])
            if gap > FLAT * (1.0 + size):
                n = 2
                size = max(size, gap)
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
            difference(ints, floats, points, first, around, a, b, rel, x, y, z, P[2], hints)
            gap = 0.0
            for k in range(2):
                h = 0.0
                for i in range(3):
                    h += across[3 * k + i] * (P[2, i] - P[0, i])
                gap = max(gap, abs(h))
            if gap > FLAT * (1.0 + size):
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
            difference(ints, floats, points, first, around, a, b, rel, s * x, s * y, s * z, P[3], hints)
            gap = abs(x * (P[3, 0] - P[0, 0]) + y * (P[3, 1] - P[0, 1]) + z * (P[3, 2] - P[0, 2]))
            if gap > FLAT * (1.0 + size):
                return 4
        normal[0], normal[1], normal[2] = x, y, z
        return 3
    return 4


@kernel(fast=False)
def depth(ints, floats, points, first, around, a, b, rel, ws, n, hints, space, axis, pa, pb):
    """Penetration depth of the cores, given the simplex of *n* rows of ``ws`` around the origin.

    Returns ``(lower, upper)``. ``axis`` is the unit direction in which a must move by the depth to come free of b
    (in the frame of a); ``pa``, ``pb`` are the deepest points.
    """
    P, F, N, E = space.points, space.faces, space.planes, space.edges
    for i in range(n):
        for c in range(9):
            P[i, c] = ws[i, c]
    dim = tetrahedron(ints, floats, points, first, around, a, b, rel, P, n, hints, axis, ws[4])
    if dim < 4:
        return 0.0, 0.0  # flat: the nearest points stay what they are
    inner = ws[4]
    for c in range(3):
        inner[c] = 0.25 * (P[0, c] + P[1, c] + P[2, c] + P[3, c])
    faces = 0
    for o in range(4):
        put_face(P, F, N, faces, (o + 1) % 4, (o + 2) % 4, (o + 3) % 4, inner)
        faces += 1
    count = 4
    best = 1e300
    size = 0.0
    for i in range(4):
        size = max(size, abs(P[i, 0]) + abs(P[i, 1]) + abs(P[i, 2]))
    answer = 0
    low = 0.0
    si, sj, sk = F[0, 0], F[0, 1], F[0, 2]
    while True:
        near = 0
        for f in range(1, faces):
            if N[f, 3] < N[near, 3]:
                near = f
        x, y, z, low = N[near, 0], N[near, 1], N[near, 2], max(N[near, 3], 0.0)
        if count == MAX_POINTS or low >= best:
            break
        difference(ints, floats, points, first, around, a, b, rel, x, y, z, P[count], hints)
        w = P[count]
        h = x * w[0] + y * w[1] + z * w[2]
        if h < best:
            best = max(h, 0.0)
            axis[0], axis[1], axis[2] = -x, -y, -z
            si, sj, sk = F[near, 0], F[near, 1], F[near, 2]
            answer = 1
        if h - N[near, 3] <= 1e-13 * size + 1e-10 * abs(h) or best - low <= 1e-10 * best + 1e-13 * size:
            break
        # cut away the faces that see the new point; the edges seen from one side only make the rim
        rims = 0
        alive = 0
        overflow = False
        for f in range(faces):
            if N[f, 0] * w[0] + N[f, 1] * w[1] + N[f, 2] * w[2] > N[f, 3] + 1e-14 * size or f == near:
                for c in range(3):
                    i, j = F[f, c], F[f, (c + 1) % 3]
                    found = -1
                    for e in range(rims):
                        if E[e, 0] == j and E[e, 1] == i:
                            found = e
                    if found >= 0:
                        rims -= 1
                        E[found, 0], E[found, 1] = E[rims, 0], E[rims, 1]
                    elif rims < MAX_FACES:
                        E[rims, 0], E[rims, 1] = i, j
                        rims += 1
            else:
                if alive != f:
                    for c in range(3):
                        F[alive, c] = F[f, c]
                    for c in range(4):
                        N[alive, c] = N[f, c]
                alive += 1
        faces = alive
        if rims < 3 or faces + rims > MAX_FACES:
            break
        for e in range(rims):
            if not put_face(P, F, N, faces, E[e, 0], E[e, 1], count, inner):
                overflow = True
            faces += 1
        count += 1
        if overflow:
            break
    # the deepest points: where the line along the answer leaves the face that gave it
    deepest(P, si, sj, sk, axis, best, pa, pb)
    return min(low, best), best if answer == 1 else low


@kernel(fast=False)
def deepest(P, i, j, k, axis, height, pa, pb):
    """Points of a and b whose difference is nearest to ``−height · axis`` on triangle i-j-k."""
    ox, oy, oz = -axis[0] * height, -axis[1] * height, -axis[2] * height
    ux, uy, uz = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1], P[j, 2] - P[i, 2]
    vx, vy, vz = P[k, 0] - P[i, 0], P[k, 1] - P[i, 1], P[k, 2] - P[i, 2]
    qx, qy, qz = ox - P[i, 0], oy - P[i, 1], oz - P[i, 2]
    uu = ux * ux + uy * uy + uz * uz
    uv = ux * vx + uy * vy + uz * vz
    vv = vx * vx + vy * vy + vz * vz
    qu = qx * ux + qy * uy + qz * uz
    qv = qx * vx + qy * vy + qz * vz
    det = uu * vv - uv * uv
    s, t = 0.0, 0.0
    if det > 1e-26 * uu * vv:
        s = min(max((qu * vv - qv * uv) / det, 0.0), 1.0)
        t = min(max((qv * uu - qu * uv) / det, 0.0), 1.0 - s)
    for c in range(3):
        pa[c] = (1.0 - s - t) * P[i, 3 + c] + s * P[j, 3 + c] + t * P[k, 3 + c]
        pb[c] = (1.0 - s - t) * P[i, 6 + c] + s * P[j, 6 + c] + t * P[k, 6 + c]


@kernel(fast=False)
def signed_distance(ints, floats, points, first, around, a, b, rel, space):
    """Signed distance of shapes *a* and *b* (negative: depth), *rel* the pose of b in a.

    ``space.near`` receives the witness points on the surfaces and ``space.axis`` the unit normal from b to a, all in
    the frame of a.
    """
    axis, pa, pb = space.axis, space.near[0], space.near[1]
    rows, _, upper = gjk(
        ints, floats, points, first, around, a, b, rel, space.simplex, space.bary, axis, space.hints, 1e300, 0.0, 1e-13
    )
    ra, rb = floats[a, 3], floats[b, 3]
    if rows < 4:
        witnesses(space.simplex, space.bary, rows, pa, pb)
    if upper > 0.0:
        distance = upper
        for c in range(3):
            axis[c] /= upper
    else:
        _, upper = depth(
            ints, floats, points, first, around, a, b, rel, space.simplex, rows, space.hints, space.depth, axis, pa, pb
        )
        distance = -upper
    for c in range(3):
        pa[c] -= ra * axis[c]
        pb[c] += rb * axis[c]
    return distance - ra - rb
