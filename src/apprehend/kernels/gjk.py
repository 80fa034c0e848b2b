"""Distance between two convex shapes: the algorithm of Gilbert, Johnson and Keerthi, one pair at a time.

Compiled without reordering of operations: the last bits decide whether a thin simplex still makes progress.

A shape is a convex core, grown by a radius: a sphere is a grown point, a capsule a grown segment. The shapes of a
model are rows of

=========== ===========  ========================================================================================
``ints``    (G, 4)       kind, first vertex, number of vertices, free for the caller
``floats``  (G, 23)      0:3 half extents (box), radius and half length (cylinder, cone: tip at +half length), or
                         radii (ellipsoid); 3 growing radius; 4:7 and 7 centre and radius of a bounding sphere, in
                         the frame of the carrier; 8:20 pose of the shape in the frame of its carrier (rotation
                         row-major, translation); 20:23 half extents of the box around the shape, in its own frame
``points``  (V, 3)       vertices of all hulls, in the frames of their shapes
``graph``   (V+1+E,)     entries k and k + 1 bound the part of ``graph`` that holds the neighbours of vertex k on its
                         hull, counted within the shape
=========== ===========  ========================================================================================

Everything happens in the frame of the first shape. The scratch ``ws`` (ROWS, 12) holds the simplex in its first nine
rows (w = a − b, a, b; the last four are the step before) and the rows named below. The last four kinds are for
`obstacle`: no core is their second shape.
"""

from __future__ import annotations

import math

from ._jit import kernel

HULL = 0
BOX = 1
CYLINDER = 2
CONE = 3
ELLIPSOID = 4
HALF_SPACE = 5  # below z = 0 of its frame
FIELD = 6  # ``ints[:, 1]``: its place in ``grids``, see `grid_search`
CLOUD = 7  # ``ints[:, 1:3]``: first point, number of points; size[0:2]: first row in ``trees``, levels of the tree
TREE = 8  # the same for shapes: first row, number of rows

BARY = 9  # weights of the simplex' rows; 4:8 of the step before
AXIS = 10  # 0:3 direction, 3 and 4 the last vertices found on a and on b
REL = 11  # pose of the second shape in the first
NEAR = 12  # nearest points, 0:3 on the first and 3:6 on the second
PLACE_A = 13  # poses in the world
PLACE_B = 14
KEEP = 16  # pose of the second shape in the first, while ``ws[REL]`` holds that of a point
BEST = 17  # the best witness so far
SPARE = 18  # four rows for what is done with one pair
ROWS = 22

CLIMB_FROM = 24
"""Hulls with more vertices than this are climbed from neighbour to neighbour instead of searched."""

MAX_STEPS = 200
TINY = 1e-14
STALLS = 4  # steps that improve neither bound, at most
ROUNDED = 1.0 + 1e-15  # squared distances grow by less than this from one step to the next: no more than rounding


@kernel(fast=False, borrow=True)
def support(ints, floats, points, graph, g, dx, dy, dz, hint):
    """The point of the core of shape *g* that is farthest along (dx, dy, dz), and its vertex for the next hint."""
    kind = ints[g, 0]
    if kind == BOX:
        return math.copysign(floats[g, 0], dx), math.copysign(floats[g, 1], dy), math.copysign(floats[g, 2], dz), 0
    if kind == CYLINDER:
        across = math.sqrt(dx * dx + dy * dy)
        z = math.copysign(floats[g, 1], dz)
        if across < 1e-300:
            return floats[g, 0], 0.0, z, 0
        s = floats[g, 0] / across
        return s * dx, s * dy, z, 0
    if kind == ELLIPSOID:
        ax, ay, az = floats[g, 0] * dx, floats[g, 1] * dy, floats[g, 2] * dz
        norm = math.sqrt(ax * ax + ay * ay + az * az)
        if norm < 1e-300:
            return floats[g, 0], 0.0, 0.0, 0
        return floats[g, 0] * ax / norm, floats[g, 1] * ay / norm, floats[g, 2] * az / norm, 0
    if kind == CONE:
        across = math.sqrt(dx * dx + dy * dy)
        if 2.0 * floats[g, 1] * dz >= floats[g, 0] * across:
            return 0.0, 0.0, floats[g, 1], 0
        if across < 1e-300:
            return floats[g, 0], 0.0, -floats[g, 1], 0
        s = floats[g, 0] / across
        return s * dx, s * dy, -floats[g, 1], 0
    start, count = ints[g, 1], ints[g, 2]
    if count <= CLIMB_FROM:
        best = 0
        value = points[start, 0] * dx + points[start, 1] * dy + points[start, 2] * dz
        for i in range(1, count):
            v = points[start + i, 0] * dx + points[start + i, 1] * dy + points[start + i, 2] * dz
            if v > value:
                value = v
                best = i
    else:
        best = int(hint) if hint < count else 0
        k = start + best
        value = points[k, 0] * dx + points[k, 1] * dy + points[k, 2] * dz
        moved = True
        while moved:
            moved = False
            k = start + best
            for e in range(graph[k], graph[k + 1]):
                i = graph[e]
                v = points[start + i, 0] * dx + points[start + i, 1] * dy + points[start + i, 2] * dz
                if v > value:
                    value = v
                    best = i
                    moved = True
    k = start + best
    return points[k, 0], points[k, 1], points[k, 2], best


@kernel(fast=False, borrow=True)
def relative(A, B, out):
    """``out = inv(A) B`` for poses (12,)."""
    for i in range(3):
        a0, a1, a2 = A[i], A[3 + i], A[6 + i]
        for j in range(3):
            out[3 * i + j] = a0 * B[j] + a1 * B[3 + j] + a2 * B[6 + j]
        out[9 + i] = a0 * (B[9] - A[9]) + a1 * (B[10] - A[10]) + a2 * (B[11] - A[11])


@kernel(fast=False, borrow=True)
def compose(A, B, out):
    """``out = A B`` for poses (12,)."""
    for i in range(3):
        a0, a1, a2 = A[3 * i], A[3 * i + 1], A[3 * i + 2]
        for j in range(3):
            out[3 * i + j] = a0 * B[j] + a1 * B[3 + j] + a2 * B[6 + j]
        out[9 + i] = A[9 + i] + a0 * B[9] + a1 * B[10] + a2 * B[11]


@kernel(fast=False, borrow=True)
def difference(ints, floats, points, graph, a, b, dx, dy, dz, s, row):
    """Support of A − B along d, into ``row`` (w, a, b): a farthest along d, b farthest along −d."""
    rel = s[REL]
    ax, ay, az, vertex = support(ints, floats, points, graph, a, dx, dy, dz, s[AXIS, 3])
    s[AXIS, 3] = vertex
    ex = -(rel[0] * dx + rel[3] * dy + rel[6] * dz)
    ey = -(rel[1] * dx + rel[4] * dy + rel[7] * dz)
    ez = -(rel[2] * dx + rel[5] * dy + rel[8] * dz)
    x, y, z, vertex = support(ints, floats, points, graph, b, ex, ey, ez, s[AXIS, 4])
    s[AXIS, 4] = vertex
    bx = rel[0] * x + rel[1] * y + rel[2] * z + rel[9]
    by = rel[3] * x + rel[4] * y + rel[5] * z + rel[10]
    bz = rel[6] * x + rel[7] * y + rel[8] * z + rel[11]
    row[0], row[1], row[2] = ax - bx, ay - by, az - bz
    row[3], row[4], row[5] = ax, ay, az
    row[6], row[7], row[8] = bx, by, bz


@kernel(fast=False, borrow=True)
def nearest_on_segment(P, i, j, bary):
    """Barycentric coordinates of the point nearest to the origin on segment i-j of ``P``; its squared norm."""
    ax, ay, az = P[i, 0], P[i, 1], P[i, 2]
    ex, ey, ez = P[j, 0] - ax, P[j, 1] - ay, P[j, 2] - az
    ee = ex * ex + ey * ey + ez * ez
    t = 0.0
    if ee > 0.0:
        t = -(ax * ex + ay * ey + az * ez) / ee
        t = min(max(t, 0.0), 1.0)
    bary[i] = 1.0 - t
    bary[j] = t
    x, y, z = ax + t * ex, ay + t * ey, az + t * ez
    return x * x + y * y + z * z


@kernel(fast=False, borrow=True)
def nearest_on_triangle(P, i, j, k, bary):
    """As `nearest_on_segment` for the triangle i-j-k; slivers are answered by their edges."""
    ax, ay, az = P[i, 0], P[i, 1], P[i, 2]
    ux, uy, uz = P[j, 0] - ax, P[j, 1] - ay, P[j, 2] - az
    vx, vy, vz = P[k, 0] - ax, P[k, 1] - ay, P[k, 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    nn = nx * nx + ny * ny + nz * nz
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    ci, cj, ck = 0.0, 0.0, 0.0
    inner = 1e300
    if nn > 1e-26 * uu * vv:
        # coordinates of the projected origin: areas of the triangles that it makes with the edges
        qx, qy, qz = -ax, -ay, -az
        cj = ((qy * vz - qz * vy) * nx + (qz * vx - qx * vz) * ny + (qx * vy - qy * vx) * nz) / nn
        ck = ((uy * qz - uz * qy) * nx + (uz * qx - ux * qz) * ny + (ux * qy - uy * qx) * nz) / nn
        ci = 1.0 - cj - ck
        if ci >= 0.0 and cj >= 0.0 and ck >= 0.0:
            x, y, z = ax + cj * ux + ck * vx, ay + cj * uy + ck * vy, az + cj * uz + ck * vz
            inner = x * x + y * y + z * z
            if nn > 1e-12 * uu * vv:
                bary[i], bary[j], bary[k] = ci, cj, ck
                return inner
    best = nearest_on_segment(P, i, j, bary)
    bi, bj, bk = bary[i], bary[j], 0.0
    d = nearest_on_segment(P, j, k, bary)
    if d < best:
        best = d
        bi, bj, bk = 0.0, bary[j], bary[k]
    d = nearest_on_segment(P, k, i, bary)
    if d < best:
        best = d
        bi, bj, bk = bary[i], 0.0, bary[k]
    if inner < best:  # a sliver: its coordinates are uncertain, so that the edges compete
        best = inner
        bi, bj, bk = ci, cj, ck
    bary[i], bary[j], bary[k] = bi, bj, bk
    return best


@kernel(fast=False, borrow=True)
def side(P, i, j, k, o):
    """Signed volume with which the origin lies on the other side of face i-j-k than vertex o, relative; > 0: outside."""
    ax, ay, az = P[i, 0], P[i, 1], P[i, 2]
    ux, uy, uz = P[j, 0] - ax, P[j, 1] - ay, P[j, 2] - az
    vx, vy, vz = P[k, 0] - ax, P[k, 1] - ay, P[k, 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    to_o = nx * (P[o, 0] - ax) + ny * (P[o, 1] - ay) + nz * (P[o, 2] - az)
    to_0 = -(nx * ax + ny * ay + nz * az)
    scale = math.sqrt(nx * nx + ny * ny + nz * nz) * max(abs(ax) + abs(ay) + abs(az), 1e-300)
    if abs(to_o) <= 1e-13 * scale:
        return 1.0  # flat: every face is worth a look
    return -to_0 if to_o > 0.0 else to_0


@kernel(fast=False, borrow=True)
def reduce_simplex(ws, n, bary):
    """Nearest point to the origin on the simplex of rows ``0 … n − 1``: keep only the rows that carry it.

    Returns the number of rows kept and the squared distance; 4 and 0 when the origin lies inside a tetrahedron.
    """
    for i in range(4):
        bary[i] = 0.0
    best = 0.0
    if n == 1:
        bary[0] = 1.0
        best = ws[0, 0] ** 2 + ws[0, 1] ** 2 + ws[0, 2] ** 2
    elif n == 2:
        best = nearest_on_segment(ws, 0, 1, bary)
    elif n == 3:
        best = nearest_on_triangle(ws, 0, 1, 2, bary)
    else:
        inside = True
        best = 1e300
        c0, c1, c2, c3 = 0.0, 0.0, 0.0, 0.0
        for o in range(4):
            i, j, k = (o + 1) % 4, (o + 2) % 4, (o + 3) % 4
            if side(ws, i, j, k, o) < 0.0:
                continue
            inside = False
            bary[o] = 0.0
            d = nearest_on_triangle(ws, i, j, k, bary)
            if d < best:
                best = d
                c0, c1, c2, c3 = bary[0], bary[1], bary[2], bary[3]
        if inside:
            return 4, 0.0
        bary[0], bary[1], bary[2], bary[3] = c0, c1, c2, c3
    kept = 0
    for i in range(n):
        if bary[i] > 0.0:
            if kept != i:
                for c in range(9):
                    ws[kept, c] = ws[i, c]
                bary[kept] = bary[i]
            kept += 1
    return kept, best


@kernel(fast=False, borrow=True)
def gjk(ints, floats, points, graph, a, b, ws, above, below, relative_gap):
    """Distance of the cores of shapes *a* and *b*; ``ws[REL]`` holds the pose of b in a.

    Stops as soon as the distance is known to be above *above*, or at most *below*, or within a relative gap.
    Returns ``(rows, lower, upper)``: bounds on the distance (both 0 when the cores overlap), and the rows of ``ws``
    that carry the nearest points with weights ``ws[BARY]``. ``ws[AXIS]`` is the first direction tried and receives the
    best one, from b towards a in the frame of a, as long as *upper*. (The squared length of the nearest point settles
    to rounding long before its direction does: steps go on until *lower* has settled, too.)
    """
    rel, bary, axis = ws[REL], ws[BARY], ws[AXIS]
    vx, vy, vz = axis[0], axis[1], axis[2]
    if vx * vx + vy * vy + vz * vz < 1e-300:
        vx, vy, vz = -rel[9], -rel[10], -rel[11]
        if vx * vx + vy * vy + vz * vz < 1e-300:
            vx, vy, vz = 1.0, 0.0, 0.0
    difference(ints, floats, points, graph, a, b, -vx, -vy, -vz, ws, ws[0])
    norm = math.sqrt(vx * vx + vy * vy + vz * vz)
    lower = max(0.0, (vx * ws[0, 0] + vy * ws[0, 1] + vz * ws[0, 2]) / norm)
    if lower > above:
        return 0, lower, 1e300
    nx, ny, nz = vx, vy, vz  # the direction that lower belongs to
    bary[0] = 1.0
    n = 1
    vx, vy, vz = ws[0, 0], ws[0, 1], ws[0, 2]
    vv = vx * vx + vy * vy + vz * vz
    size = vv
    stalled = 0
    for _ in range(MAX_STEPS):
        upper = math.sqrt(vv)
        if vv <= TINY * TINY * size or upper <= below:
            break
        difference(ints, floats, points, graph, a, b, -vx, -vy, -vz, ws, ws[n])
        wx, wy, wz = ws[n, 0], ws[n, 1], ws[n, 2]
        now = (vx * wx + vy * wy + vz * wz) / upper
        if now > lower * (1.0 - 1e-14):  # of equals the last: it belongs to the points
            nx, ny, nz = vx, vy, vz
            if now > lower:
                lower = now
                stalled = 0
        if lower > above or upper - lower <= relative_gap * upper or stalled > STALLS:
            break
        repeated = False
        for i in range(n):
            if ws[i, 0] == wx and ws[i, 1] == wy and ws[i, 2] == wz:
                repeated = True
        if repeated:
            lower = upper if upper - lower <= 1e-13 * math.sqrt(size) else lower
            break
        size = max(size, wx * wx + wy * wy + wz * wz)
        for i in range(n):
            bary[4 + i] = bary[i]
            for c in range(9):
                ws[5 + i, c] = ws[i, c]
        rows, _ = reduce_simplex(ws, n + 1, bary)
        if rows == 4:
            axis[0], axis[1], axis[2] = vx, vy, vz
            return 4, 0.0, 0.0
        x, y, z = 0.0, 0.0, 0.0
        for i in range(rows):
            x += bary[i] * ws[i, 0]
            y += bary[i] * ws[i, 1]
            z += bary[i] * ws[i, 2]
        new = x * x + y * y + z * z
        if new >= vv:
            stalled += 1
            if new > vv * ROUNDED:  # the step before was the best
                for i in range(n):
                    bary[i] = bary[4 + i]
                    for c in range(9):
                        ws[i, c] = ws[5 + i, c]
                break
        n = rows
        vx, vy, vz, vv = x, y, z, new
    upper = math.sqrt(vv)
    if vv <= TINY * TINY * size:
        return n, 0.0, 0.0
    scale = upper / math.sqrt(nx * nx + ny * ny + nz * nz)
    axis[0], axis[1], axis[2] = scale * nx, scale * ny, scale * nz
    return n, min(lower, upper), upper


@kernel(fast=False, borrow=True)
def witnesses(ws, rows):
    """The nearest points of the cores, in the frame of the first shape."""
    bary = ws[BARY]
    for c in range(3):
        s, t = 0.0, 0.0
        for i in range(rows):
            s += bary[i] * ws[i, 3 + c]
            t += bary[i] * ws[i, 6 + c]
        ws[NEAR, c] = s
        ws[NEAR, 3 + c] = t
