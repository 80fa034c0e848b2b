"""Balls around points, and convex polytopes cut in two: what spheres that cover a shape are made of."""

from __future__ import annotations

import math

from ._jit import kernel

STEPS = 100

GROWN = 1e-9
"""Share by which a ball is enlarged, so that rounding leaves nothing out."""


@kernel(borrow=True)
def ball_around(points, out):
    """Centre and radius ``out (4,)`` of a ball around ``points (V, 3)``: the smallest but for about 1 %.

    Bădoiu & Clarkson 2003: the centre goes to the farthest point by less and less.
    """
    x, y, z = 0.0, 0.0, 0.0
    for axis in range(3):
        low, high = points[0, axis], points[0, axis]
        for i in range(points.shape[0]):
            low, high = min(low, points[i, axis]), max(high, points[i, axis])
        out[axis] = 0.5 * (low + high)
    x, y, z = out[0], out[1], out[2]
    best = 1e300
    for step in range(1, STEPS):
        far, most = 0, -1.0
        for i in range(points.shape[0]):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            d = dx * dx + dy * dy + dz * dz
            if d > most:
                far, most = i, d
        if most < best:
            best = most
            out[0], out[1], out[2] = x, y, z
        share = 1.0 / (step + 1.0)
        x += share * (points[far, 0] - x)
        y += share * (points[far, 1] - y)
        z += share * (points[far, 2] - z)
    out[3] = math.sqrt(best) * (1.0 + GROWN) + 1e-12


@kernel(borrow=True)
def round_order(points, first, count, axis, order, angles):
    """Put *count* of *points* from *first* on, in a plane across *axis*, into their order around their mean."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    mu, mv = 0.0, 0.0
    for i in range(first, first + count):
        mu += points[i, u] / count
        mv += points[i, v] / count
    for i in range(first, first + count):
        angle = math.atan2(points[i, v] - mv, points[i, u] - mu)
        k = i - first
        while k > 0 and angles[k - 1] > angle:
            angles[k], order[k] = angles[k - 1], order[k - 1]
            k -= 1
        angles[k], order[k] = angle, i


@kernel(borrow=True)
def half_of(points, edges, axis, place, sign, number, order, angles, out, sides):
    """Corners *out* and edges *sides* of what lies below (*sign* 1) or above (−1) a plane across *axis*: how many.

    Corners in the plane and where edges cross it are those of the section, whose sides are edges, too. Room is needed
    for V + E corners and 2 E + V edges. (A segment or a polygon is a polytope, too.)
    """
    V, E = points.shape[0], edges.shape[0]
    count, m = 0, 0
    for both in range(2):  # what lies beside the plane first, then what lies in it
        for i in range(V):
            d = sign * (points[i, axis] - place)
            if (d < 0.0 and both == 0) or (d == 0.0 and both == 1):
                for c in range(3):
                    out[count, c] = points[i, c]
                number[i] = count
                count += 1
            elif d > 0.0:
                number[i] = -1
        if both == 0:
            first = count
    for e in range(E):
        a, b = edges[e, 0], edges[e, 1]
        da, db = points[a, axis] - place, points[b, axis] - place
        if da * db < 0.0:
            t = da / (da - db)
            for c in range(3):
                out[count, c] = points[a, c] + t * (points[b, c] - points[a, c])
            out[count, axis] = place
            sides[m, 0], sides[m, 1] = max(number[a], number[b]), count
            count += 1
            m += 1
        elif number[a] >= 0 and number[b] >= 0:
            sides[m, 0], sides[m, 1] = number[a], number[b]
            m += 1
    section = count - first
    round_order(out, first, section, axis, order, angles)
    for k in range(section if section > 2 else section - 1):
        sides[m, 0], sides[m, 1] = order[k], order[(k + 1) % section]
        m += 1
    return count, m
