"""All branches of any arm of six revolute joints, up to sixteen: elimination and an eigenvalue problem.

The line of the last axis does not notice the last joint, so with p a point on it and l its direction

    exp(ξ₃θ₃) exp(ξ₄θ₄) exp(ξ₅θ₅) (p, l)₀ = exp(−ξ₂θ₂) exp(−ξ₁θ₁) T T₀⁻¹ (p, l)₀.

p, l, p·p, p·l, p × l and (p·p) l − 2 (p·l) p are fourteen functions, linear in the sine and cosine of every angle on
either side (Raghavan and Roth 1993). Their coefficients are found by evaluating them at three angles of each joint.
The eight products of joints 1 and 2 are eliminated; with x = tan(θ/2) of joints 4 and 5, and the six equations also
multiplied by x₄, twelve equations in the twelve powers x₄ᵃ x₅ᵇ are left, with a matrix that is quadratic in
x₃ = tan(θ₃/2): a 24 × 24 eigenvalue problem, whose real solutions are the candidates (Manocha and Canny 1994).
The first two angles then bring the line of the last axis from one side to the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..parallel import over_ranges

KEPT = 24
"""Candidates kept of every pose, doubles included; six revolute joints have up to 16 branches (Primrose 1986)."""
NEARLY_REAL = 1e-2
"""Imaginary part, over 1 + |x|, up to which an eigenvalue is tried: double roots split by the root of the rounding."""
BLOCK = 256
TRIALS = 24
"""Poses on which a pair of joints to eliminate is tried."""
GRAIN = 16
"""Smallest share of a batch that is worth a thread."""

_ANGLES = 2.0 * np.pi * np.arange(3) / 3.0
_SAMPLES = np.stack([np.ones(3), np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_FIT = np.linalg.inv(_SAMPLES)  # from values at the three angles to the coefficients of 1, cos, sin
_HALF = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 2.0, 0.0]])  # 1, cos, sin over (1 + x²): powers of x
_SHIFT = np.array([0.31, 1.27, -0.83, 0.59, -1.91, 0.0])  # turns of the axes, so that no usual pose is at θ = π


def rotations(h: Array, angle: Array) -> Array:
    """Rotations ``(..., 3, 3)`` about unit vectors ``h (..., 3)``."""
    K = np.zeros((*h.shape, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -h[..., 2], h[..., 1], -h[..., 0]
    K = K - np.swapaxes(K, -1, -2)
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    out: Array = np.eye(3) + s * K + (1.0 - c) * (K @ K)
    return out


def _wide(a: Array, ndim: int) -> Array:
    """``(N, 3)`` as ``(N, 1, …, 1, 3)``, for a batch of *ndim* dimensions."""
    return a.reshape(a.shape[0], *[1] * (ndim - 1), 3)


def _turned(h: Array, o: Array, angle: Array, p: Array, v: Array) -> tuple[Array, Array]:
    """Point and direction turned about the axes ``h, o (N, 3)`` by ``angle (N, ...)``."""
    h, o = _wide(h, angle.ndim), _wide(o, angle.ndim)
    R = rotations(np.broadcast_to(h, (*angle.shape, 3)), angle)
    return o + (R @ (p - o)[..., None])[..., 0], (R @ v[..., None])[..., 0]


def _fourteen(p: Array, v: Array) -> Array:
    """The functions ``(..., 14)`` of a point and a direction."""
    pp, pl = (p * p).sum(-1, keepdims=True), (p * v).sum(-1, keepdims=True)
    return np.concatenate([p, v, pp, pl, np.cross(p, v), pp * v - 2.0 * pl * p], axis=-1)


def _left(h: Array, o: Array) -> Array:
    """Coefficients ``(N, 14, 3, 3, 3)`` of joints 3, 4, 5, in 1, cos, sin of each."""
    grid = np.meshgrid(_ANGLES, _ANGLES, _ANGLES, indexing="ij")
    a, b, c = (np.broadcast_to(part, (len(h), 3, 3, 3)) for part in grid)
    p, v = _wide(o[:, 5], 4), _wide(h[:, 5], 4)
    for joint, angle in ((4, c), (3, b), (2, a)):
        p, v = _turned(h[:, joint], o[:, joint], angle + _SHIFT[joint], p, v)
    return np.asarray(np.einsum("nabce,ia,jb,kc->neijk", _fourteen(p, v), _FIT, _FIT, _FIT, optimize=True))


def _right(h: Array, o: Array, p: Array, v: Array) -> Array:
    """Coefficients ``(N, 14, 3, 3)`` of joints 1 and 2, for the line ``p, v (N, 3)`` that T T₀⁻¹ gives."""
    grid = np.meshgrid(_ANGLES, _ANGLES, indexing="ij")
    a, b = (np.broadcast_to(part, (len(h), 3, 3)) for part in grid)
    p, v = _wide(p, 3), _wide(v, 3)
    p, v = _turned(h[:, 0], o[:, 0], -(a + _SHIFT[0]), p, v)
    p, v = _turned(h[:, 1], o[:, 1], -(b + _SHIFT[1]), p, v)
    return np.asarray(np.einsum("nabe,ia,jb->neij", _fourteen(p, v), _FIT, _FIT, optimize=True))


def _eigen(E: Array) -> tuple[Any, Any]:
    """Roots x₃ ``(N, 24)`` and the powers ``(N, 24, 4, 3)`` of x₄, x₅ of the equations ``E (N, 6, 3, 3, 3)``."""
    P = np.einsum("neijk,ip,ja,kb->pneab", E, _HALF, _HALF, _HALF, optimize=True)
    count = E.shape[0]
    A = np.zeros((3, count, 12, 4, 3))
    A[:, :, :6, :3], A[:, :, 6:, 1:] = P, P
    B = A.reshape(3, count, 12, 12)
    B = B / np.linalg.norm(B, axis=(0, 3), keepdims=True)
    companion = np.zeros((count, 24, 24))
    companion[:, :12, 12:] = np.eye(12)
    U, s, Vt = np.linalg.svd(B[2])
    inverse = np.swapaxes(Vt, 1, 2) / np.maximum(s, 1e-14 * s[:, :1])[:, None] @ np.swapaxes(U, 1, 2)
    companion[:, 12:, :12], companion[:, 12:, 12:] = -inverse @ B[0], -inverse @ B[1]
    x, w = np.linalg.eig(companion)
    return x, np.swapaxes(w[:, :12], 1, 2).reshape(count, 24, 4, 3)


def _ratio(w: Any, axis: int) -> Array:
    """tan(θ/2) from its powers along *axis* of ``w (N, 24, 4, 3)``, from the pair that is largest."""
    low = np.take(w, range(w.shape[axis] - 1), axis)
    high = np.take(w, range(1, w.shape[axis]), axis)
    size = (np.abs(low) ** 2 + np.abs(high) ** 2).reshape(*w.shape[:2], -1)
    at = size.argmax(axis=-1)[..., None]
    a = np.take_along_axis(low.reshape(size.shape), at, -1)[..., 0]
    b = np.take_along_axis(high.reshape(size.shape), at, -1)[..., 0]
    cosine, sine = (np.abs(a) ** 2 - np.abs(b) ** 2), 2.0 * (b * np.conj(a)).real
    return np.asarray(np.arctan2(sine, cosine))


def first_pair(h: Array, o: Array, R0: Array) -> int:
    """The first joint of the pair to eliminate on an arm ``h (6, 3)``, ``o (7, 3)``, ``R0 (3, 3)``, found by trial.

    The arm and its target are a loop, in which joint 1 follows on joint 6: six pairs of neighbours. Pairs that neither
    meet nor are parallel come first. Where other axes are parallel or meet, some pairs leave singular equations, so
    the first pair is taken that finds the joint vectors back that made `TRIALS` poses, or the one that misses fewest.
    """
    skew = []
    for k in range(5):
        normal = np.cross(h[k], h[k + 1])
        sine = float(np.linalg.norm(normal))
        skew.append(sine > 0.05 and abs(normal @ (o[k + 1] - o[k])) > 1e-3 * sine * _length(o))
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (TRIALS, 6))
    poses = np.tile(np.eye(4), (TRIALS, 1, 1))
    R, p = np.broadcast_to(R0, (TRIALS, 3, 3)), np.broadcast_to(o[6], (TRIALS, 3))
    for joint in range(5, -1, -1):
        turn = rotations(np.broadcast_to(h[joint], (TRIALS, 3)), q[:, joint])
        R, p = turn @ R, o[joint] + (turn @ (p - o[joint])[..., None])[..., 0]
    poses[:, :3, :3], poses[:, :3, 3] = R, p
    best, fewest = 5, TRIALS + 1
    for k in sorted(range(6), key=lambda k: k < 5 and not skew[k]):
        theta, _ = _candidates(h[None], o[None], R0[None], k, poses)
        off = np.abs(np.sin(0.5 * (np.roll(theta, k, axis=2) - q[:, None]))).max(axis=2).min(axis=1)
        missed = int((off > 1e-3).sum())
        if missed < fewest:
            best, fewest = k, missed
        if not missed:
            break
    return best


def _length(o: Array) -> float:
    return max(float(np.linalg.norm(np.diff(o, axis=0), axis=1).max()), 1e-9)


def general_branches(h: Array, o: Array, R0: Array, poses: Array, pair: int) -> tuple[Array, IntArray]:
    """Candidates ``(N, KEPT, 6)`` and how many, for ``poses (N, 4, 4)``; to be refined and checked on the true arm.

    *pair*: see `first_pair`.

    Axes ``h (1 or N, 6, 3)``, points on them and the frame's origin ``o (1 or N, 7, 3)``, and the frame's rotation
    ``R0 (1 or N, 3, 3)``, all at zero.
    """
    x = np.zeros((len(poses), KEPT, 6))
    number = np.zeros(len(poses), dtype=np.int64)
    if not len(poses):
        return x, number

    def work(begin: int, end: int) -> None:
        for first in range(begin, end, BLOCK):
            part = slice(first, min(first + BLOCK, end))
            own = part if len(h) > 1 else slice(0, 1)
            theta, good = _candidates(h[own], o[own], R0[own], pair, poses[part])
            order = np.argsort(~good, axis=1, kind="stable")[:, :KEPT]
            x[part] = np.take_along_axis(np.roll(theta, pair, axis=2), order[..., None], axis=1)
            number[part] = np.minimum(good.sum(axis=1), KEPT)

    over_ranges(work, len(poses), GRAIN)
    return x, number


def _candidates(h: Array, o: Array, R0: Array, k: int, T: Array) -> tuple[Array, Any]:
    """Angles ``(N, 24, 6)`` of the loop that begins with joint k, and which of them are real.

    E₁ … E₆ = D, the product of the joints' motions, is E_(k+1) … E₆ E₁′ … E_k′ = D with the axes of E′ moved by D⁻¹.
    """
    count, scale = len(T), _length(o[0])
    points = (o - o[:, 2:3]) / scale
    R = T[:, :3, :3] @ np.swapaxes(R0, 1, 2)
    shift = (T[:, :3, 3] - o[:, 2]) / scale - (R @ points[:, 6, :, None])[..., 0]
    h, o = np.broadcast_to(h, (count, 6, 3)).copy(), np.broadcast_to(points[:, :6], (count, 6, 3)).copy()
    h[:, :k], o[:, :k] = h[:, :k] @ R, (o[:, :k] - shift[:, None]) @ R
    h, o = np.roll(h, -k, axis=1), np.roll(o, -k, axis=1)
    p, v = (R @ o[:, 5, :, None])[..., 0] + shift, (R @ h[:, 5, :, None])[..., 0]
    origin = o[:, 2].copy()  # lengths are squared: measure them from the middle of the loop
    o, p = o - origin[:, None], p - origin
    right = _right(h, o, p, v).reshape(count, 14, 9)
    C = _left(h, o)
    C[:, :, 0, 0, 0] -= right[:, :, 0]
    U = np.linalg.svd(right[:, :, 1:])[0]
    roots, w = _eigen(np.einsum("nek,neabc->nkabc", U[:, :, 8:], C, optimize=True))
    theta = np.zeros((count, 24, 6))
    theta[..., 2] = 2.0 * np.arctan(roots.real)
    theta[..., 3], theta[..., 4] = _ratio(w, 2), _ratio(w, 3)
    theta += _SHIFT
    theta[..., :2] = _first_two(h, o, theta, p, v)
    theta[..., 5] = _last(h, theta, R)
    return theta, np.abs(roots.imag) <= NEARLY_REAL * (1.0 + np.abs(roots))


def _first_two(h: Array, o: Array, theta: Array, p: Array, v: Array) -> Array:
    """The first two angles ``(N, 24, 2)``, which bring the line that joints 3, 4, 5 give to ``p, v (N, 3)``.

    Joint 1 keeps the line's slope and height along its axis and its distance from a point on it: three equations
    a cos θ₂ + b sin θ₂ = d. Of the least-squares solution and both solutions of each, the one that fits best is kept.
    """
    shape = theta.shape[:2]
    x, w = _wide(o[:, 5], 2), _wide(h[:, 5], 2)
    for joint in (4, 3, 2):
        x, w = _turned(h[:, joint], o[:, joint], theta[..., joint], x, w)
    p, v = np.broadcast_to(p[:, None], x.shape), np.broadcast_to(v[:, None], x.shape)
    n, root = h[:, 0, None], o[:, 0, None]
    quarter = np.array([0.0, 0.5 * np.pi, np.pi])
    at, turned = [], []
    for angle in quarter:
        y, t = _turned(h[:, 1], o[:, 1], np.full(shape, angle), x, w)
        at.append(y - root)
        turned.append(t)
    values = np.stack([[(t * n).sum(-1) for t in turned], [(y * n).sum(-1) for y in at], [(y * y).sum(-1) for y in at]])
    a, mean = 0.5 * (values[:, 0] - values[:, 2]), 0.5 * (values[:, 0] + values[:, 2])
    b = values[:, 1] - mean
    d = np.stack([(v * n).sum(-1), ((p - root) * n).sum(-1), ((p - root) ** 2).sum(-1)]) - mean
    aa, ab, bb = (a * a).sum(0) + 1e-14, (a * b).sum(0), (b * b).sum(0) + 1e-14
    ad, bd = (a * d).sum(0), (b * d).sum(0)
    size = np.hypot(a, b)
    spread = np.arccos(np.clip(d / np.maximum(size, 1e-12), -1.0, 1.0))
    middle = np.arctan2(b, a)
    options = np.stack(
        [np.arctan2(aa * bd - ab * ad, bb * ad - ab * bd), *(middle + spread), *(middle - spread)], axis=-1
    )
    y, u = _turned(h[:, 1], o[:, 1], options, x[..., None, :], w[..., None, :])
    n, root = n[:, :, None], root[:, :, None]
    y, goal = y - root, p[..., None, :] - root
    goal_v = np.broadcast_to(v[..., None, :], u.shape)
    sine = ((np.cross(y, goal) + np.cross(u, goal_v)) * n).sum(-1)
    cosine = (y * goal).sum(-1) - (y * n).sum(-1) * (goal * n).sum(-1)
    cosine += (u * goal_v).sum(-1) - (u * n).sum(-1) * (goal_v * n).sum(-1)
    first = np.arctan2(sine, cosine)
    R = rotations(np.broadcast_to(n, (*first.shape, 3)), first)
    miss = ((R @ y[..., None])[..., 0] - goal) ** 2 + ((R @ u[..., None])[..., 0] - goal_v) ** 2
    best = miss.sum(-1).argmin(-1)[..., None]
    pair = [np.take_along_axis(part, best, -1)[..., 0] for part in (first, options)]
    return np.stack(pair, axis=-1)


def _last(h: Array, theta: Array, R: Array) -> Array:
    """The last angle ``(N, 24)`` from the rotation that the first five leave of ``R (N, 3, 3)``."""
    shape = theta.shape[:2]
    left = np.broadcast_to(np.eye(3), (*shape, 3, 3))
    for joint in range(5):
        left = left @ rotations(np.broadcast_to(h[:, joint, None], (*shape, 3)), theta[..., joint])
    rest = np.swapaxes(left, -1, -2) @ R[:, None]
    n = h[:, 5]
    u = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    turned = (rest @ u[:, None, :, None])[..., 0]
    return np.asarray(np.arctan2((turned * np.cross(n, u)[:, None]).sum(-1), (turned * u[:, None]).sum(-1)))
