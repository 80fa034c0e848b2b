"""Squared distances of sixteen spheres on lanes to a fixed shape, or to sixteen others, and which of them are near.

Kinds of fixed shapes and their rows: `SphereModel.fixed` in `sphere`. ``flags`` has rows of lanes: hard hits, soft
hits, and half widths of the pieces of a motion.
"""

from __future__ import annotations

from ._jit import kernel
from .lanes import LANES
from .vector import larger, load, magnitude, root, select, some, store

BOX = 0
CYLINDER = 1
HALF_SPACE = 2
GRID = 3


@kernel(inline=True)
def at(index, width):
    """First place of lane row ``width * index``; the sign is lost, so that the compiler sees it is not negative."""
    return (index & 0xFFFFFFF) * width * LANES


@kernel(borrow=True, splice=True)
def to_box(fixed, o, points, k):
    """Squared distances to the box of fixed shape *o*; the box around it if that is a cylinder."""
    t = at(k, 3)
    x = load(points, t) - fixed[o, 9]
    y = load(points, t + LANES) - fixed[o, 10]
    z = load(points, t + 2 * LANES) - fixed[o, 11]
    u = larger(magnitude(fixed[o, 0] * x + fixed[o, 3] * y + fixed[o, 6] * z) - fixed[o, 12], 0.0)
    v = larger(magnitude(fixed[o, 1] * x + fixed[o, 4] * y + fixed[o, 7] * z) - fixed[o, 13], 0.0)
    w = larger(magnitude(fixed[o, 2] * x + fixed[o, 5] * y + fixed[o, 8] * z) - fixed[o, 14], 0.0)
    return u * u + v * v + w * w


@kernel(borrow=True, splice=True)
def to_cylinder(fixed, o, points, k):
    """Squared distances to the cylinder of fixed shape *o*."""
    t = at(k, 3)
    x = load(points, t) - fixed[o, 9]
    y = load(points, t + LANES) - fixed[o, 10]
    z = load(points, t + 2 * LANES) - fixed[o, 11]
    u = fixed[o, 0] * x + fixed[o, 3] * y + fixed[o, 6] * z
    v = fixed[o, 1] * x + fixed[o, 4] * y + fixed[o, 7] * z
    r = larger(root(u * u + v * v) - fixed[o, 12], 0.0)
    w = larger(magnitude(fixed[o, 2] * x + fixed[o, 5] * y + fixed[o, 8] * z) - fixed[o, 14], 0.0)
    return r * r + w * w


@kernel(borrow=True)
def to_grid(model, o, points, k, out):
    """A bound for grid *o*: that of the nearest cell, and the distance to the grid; squares into row 3 of *out*."""
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
            out[3 * L + lane] = max(w, 0.0) ** 2
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
            out[3 * L + lane] = d * d + u * u + v * v + w * w


@kernel(borrow=True, splice=True)
def to_spheres(a, i, b, j):
    """Squared distances between the centres of sphere *i* of points *a* and sphere *j* of points *b*."""
    s, t = at(i, 3), at(j, 3)
    x = load(a, s) - load(b, t)
    y = load(a, s + LANES) - load(b, t + LANES)
    z = load(a, s + 2 * LANES) - load(b, t + 2 * LANES)
    return x * x + y * y + z * z


@kernel(borrow=True, splice=True)
def near(squared, radius, rate, resolution, flags):
    """Which squared distances are within *radius*, grown by what *rate* moves in half a piece.

    Growth of less than *resolution* does not count.
    """
    growth = rate * load(flags, 2 * LANES)
    soft = radius + select(growth > resolution, growth, 0.0)
    return squared <= soft * soft


@kernel(borrow=True, splice=True)
def mark_near(squared, radius, rate, resolution, flags):
    """Note the lanes that are `near`: hard hits without growth, soft hits with it. Whether there are any."""
    soft = near(squared, radius, rate, resolution, flags)
    if not some(soft):
        return False
    hard = squared <= radius * radius
    store(flags, 0, select(hard, 1.0, load(flags, 0)))
    store(flags, LANES, select(soft, 1.0, load(flags, LANES)))
    return True


@kernel(borrow=True, splice=True)
def near_node(model, own, k, o, rate, margin, resolution):
    """Whether the ball around node *k* may be near fixed shape *o* in any lane."""
    fixed, flags = model.fixed, own.flags
    radius = model.nodes[k, 3] + margin
    if fixed[o, 16] < HALF_SPACE:
        return some(near(to_box(fixed, o, own.balls, k), radius + fixed[o, 15], rate, resolution, flags))
    to_grid(model, o, own.balls, k, flags)
    return some(near(load(flags, 3 * LANES), radius, rate, resolution, flags))
