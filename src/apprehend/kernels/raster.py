"""A software rasteriser: triangles into depth, face and barycentric buffers, and the light on what is seen.

Triangles are rasterised in homogeneous screen coordinates p = (u w, v w, w) (Olano & Greer 1997): the three functions
e_i = (p_j × p_k) · (u, v, 1) are the barycentric coordinates up to a common factor, correct in perspective, and no
triangle has to be clipped at the camera's plane. A parallel projection has w = 1.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel

EMPTY = -1


@kernel
def rasterise(screen, depth, row0, row1, out_depth, out_face, out_bary):  # type: ignore[no-untyped-def]
    """Draw triangles into rows ``row0 ≤ v < row1``.

    ``screen (T, 3, 3)`` corners in homogeneous pixel coordinates, ``depth (T, 3)`` what is compared (smaller wins),
    ``out_depth (H, W)`` filled with inf, ``out_face (H, W)`` int32 filled with −1, ``out_bary (H, W, 2)``.
    """
    width = out_depth.shape[1]
    for t in range(screen.shape[0]):
        x0, y0, w0 = screen[t, 0, 0], screen[t, 0, 1], screen[t, 0, 2]
        x1, y1, w1 = screen[t, 1, 0], screen[t, 1, 1], screen[t, 1, 2]
        x2, y2, w2 = screen[t, 2, 0], screen[t, 2, 1], screen[t, 2, 2]
        if w0 <= 1e-9 and w1 <= 1e-9 and w2 <= 1e-9:
            continue
        left, right, top, bottom = 0, width, row0, row1
        if w0 > 1e-9 and w1 > 1e-9 and w2 > 1e-9:
            u0, u1, u2 = x0 / w0, x1 / w1, x2 / w2
            v0, v1, v2 = y0 / w0, y1 / w1, y2 / w2
            low_u, high_u = min(u0, u1, u2), max(u0, u1, u2)
            low_v, high_v = min(v0, v1, v2), max(v0, v1, v2)
            if high_u < 0.0 or low_u > width or high_v < row0 or low_v > row1:
                continue
            left = max(0, math.ceil(low_u - 0.5))
            right = min(width, math.floor(high_u - 0.5) + 1)
            top = max(row0, math.ceil(low_v - 0.5))
            bottom = min(row1, math.floor(high_v - 0.5) + 1)
            if left >= right or top >= bottom:
                continue
        # e_i = a_i u + b_i v + c_i
        a0, b0, c0 = y1 * w2 - w1 * y2, w1 * x2 - x1 * w2, x1 * y2 - y1 * x2
        a1, b1, c1 = y2 * w0 - w2 * y0, w2 * x0 - x2 * w0, x2 * y0 - y2 * x0
        a2, b2, c2 = y0 * w1 - w0 * y1, w0 * x1 - x0 * w1, x0 * y1 - y0 * x1
        det = x0 * a0 + y0 * b0 + w0 * c0
        if det == 0.0:
            continue
        s = 1.0 / det
        a0, b0, c0 = a0 * s, b0 * s, c0 * s
        a1, b1, c1 = a1 * s, b1 * s, c1 * s
        a2, b2, c2 = a2 * s, b2 * s, c2 * s
        z0, z1, z2 = depth[t, 0], depth[t, 1], depth[t, 2]
        for row in range(top, bottom):
            v = row + 0.5
            f0, f1, f2 = b0 * v + c0, b1 * v + c1, b2 * v + c2
            for column in range(left, right):
                u = column + 0.5
                e0 = a0 * u + f0
                e1 = a1 * u + f1
                e2 = a2 * u + f2
                if e0 < 0.0 or e1 < 0.0 or e2 < 0.0:
                    continue
                total = e0 + e1 + e2
                if total <= 0.0:
                    continue
                inverse = 1.0 / total
                z = (e0 * z0 + e1 * z1 + e2 * z2) * inverse
                if z < out_depth[row, column]:
                    out_depth[row, column] = z
                    out_face[row, column] = t
                    out_bary[row, column, 0] = e0 * inverse
                    out_bary[row, column, 1] = e1 * inverse


@kernel
def surface(face, bary, corners, normals, eye, row0, row1, out_point, out_normal):  # type: ignore[no-untyped-def]
    """World position and unit normal, turned to the eye, of every pixel that shows a face.

    ``corners, normals (T, 3, 3)`` per corner; ``eye (3,)``; ``out_point, out_normal (H, W, 3)``.
    """
    for row in range(row0, row1):
        for column in range(face.shape[1]):
            t = face[row, column]
            if t < 0:
                continue
            g0, g1 = bary[row, column, 0], bary[row, column, 1]
            g2 = 1.0 - g0 - g1
            size, toward = 0.0, 0.0
            for k in range(3):
                p = g0 * corners[t, 0, k] + g1 * corners[t, 1, k] + g2 * corners[t, 2, k]
                n = g0 * normals[t, 0, k] + g1 * normals[t, 1, k] + g2 * normals[t, 2, k]
                out_point[row, column, k] = p
                out_normal[row, column, k] = n
                size += n * n
                toward += n * (eye[k] - p)
            scale = 1.0 / math.sqrt(max(size, 1e-30))
            if toward < 0.0:
                scale = -scale
            for k in range(3):
                out_normal[row, column, k] *= scale


@kernel
def occlusion(depth, point, normal, focal, radius, spiral, row0, row1, out):  # type: ignore[no-untyped-def]
    """How much of the sky each visible point sees, from the buffers at reduced size: 1 open, 0 shut in.

    ``depth (h, w)``, ``point, normal (h, w, 3)`` float32; *focal* in these pixels; *radius* in m; ``spiral
    (turns, samples, 2)`` from `spirals`.
    """
    height, width = depth.shape
    samples = spiral.shape[1]
    for row in range(row0, row1):
        for column in range(width):
            out[row, column] = 1.0
            if not depth[row, column] < 1e30:
                continue
            px, py, pz = point[row, column, 0], point[row, column, 1], point[row, column, 2]
            nx, ny, nz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
            reach = min(focal * radius / depth[row, column], 0.25 * width)
            turn = (row % 3) * 3 + column % 3
            hidden = 0.0
            for i in range(samples):
                u = int(column + reach * spiral[turn, i, 0])
                v = int(row + reach * spiral[turn, i, 1])
                if u < 0 or v < 0 or u >= width or v >= height or not depth[v, u] < 1e30:
                    continue
                dx, dy, dz = point[v, u, 0] - px, point[v, u, 1] - py, point[v, u, 2] - pz
                distance2 = dx * dx + dy * dy + dz * dz
                lift = dx * nx + dy * ny + dz * nz
                if lift > 0.02 * radius and distance2 < radius * radius:
                    hidden += (1.0 - distance2 / (radius * radius)) * lift / math.sqrt(distance2)
            out[row, column] = 1.0 - min(1.0, 1.6 * hidden / samples)


@kernel
def spread(sky, small, depth, factor, radius, row0, row1, out):  # type: ignore[no-untyped-def]
    """`occlusion` at full size: the mean of the 3 × 3 reduced pixels around, of those at about the same depth."""
    height, width = sky.shape
    for row in range(row0, row1):
        for column in range(depth.shape[1]):
            z = depth[row, column]
            out[row, column] = 1.0
            if not z < 1e30:
                continue
            total, weight = 0.0, 0.0
            for i in range(-1, 2):
                for j in range(-1, 2):
                    v, u = row // factor + i, column // factor + j
                    if 0 <= u < width and 0 <= v < height and abs(small[v, u] - z) < 0.5 * radius:
                        total += sky[v, u]
                        weight += 1.0
            if weight > 0.0:
                out[row, column] = total / weight


@kernel(inline=True)
def _sunlit(light_depth, lu, lv, ld, soft, spiral, turn):  # type: ignore[no-untyped-def]
    """Share of the sun that is seen: four taps on the rim of the soft disc, and the rest only if these differ."""
    height, width = light_depth.shape
    lit = 0.0
    taps = spiral.shape[1]
    for i in range(taps):
        if i == 4 and (lit == 0.0 or lit == 4.0):
            return lit * 0.25
        k = taps - 1 - i
        u, v = int(lu + soft * spiral[turn, k, 0]), int(lv + soft * spiral[turn, k, 1])
        if u < 0 or v < 0 or u >= width or v >= height or light_depth[v, u] >= ld:
            lit += 1.0
    return lit / taps


@kernel
def shade(
    face,
    point,
    normal,
    open_sky,
    colour,
    gloss,
    eye,
    sun,
    light,
    light_depth,
    light_step,
    soft,
    spiral,
    row0,
    row1,
    out,
):  # type: ignore[no-untyped-def]
    """Light that leaves every visible point towards the eye, linear RGB.

    ``colour (T, 3)`` linear albedo per face, ``gloss (T,)``; *sun* unit vector to the light; *light* ``(3, 4)`` maps
    world points to pixel and depth of the shadow map ``light_depth``; *light_step* is the depth that counts as in
    front, *soft* the radius of the shadow's edge in its pixels, sampled along ``spiral (turns, taps, 2)``.
    """
    for row in range(row0, row1):
        for column in range(face.shape[1]):
            t = face[row, column]
            if t < 0:
                continue
            px, py, pz = point[row, column, 0], point[row, column, 1], point[row, column, 2]
            nx, ny, nz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
            facing = nx * sun[0] + ny * sun[1] + nz * sun[2]
            lit = 0.0
            if facing > 0.0:
                # start a little off the surface, more where the light grazes it
                off = light_step * (1.0 + 2.0 * (1.0 - facing))
                qx, qy, qz = px + off * nx, py + off * ny, pz + off * nz
                lu = light[0, 0] * qx + light[0, 1] * qy + light[0, 2] * qz + light[0, 3]
                lv = light[1, 0] * qx + light[1, 1] * qy + light[1, 2] * qz + light[1, 3]
                ld = light[2, 0] * qx + light[2, 1] * qy + light[2, 2] * qz + light[2, 3] - light_step
                lit = facing * _sunlit(light_depth, lu, lv, ld, soft, spiral, (row * 5 + column * 11) % spiral.shape[0])
            vx, vy, vz = eye[0] - px, eye[1] - py, eye[2] - pz
            scale = 1.0 / math.sqrt(max(vx * vx + vy * vy + vz * vz, 1e-30))
            vx, vy, vz = vx * scale, vy * scale, vz * scale
            hx, hy, hz = sun[0] + vx, sun[1] + vy, sun[2] + vz
            scale = 1.0 / math.sqrt(max(hx * hx + hy * hy + hz * hz, 1e-30))
            shine = max(0.0, (nx * hx + ny * hy + nz * hz) * scale)
            frontal = max(0.0, nx * vx + ny * vy + nz * vz)
            sky = 0.5 + 0.5 * nz
            ambient = (0.16 + 0.30 * sky) * open_sky[row, column]
            fill = 0.07 * frontal
            rim = (1.0 - frontal) * (1.0 - frontal)
            rim *= rim
            shine *= shine
            shine *= shine
            shine *= shine
            spot = shine * shine * shine * shine * shine  # cos⁴⁰
            specular = gloss[t] * (0.40 * lit * spot + 0.08 * sky * rim * open_sky[row, column])
            for k in range(3):
                warm = 1.05 - 0.05 * k  # the sun a little warm, the sky a little cool
                cool = 0.95 + 0.05 * k
                out[row, column, k] = colour[t, k] * (0.78 * lit * warm + ambient * cool + fill) + specular


@kernel
def average(image, factor, row0, row1, out):  # type: ignore[no-untyped-def]
    """Mean over blocks of *factor* × *factor* pixels: ``image (H f, W f, C)`` into rows of ``out (H, W, C)``."""
    share = 1.0 / (factor * factor)
    for row in range(row0, row1):
        for column in range(out.shape[1]):
            for k in range(out.shape[2]):
                total = 0.0
                for i in range(factor):
                    for j in range(factor):
                        total += image[row * factor + i, column * factor + j, k]
                out[row, column, k] = total * share


def spirals(turns: int, samples: int, power: float) -> np.ndarray:
    """Points ``(turns, samples, 2)`` of the unit disc on a golden spiral, each of the *turns* turned a little further.

    Neighbouring pixels use different turns, so that averaging pixels averages directions; *power* 0.5 covers the disc
    evenly, 1 favours its middle.
    """
    i = np.arange(samples)
    angle = 2.399963229728653 * i + 2.0 * np.pi * np.arange(turns)[:, None] / turns
    radius = ((i + 0.7) / samples) ** power
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def empty_buffers(height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, face and barycentric buffers in which nothing is drawn yet."""
    return (
        np.full((height, width), np.inf),
        np.full((height, width), EMPTY, dtype=np.int32),
        np.zeros((height, width, 2)),
    )
