"""The least value of a sampled distance field on a convex shape: branch and bound, with both bounds.

A field is a block of ``grids``: a header of `HEADER` numbers (spacing, numbers of nodes along x, y, z, a Lipschitz
constant), then the values, the last axis fastest. Its frame lies in the middle of the grid. Between nodes it is
interpolated trilinearly. Beyond the grid, with p the nearest point of the grid, it is √(|x − p|² + d(p)²), which is
never more than the distance to a solid within the grid.

Boxes are bounded from below by the Lipschitz constant and, where they are small, by a plane under the nodes' values:
its least value on the box, on the shape (one support point), and where the box meets a half-space that holds the shape.
So a flat shape on a flat field is settled at once, and one on a round field soon.
"""

from __future__ import annotations

import math

from ._jit import kernel
from .gjk import AXIS, BEST, KEEP, NEAR, REL, SPARE, gjk, support, witnesses

HEADER = 8
BLOCK = 4.0
"""Half side, in cells, from which on boxes are bounded by planes."""

STACK = 400  # rows of the stack of boxes

SHARE = 0.005
"""Values are sought to this share of themselves, if that is more than the given tolerance."""

FAR = 0.02
"""The same beyond the grid."""

ROOT3 = 1.7320508075688772


@kernel(fast=False, borrow=True)
def grid_value(grids, start, x, y, z, out):
    """The field at (x, y, z), counted in cells from node 0; its slope per cell into ``out (3,)``."""
    nx, ny, nz = int(grids[start + 1]), int(grids[start + 2]), int(grids[start + 3])
    px, py, pz = min(max(x, 0.0), nx - 1.0), min(max(y, 0.0), ny - 1.0), min(max(z, 0.0), nz - 1.0)
    i, j, k = min(int(px), nx - 2), min(int(py), ny - 2), min(int(pz), nz - 2)
    u, v, w = px - i, py - j, pz - k
    p = start + HEADER + (i * ny + j) * nz + k
    r, s = nz, ny * nz
    d00, d01 = grids[p + 1] - grids[p], grids[p + r + 1] - grids[p + r]
    d10, d11 = grids[p + s + 1] - grids[p + s], grids[p + s + r + 1] - grids[p + s + r]
    c00, c01 = grids[p] + w * d00, grids[p + r] + w * d01
    c10, c11 = grids[p + s] + w * d10, grids[p + s + r] + w * d11
    low, high = c00 + v * (c01 - c00), c10 + v * (c11 - c10)
    e0, e1 = d00 + v * (d01 - d00), d10 + v * (d11 - d10)
    out[0], out[1], out[2] = high - low, (1.0 - u) * (c01 - c00) + u * (c11 - c10), e0 + u * (e1 - e0)
    value = low + u * (high - low)
    px, py, pz = x - px, y - py, z - pz
    away = px * px + py * py + pz * pz
    if away == 0.0:
        return value
    h2 = grids[start] ** 2
    far = math.sqrt(away * h2 + value * value)
    out[0] = (value * out[0] if px == 0.0 else px * h2) / far
    out[1] = (value * out[1] if py == 0.0 else py * h2) / far
    out[2] = (value * out[2] if pz == 0.0 else pz * h2) / far
    return far


@kernel(fast=False, borrow=True)
def field_at(grids, start, x, y, z):
    """A lower bound on the field at a point of its frame: from the nearest node and the Lipschitz constant."""
    h = grids[start]
    nx, ny, nz = grids[start + 1], grids[start + 2], grids[start + 3]
    u, v, w = x / h + 0.5 * (nx - 1.0), y / h + 0.5 * (ny - 1.0), z / h + 0.5 * (nz - 1.0)
    i = min(max(int(u + 0.5), 0), int(nx) - 1)
    j = min(max(int(v + 0.5), 0), int(ny) - 1)
    k = min(max(int(w + 0.5), 0), int(nz) - 1)
    value = grids[start + HEADER + (i * int(ny) + j) * int(nz) + k]
    away = h * math.sqrt((u - i) ** 2 + (v - j) ** 2 + (w - k) ** 2)
    x, y, z = max(-u, u - nx + 1.0, 0.0), max(-v, v - ny + 1.0, 0.0), max(-w, w - nz + 1.0, 0.0)
    return max(value - grids[start + 4] * away, h * math.sqrt(x * x + y * y + z * z) if x + y + z > 0.0 else -1e300)


@kernel(fast=False, borrow=True)
def plane_under(grids, start, x, y, z, half, plane, scratch):
    """A plane ``plane[0:3] · (p − (x, y, z)) + plane[3]`` that lies under the field on a box; ``plane[4]``: its least value.

    The box has half a side of *half* cells about (x, y, z): a whole number of cells, or a part of one.
    """
    steps = max(1, int(2.0 * half + 0.5))
    width = 2.0 * half / steps
    g0, g1, g2, least = 0.0, 0.0, 0.0, 1e300
    for i in range(2):
        for j in range(2):
            for k in range(2):
                sx, sy, sz = 2.0 * i - 1.0, 2.0 * j - 1.0, 2.0 * k - 1.0
                f = grid_value(grids, start, x + sx * half, y + sy * half, z + sz * half, scratch)
                g0 += sx * f
                g1 += sy * f
                g2 += sz * f
    g0, g1, g2 = g0 / (8.0 * half), g1 / (8.0 * half), g2 / (8.0 * half)
    under = 1e300
    ny, nz = int(grids[start + 2]), int(grids[start + 3])
    whole = half >= 0.5
    for i in range(steps + 1):
        dx = i * width - half
        for j in range(steps + 1):
            dy = j * width - half
            for k in range(steps + 1):
                dz = k * width - half
                if whole:
                    node = (int(x + dx + 0.5) * ny + int(y + dy + 0.5)) * nz + int(z + dz + 0.5)
                    f = grids[start + HEADER + node]
                else:
                    f = grid_value(grids, start, x + dx, y + dy, z + dz, scratch)
                least = min(least, f)
                under = min(under, f - (g0 * dx + g1 * dy + g2 * dz))
    plane[0], plane[1], plane[2], plane[3], plane[4] = g0, g1, g2, under, least


@kernel(fast=False, borrow=True)
def try_point(grids, start, ws, px, py, pz, best, scratch):
    """Evaluate the field at a point of the shape, given in its frame; the better of it and *best* is kept in ``ws``."""
    keep = ws[KEEP]
    h = grids[start]
    x, y, z = px - keep[9], py - keep[10], pz - keep[11]
    u = (keep[0] * x + keep[3] * y + keep[6] * z) / h + 0.5 * (grids[start + 1] - 1.0)
    v = (keep[1] * x + keep[4] * y + keep[7] * z) / h + 0.5 * (grids[start + 2] - 1.0)
    w = (keep[2] * x + keep[5] * y + keep[8] * z) / h + 0.5 * (grids[start + 3] - 1.0)
    f = grid_value(grids, start, u, v, w, scratch)
    if f >= best:
        return best
    row = ws[BEST]
    row[0], row[1], row[2] = px, py, pz
    gx, gy, gz = scratch[0], scratch[1], scratch[2]
    row[3] = keep[0] * gx + keep[1] * gy + keep[2] * gz
    row[4] = keep[3] * gx + keep[4] * gy + keep[5] * gz
    row[5] = keep[6] * gx + keep[7] * gy + keep[8] * gz
    return f


@kernel(fast=False, borrow=True)
def root_box(ints, floats, points, graph, grids, start, a, ws, box, stack):
    """Bounds ``box (6,)`` of the core of *a* along the axes of the grid, in cells; the first box of the search."""
    keep, h = ws[KEEP], grids[start]
    most = 0.0
    for c in range(3):
        dx, dy, dz = keep[c], keep[3 + c], keep[6 + c]
        shift = keep[9] * dx + keep[10] * dy + keep[11] * dz
        middle = 0.5 * (grids[start + 1 + c] - 1.0)
        x, y, z, _ = support(ints, floats, points, graph, a, -dx, -dy, -dz, 0.0)
        box[c] = (dx * x + dy * y + dz * z - shift) / h + middle
        x, y, z, _ = support(ints, floats, points, graph, a, dx, dy, dz, 0.0)
        box[3 + c] = (dx * x + dy * y + dz * z - shift) / h + middle
        most = max(most, box[3 + c] - math.floor(box[c]))
    half = BLOCK
    while 2.0 * half < most:
        half *= 2.0
    stack[0, 0], stack[0, 4] = -1e300, half
    for c in range(3):
        stack[0, 1 + c] = math.floor(box[c]) + half


@kernel(fast=False, borrow=True)
def in_grid(grids, start, x, y, z, half):
    """Whether a box lies wholly between the first and the last nodes."""
    if x < half or y < half or z < half:
        return False
    return (
        x + half <= grids[start + 1] - 1.0 and y + half <= grids[start + 2] - 1.0 and z + half <= grids[start + 3] - 1.0
    )


@kernel(fast=False, borrow=True)
def plane_bound(ints, floats, points, graph, a, h, half, lower, upper, ws):
    """The least value on a box and the core of *a* of the plane under the field in that box.

    The middle of the box is ``ws[SPARE + 3, 0:3]``, at a distance between *lower* and *upper* along ``ws[AXIS]``; the
    point of the core that is lowest on the plane goes into ``ws[SPARE + 3, 3:6]``.
    """
    keep, plane, at, point = ws[KEEP], ws[SPARE + 1], ws[SPARE + 3], ints.shape[0] - 1
    gx = (keep[0] * plane[0] + keep[1] * plane[1] + keep[2] * plane[2]) / h
    gy = (keep[3] * plane[0] + keep[4] * plane[1] + keep[5] * plane[2]) / h
    gz = (keep[6] * plane[0] + keep[7] * plane[1] + keep[8] * plane[2]) / h
    px, py, pz, _ = support(ints, floats, points, graph, a, -gx, -gy, -gz, 0.0)
    at[3], at[4], at[5] = px, py, pz
    on_shape = gx * (px - at[0]) + gy * (py - at[1]) + gz * (pz - at[2])
    in_box = -(abs(plane[0]) + abs(plane[1]) + abs(plane[2])) * half
    bound = max(plane[4], plane[3] + max(on_shape, in_box))
    steepest = math.sqrt(gx * gx + gy * gy + gz * gz)
    shift = 0.0
    if upper == 0.0 and steepest > 0.0:  # the middle is inside: look for a half-space from below the box
        shift = 2.0 * ROOT3 * half * h / steepest
        ws[REL, 9], ws[REL, 10], ws[REL, 11] = at[0] - shift * gx, at[1] - shift * gy, at[2] - shift * gz
        _, lower, upper = gjk(ints, floats, points, graph, a, point, ws, 1e300, 0.0, 1e-6)
    if upper > 0.0:
        vx, vy, vz = ws[AXIS, 0] / upper, ws[AXIS, 1] / upper, ws[AXIS, 2] / upper
        along = gx * vx + gy * vy + gz * vz
        if along > 0.0:
            rest = 0.0
            for c in range(3):
                e = keep[c] * (gx - along * vx) + keep[3 + c] * (gy - along * vy)
                rest += abs(e + keep[6 + c] * (gz - along * vz))
            bound = max(bound, plane[3] + along * (lower - shift * along) - rest * half * h)
    return bound


@kernel(fast=False, borrow=True)
def field_gap(ints, floats, points, graph, grids, a, b, ws, above, below, tolerance, stack):
    """Bounds on the least value of field *b* on shape *a*; ``ws[REL]`` holds the pose of b in a.

    Stops where the value is known to be above *above*, or at most *below*, or within *tolerance* (or a share
    of itself). ``ws[NEAR]`` receives the witnesses and ``ws[AXIS]`` the slope of the field there, in the frame
    of a. ``stack`` is (STACK, 6).
    """
    start = ints[b, 1]
    h, steep, grown = grids[start], ROOT3 * grids[start] * grids[start + 4], floats[a, 3]
    above += grown
    below += grown
    point = ints.shape[0] - 1
    keep, scratch, plane, box, at = ws[KEEP], ws[SPARE], ws[SPARE + 1], ws[SPARE + 2], ws[SPARE + 3]
    for c in range(12):
        keep[c] = ws[REL, c]
    for c in range(9):
        ws[REL, c] = 1.0 if c % 4 == 0 else 0.0
    root_box(ints, floats, points, graph, grids, start, a, ws, box, stack)
    best, low = 1e300, 1e300
    top = 1
    while top:
        top -= 1
        bound, x, y, z, half = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3], stack[top, 4]
        if x + half < box[0] or y + half < box[1] or z + half < box[2]:
            continue
        if x - half > box[3] or y - half > box[4] or z - half > box[5]:
            continue
        whole = in_grid(grids, start, x, y, z, half)
        share = SHARE if whole else FAR
        slack = tolerance if best > 1e9 else max(tolerance, share * abs(best))
        bound = max(bound, grid_value(grids, start, x, y, z, scratch) - steep * half)
        if bound > above or bound >= best - slack:
            low = min(low, bound)
            continue
        # the nearest point of the shape: does the box reach it at all?
        to_shape(keep, grids, start, x, y, z, at)
        ws[REL, 9], ws[REL, 10], ws[REL, 11] = at[0], at[1], at[2]
        for c in range(5):
            ws[AXIS, c] = 0.0
        rows, lower, upper = gjk(ints, floats, points, graph, a, point, ws, 1e300, 0.0, 1e-6)
        if upper > 0.0:
            wide = 0.0
            for c in range(3):
                wide += abs(keep[c] * ws[AXIS, 0] + keep[3 + c] * ws[AXIS, 1] + keep[6 + c] * ws[AXIS, 2])
            if lower > wide / upper * half * h * (1.0 + 1e-9):
                continue
            witnesses(ws, rows)
            best = try_point(grids, start, ws, ws[NEAR, 0], ws[NEAR, 1], ws[NEAR, 2], best, scratch)
        else:
            best = try_point(grids, start, ws, at[0], at[1], at[2], best, scratch)
        if whole and half <= BLOCK:
            plane_under(grids, start, x, y, z, half, plane, scratch)
            under = plane_bound(ints, floats, points, graph, a, h, half, lower, upper, ws)
            bound = max(bound, under)
            best = try_point(grids, start, ws, at[3], at[4], at[5], best, scratch)
        if best <= below:
            low = min(low, best)
            break
        slack = max(tolerance, share * abs(best))
        if bound > above or bound >= best - slack or steep * half <= 0.5 * tolerance:
            low = min(low, bound)
            continue
        top = split_box(grids, start, stack, top, bound, x, y, z, 0.5 * half, scratch)
    keep_witness(ws, best, grown)
    return min(low, best) - grown, best - grown


@kernel(fast=False, borrow=True)
def to_shape(keep, grids, start, u, v, w, out):
    """A place in cells as a point in the frame of the shape."""
    h = grids[start]
    x = h * (u - 0.5 * (grids[start + 1] - 1.0))
    y = h * (v - 0.5 * (grids[start + 2] - 1.0))
    z = h * (w - 0.5 * (grids[start + 3] - 1.0))
    for i in range(3):
        out[i] = keep[3 * i] * x + keep[3 * i + 1] * y + keep[3 * i + 2] * z + keep[9 + i]


@kernel(fast=False, borrow=True)
def split_box(grids, start, stack, top, bound, x, y, z, half, scratch):
    """Push the eight parts of a box, the lowest last; returns the new top."""
    first = top
    for c in range(8):
        cx = x + (half if c & 1 else -half)
        cy = y + (half if c & 2 else -half)
        cz = z + (half if c & 4 else -half)
        f = grid_value(grids, start, cx, cy, cz, scratch)
        k = top
        while k > first and stack[k - 1, 5] < f:
            for i in range(6):
                stack[k, i] = stack[k - 1, i]
            k -= 1
        stack[k, 0], stack[k, 1], stack[k, 2], stack[k, 3], stack[k, 4], stack[k, 5] = bound, cx, cy, cz, half, f
        top += 1
    return top


@kernel(fast=False, borrow=True)
def keep_witness(ws, best, grown):
    """Move the best point found into ``ws[NEAR]`` and ``ws[AXIS]`` and restore ``ws[REL]``."""
    row = ws[BEST]
    norm = math.sqrt(row[3] ** 2 + row[4] ** 2 + row[5] ** 2)
    for c in range(3):
        n = row[3 + c] / norm if norm > 1e-12 else (1.0 if c == 2 else 0.0)
        ws[AXIS, c] = n
        ws[NEAR, c] = row[c] - grown * n
        ws[NEAR, 3 + c] = row[c] - best * n
    for c in range(12):
        ws[REL, c] = ws[KEEP, c]
