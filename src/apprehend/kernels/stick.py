"""How the velocities of two touching bodies would part if no joint accelerated: a correction of friction rows."""

from __future__ import annotations

from ._jit import kernel


@kernel
def correct(position, frame, first, second, origin, velocity, acceleration, start, slow, reference):  # type: ignore[no-untyped-def]
    """Take half of the tangential bias acceleration out of ``reference[start : start + 2]`` of every sticking contact.

    ``position (K, 3)``, ``frame (K, 9)`` (rows normal, tangent, tangent), bodies ``first (K)`` and ``second (K)`` with
    ``origin (M, 3)`` and ``velocity``, ``acceleration (M, 6)``, angular part first, in world axes. Contacts that slide
    faster than *slow* are left alone.
    """
    for k in range(position.shape[0]):
        dv0 = dv1 = dv2 = da0 = da1 = da2 = 0.0
        for side in range(2):
            b = first[k] if side == 0 else second[k]
            sign = -1.0 if side == 0 else 1.0
            rx, ry, rz = position[k, 0] - origin[b, 0], position[k, 1] - origin[b, 1], position[k, 2] - origin[b, 2]
            wx, wy, wz = velocity[b, 0], velocity[b, 1], velocity[b, 2]
            ax, ay, az = acceleration[b, 0], acceleration[b, 1], acceleration[b, 2]
            sx, sy, sz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
            dv0 += sign * (velocity[b, 3] + sx)
            dv1 += sign * (velocity[b, 4] + sy)
            dv2 += sign * (velocity[b, 5] + sz)
            da0 += sign * (acceleration[b, 3] + ay * rz - az * ry + wy * sz - wz * sy)
            da1 += sign * (acceleration[b, 4] + az * rx - ax * rz + wz * sx - wx * sz)
            da2 += sign * (acceleration[b, 5] + ax * ry - ay * rx + wx * sy - wy * sx)
        if dv0 * dv0 + dv1 * dv1 + dv2 * dv2 > slow * slow:
            continue
        for j in range(2):
            f = frame[k, 3 + 3 * j], frame[k, 4 + 3 * j], frame[k, 5 + 3 * j]
            reference[start[k] + j] -= 0.5 * (f[0] * da0 + f[1] * da1 + f[2] * da2)
