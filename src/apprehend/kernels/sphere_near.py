"""Which of sixteen spheres on lanes are near a fixed shape, or near sixteen others.

Kinds of fixed shapes and their rows: `SphereModel.fixed` in `sphere`. ``flags`` has rows of lanes: hard hits, soft
hits, half widths of the pieces of a motion, and squared distances, which are scratch.
"""

from __future__ import annotations

import math

from ._jit import kernel
from .lanes import LANES

BOX = 0
CYLINDER = 1
HALF_SPACE = 2
GRID = 3


@kernel(inline=True)
def at(index, width):
    """First place of lane row ``width * index``; the sign is lost, so that the compiler sees it is not negative."""
    return (index & 0xFFFFFFF) * width * LANES


@kernel(borrow=True)
def near_fixed(fixed, o, points, k, radius, rate, resolution, flags, mark):
    """Whether sphere *k* of *points* with *radius* meets fixed shape *o*; returns whether any lane does.

    With *mark* the lanes are noted: hard hits without growth, soft hits grown by what *rate* moves in half a piece
    (nothing where that is less than *resolution*).
    """
    L = LANES
    t = at(k, 3)
    r0, r1, r2, r3, r4, r5 = fixed[o, 0], fixed[o, 1], fixed[o, 2], fixed[o, 3], fixed[o, 4], fixed[o, 5]
    r6, r7, r8, x, y, z = fixed[o, 6], fixed[o, 7], fixed[o, 8], fixed[o, 9], fixed[o, 10], fixed[o, 11]
    hx, hy, hz = fixed[o, 12], fixed[o, 13], fixed[o, 14]
    grown = radius + fixed[o, 15]
    box = fixed[o, 16] == 0.0
    total = 0.0
    for lane in range(L):
        px = points[t + lane] - x
        py = points[t + L + lane] - y
        pz = points[t + 2 * L + lane] - z
        u = r0 * px + r3 * py + r6 * pz
        v = r1 * px + r4 * py + r7 * pz
        w = r2 * px + r5 * py + r8 * pz
        dz = max(abs(w) - hz, 0.0)
        dx = max(abs(u) - hx, 0.0)
        dy = max(abs(v) - hy, 0.0)
        dr = max(math.sqrt(u * u + v * v) - hx, 0.0)
        d = dz * dz + (dx * dx + dy * dy if box else dr * dr)
        growth = rate * flags[2 * L + lane]
        soft = grown + (growth if growth > resolution else 0.0)
        s = 1.0 if d <= soft * soft else 0.0
        flags[3 * L + lane] = d
        total += s
    if mark and total > 0.0:
        mark_lanes(grown, rate, resolution, flags)
    return total > 0.0


@kernel(borrow=True)
def near_grid(model, o, points, k, radius, rate, resolution, flags, mark):
    """As `near_fixed`, for a half-space or a grid."""
    L = LANES
    fixed, cells = model.fixed, model.cells
    t = at(k, 3)
    r0, r1, r2, r3, r4, r5 = fixed[o, 0], fixed[o, 1], fixed[o, 2], fixed[o, 3], fixed[o, 4], fixed[o, 5]
    r6, r7, r8, x, y, z = fixed[o, 6], fixed[o, 7], fixed[o, 8], fixed[o, 9], fixed[o, 10], fixed[o, 11]
    scale, first = fixed[o, 12], int(fixed[o, 13])
    nx, ny, nz = model.shapes[o, 0], model.shapes[o, 1], model.shapes[o, 2]
    size = 1.0 / scale
    half_space = fixed[o, 16] == HALF_SPACE
    for lane in range(L):
        px = points[t + lane] - x
        py = points[t + L + lane] - y
        pz = points[t + 2 * L + lane] - z
        w = r2 * px + r5 * py + r8 * pz
        if half_space:
            flags[3 * L + lane] = max(w, 0.0) ** 2
        else:
            u = (r0 * px + r3 * py + r6 * pz) * scale
            v = (r1 * px + r4 * py + r7 * pz) * scale
            w = w * scale
            i = min(max(int(u), 0), nx - 1)
            j = min(max(int(v), 0), ny - 1)
            n = min(max(int(w), 0), nz - 1)
            u = max(max(-u, u - nx), 0.0) * size
            v = max(max(-v, v - ny), 0.0) * size
            w = max(max(-w, w - nz), 0.0) * size
            d = max(float(cells[first + (i * ny + j) * nz + n]), 0.0)
            flags[3 * L + lane] = d * d + u * u + v * v + w * w
    total = 0.0
    for lane in range(L):
        growth = rate * flags[2 * L + lane]
        soft = radius + (growth if growth > resolution else 0.0)
        total += 1.0 if flags[3 * L + lane] <= soft * soft else 0.0
    if mark and total > 0.0:
        mark_lanes(radius, rate, resolution, flags)
    return total > 0.0


@kernel(borrow=True)
def mark_lanes(radius, rate, resolution, flags):
    """Note hard and soft hits of the squared distances in row 3 of *flags*."""
    L = LANES
    for lane in range(L):
        d = flags[3 * L + lane]
        growth = rate * flags[2 * L + lane]
        soft = radius + (growth if growth > resolution else 0.0)
        flags[lane] = max(flags[lane], 1.0 if d <= radius * radius else 0.0)
        flags[L + lane] = max(flags[L + lane], 1.0 if d <= soft * soft else 0.0)


@kernel(borrow=True)
def near_sphere(a, i, b, j, radius, rate, resolution, flags, mark):
    """As `near_fixed`, for sphere *i* of points *a* and sphere *j* of points *b* with the sum of their radii."""
    L = LANES
    s = at(i, 3)
    t = at(j, 3)
    total = 0.0
    for lane in range(L):
        x = a[s + lane] - b[t + lane]
        y = a[s + L + lane] - b[t + L + lane]
        z = a[s + 2 * L + lane] - b[t + 2 * L + lane]
        d = x * x + y * y + z * z
        growth = rate * flags[2 * L + lane]
        soft = radius + (growth if growth > resolution else 0.0)
        flags[3 * L + lane] = d
        total += 1.0 if d <= soft * soft else 0.0
    if mark and total > 0.0:
        mark_lanes(radius, rate, resolution, flags)
    return total > 0.0
