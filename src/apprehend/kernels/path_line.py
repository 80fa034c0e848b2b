"""Bounded deviation: joint points along a line, arc or screw of the tool, with a certified tube (T).

A reference motion is packed in ``helix (29,)``: centre c, axis a, start r0 relative to c, velocity v (3 each), angle φ;
then the start rotation R0 (9, row-major), its axis w (3) and angle θ; for s in [0, 1]

    p(s) = c + rot(a, s φ) r0 + s v,        R(s) = rot(w, s θ) R0.

Between two joint points the joints move in proportion. The tube is certified by second derivatives: a function that
is sampled at steps δ stays within the samples plus ``δ²/8`` times a bound of its second derivative.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .chain import REVOLUTE, chain_block
from .lanes import LANES
from .single import chain_single
from .so3 import exp_one, log_one

OK = 0
LOST = 1
LEAP = 2
THIN = 3


@kernel
def reference(helix, s, p, dp, R, work):
    """Position, its derivative by s, and rotation of the reference at s."""
    f = s * helix[12]
    exp_one(f * helix[3], f * helix[4], f * helix[5], work)
    for k in range(3):
        turned = work[3 * k] * helix[6] + work[3 * k + 1] * helix[7] + work[3 * k + 2] * helix[8]
        dp[k] = turned
        p[k] = helix[k] + turned + s * helix[9 + k]
    x, y, z = dp[0], dp[1], dp[2]
    g = helix[12]
    dp[0] = g * (helix[4] * z - helix[5] * y) + helix[9]
    dp[1] = g * (helix[5] * x - helix[3] * z) + helix[10]
    dp[2] = g * (helix[3] * y - helix[4] * x) + helix[11]
    f = s * helix[25]
    exp_one(f * helix[22], f * helix[23], f * helix[24], work)
    for i in range(3):
        for j in range(3):
            R[3 * i + j] = (
                work[3 * i] * helix[13 + j] + work[3 * i + 1] * helix[16 + j] + work[3 * i + 2] * helix[19 + j]
            )


@kernel
def _copy(source, target):
    """Element by element: a slice assignment would compile its checks and their messages."""
    for j in range(source.shape[0]):
        target[j] = source[j]


@kernel
def _damped(J, rows, free, damping, error, A, y, dq):
    """``dq = Jᵗ (J Jᵗ + damping 1)⁻¹ error`` over the first *rows* and the free columns, by Cholesky."""
    n = J.shape[1]
    for i in range(rows):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(n):
                total += J[i, k] * J[j, k] * free[k]
            A[i, j] = total
    for i in range(rows):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                A[i, i] = math.sqrt(max(total, 1e-300))
            else:
                A[i, j] = total / A[j, j]
    for i in range(rows):
        total = error[i]
        for k in range(i):
            total -= A[i, k] * y[k]
        y[i] = total / A[i, i]
    for i in range(rows - 1, -1, -1):
        total = y[i]
        for k in range(i + 1, rows):
            total -= A[k, i] * y[k]
        y[i] = total / A[i, i]
    for k in range(n):
        total = 0.0
        for i in range(rows):
            total += J[i, k] * y[i]
        dq[k] = total * free[k]


@kernel
def newton(model, helix, rows, s, lower, upper, tolerance, q, T, J, w):
    """Move q to the reference pose at s by damped Newton steps within the limits; returns the residual.

    *rows* is 6, or 3 where the rotation is free; *w* ``(64,)`` is scratch. A joint that a step would push beyond its limit is held there for the next one.
    """
    n = q.shape[0]
    p = w[0:3]
    dp = w[3:6]
    R = w[6:15]
    turn = w[15:24]
    error = w[24:30]
    y = w[30:36]
    reference(helix, s, p, dp, R, turn)
    A = np.empty((6, 6))
    dq = np.empty(n)
    free = np.ones(n)
    best = np.inf
    for _ in range(25):
        chain_single(model, q, 2, T, J)
        for i in range(3):
            error[i] = p[i] - T[i, 3]
            for j in range(3):
                turn[3 * i + j] = R[3 * i] * T[j, 0] + R[3 * i + 1] * T[j, 1] + R[3 * i + 2] * T[j, 2]
        error[3], error[4], error[5] = log_one(turn)
        residual = 0.0
        for i in range(rows):
            residual = max(residual, abs(error[i]))
        if residual <= tolerance:
            return residual
        if residual > 4.0 * best and residual > 0.5:
            return residual
        best = min(best, residual)
        square = 0.0
        for i in range(rows):
            square += error[i] * error[i]
        for _ in range(n):
            _damped(J, rows, free, 1e-3 * square + 1e-14, error, A, y, dq)
            held = False
            for k in range(n):
                if free[k] > 0.0 and (q[k] + dq[k] < lower[k] or q[k] + dq[k] > upper[k]):
                    bound = lower[k] if q[k] + dq[k] < lower[k] else upper[k]
                    for i in range(rows):
                        error[i] -= J[i, k] * (bound - q[k])
                    q[k] = bound
                    free[k] = 0.0
                    held = True
            if not held:
                break
        for k in range(n):
            q[k] = min(max(q[k] + dq[k], lower[k]), upper[k])
            free[k] = 1.0
    return best


@kernel
def tangent(model, helix, rows, s, q, T, J, w, dq):
    """Joint velocity by s of least norm that follows the reference at s from *q*."""
    reference(helix, s, w[0:3], w[3:6], w[6:15], w[15:24])
    chain_single(model, q, 2, T, J)
    error = w[24:30]
    for i in range(3):
        error[i] = w[3 + i]
        error[3 + i] = helix[22 + i] * helix[25]
    free = np.ones(q.shape[0])
    _damped(J, rows, free, 1e-12, error, np.empty((6, 6)), w[30:36], dq)


@kernel
def track(model, helix, rows, nodes, q0, lower, upper, tolerance, leap, q, dq):
    """Follow the reference from *q0* through ``nodes (K + 1,)``, halving steps; ``q, dq (K + 1, n)``.

    Returns (status, number of nodes reached, s reached): LOST where Newton's iteration ends off the reference, LEAP
    where a joint would move by more than *leap* over the smallest step.
    """
    n = q0.shape[0]
    T = np.empty((4, 4))
    J = np.empty((6, n))
    w = np.empty(64)
    trial = np.empty(n)
    here = np.empty(n)
    _copy(q0, here)
    slope = np.empty(n)
    if newton(model, helix, rows, nodes[0], lower, upper, tolerance, here, T, J, w) > tolerance:
        return LOST, 0, nodes[0]
    for k in range(nodes.shape[0]):
        if k > 0:
            s = nodes[k - 1]
            step = nodes[k] - s
            smallest = step / 256.0
            while s < nodes[k]:
                ahead = min(s + step, nodes[k])
                if nodes[k] - ahead < 0.5 * smallest:
                    ahead = nodes[k]
                tangent(model, helix, rows, s, here, T, J, w, slope)
                fastest = 0.0
                for j in range(n):
                    fastest = max(fastest, abs(slope[j]))
                # the prediction is not used where it is wild: near a singularity
                use = 1.0 if fastest * (ahead - s) < leap else 0.0
                for j in range(n):
                    guess = here[j] + use * (ahead - s) * slope[j]
                    trial[j] = min(max(guess, lower[j]), upper[j])
                residual = newton(model, helix, rows, ahead, lower, upper, tolerance, trial, T, J, w)
                jump = 0.0
                for j in range(n):
                    jump = max(jump, abs(trial[j] - here[j]))
                if residual > tolerance or jump > leap:
                    step *= 0.5
                    if step < smallest:
                        _copy(trial, q[k])
                        return (LOST if residual > tolerance else LEAP), k, s
                    continue
                _copy(trial, here)
                s = ahead
        _copy(here, q[k])
        tangent(model, helix, rows, nodes[k], here, T, J, w, slope)
        _copy(slope, dq[k])
    return OK, nodes.shape[0], nodes[-1]


@kernel
def curve(model, helix, rows, nodes, q, dq, lower, upper, tolerance, s, out, T, J, w):
    """The joint vector at s: Hermite interpolation between the nodes, brought onto the reference."""
    low = 0
    high = nodes.shape[0] - 2
    while low < high:
        mid = (low + high + 1) // 2
        if nodes[mid] <= s:
            low = mid
        else:
            high = mid - 1
    h = nodes[low + 1] - nodes[low]
    z = (s - nodes[low]) / h
    a = (1.0 + 2.0 * z) * (1.0 - z) ** 2
    b = z * (1.0 - z) ** 2 * h
    c = z * z * (3.0 - 2.0 * z)
    d = z * z * (z - 1.0) * h
    for j in range(out.shape[0]):
        guess = a * q[low, j] + b * dq[low, j] + c * q[low + 1, j] + d * dq[low + 1, j]
        out[j] = min(max(guess, lower[j]), upper[j])
    return newton(model, helix, rows, s, lower, upper, tolerance, out, T, J, w)


@kernel
def tube(model, helix, lever, qa, sa, qb, sb, blocks, buffers):
    """Certified bounds (distance in m, angle in rad) from the reference between two joint points.

    16 *blocks* samples; the distance is that to the nearest point of the reference (its parameter is found at the
    samples and taken as linear between them), the angle is that to the reference's rotation there.
    """
    n = qa.shape[0]
    count = blocks * LANES
    delta = 1.0 / (count + 1)
    q, value, pose, axes, w = buffers
    p = w[0:3]
    dp = w[3:6]
    R = w[6:15]
    turn = w[15:24]
    # bounds of the second derivatives of position and rotation along the segment
    bend = 0.0
    spin = 0.0
    speed = 0.0
    m = model.kind.shape[0]
    for j in range(m):
        b = abs(model.gain[j, 0] * (qb[model.coordinate[j]] - qa[model.coordinate[j]]))
        if model.kind[j] == REVOLUTE:
            bend += b * b * lever[j] + 2.0 * speed * b * lever[j]
            spin += speed * b
            speed += b
        else:
            bend += 2.0 * speed * b
    far = 0.0
    off = 0.0
    before = sa
    rate = 0.0
    for block in range(blocks):
        for lane in range(LANES):
            share = (block * LANES + lane + 1) * delta
            for j in range(n):
                q[j * LANES + lane] = qa[j] + share * (qb[j] - qa[j])
        chain_block(model, q, value, pose, axes)
        for lane in range(LANES):
            share = (block * LANES + lane + 1) * delta
            s = sa + share * (sb - sa)
            for _ in range(2):
                reference(helix, s, p, dp, R, turn)
                square = dp[0] * dp[0] + dp[1] * dp[1] + dp[2] * dp[2]
                if square > 1e-18:
                    along = 0.0
                    for i in range(3):
                        along += (pose[(9 + i) * LANES + lane] - p[i]) * dp[i]
                    s = min(max(s + along / square, sa), sb)
            reference(helix, s, p, dp, R, turn)
            gap = 0.0
            for i in range(3):
                gap += (pose[(9 + i) * LANES + lane] - p[i]) ** 2
            far = max(far, gap)
            for i in range(3):
                for j in range(3):
                    turn[3 * i + j] = (
                        R[i] * pose[j * LANES + lane]
                        + R[3 + i] * pose[(3 + j) * LANES + lane]
                        + R[6 + i] * pose[(6 + j) * LANES + lane]
                    )
            x, y, z = log_one(turn)
            off = max(off, x * x + y * y + z * z)
            rate = max(rate, abs(s - before) / delta)
            before = s
    rate = max(rate, abs(sb - before) / delta)
    far = math.sqrt(far)
    off = math.sqrt(off)
    radius = math.sqrt(helix[6] ** 2 + helix[7] ** 2 + helix[8] ** 2)
    bend += radius * (helix[12] * rate) ** 2
    # rotation error e = log(R_refᵗ R), small: |e''| ≤ 1.1 |ω_rel'| + 0.6 |ω_rel|²; somewhere between two samples
    # |e'| is at most its mean, 2 |e|/δ
    relative = spin + speed * abs(helix[25]) * rate
    twist = 1.1 * relative + 0.6 * (2.2 * off / delta + 1.1 * delta * relative) ** 2
    return far + 0.125 * delta * delta * bend, off + 0.125 * delta * delta * twist


@kernel
def fewest(model, helix, rows, lever, nodes, q, dq, lower, upper, tolerance, deviation, angle, s_out, q_out, bounds):
    """Greedy longest segments inside the tube: parameters, joint points and certified bounds of every segment.

    A part of a segment inside the tube is inside too (to the accuracy of the search), so that the greedy choice has
    the fewest points. Returns (status, number of points).
    """
    n = q.shape[1]
    T = np.empty((4, 4))
    J = np.empty((6, n))
    w = np.empty(64)
    buffers = (
        np.empty(n * LANES), np.empty(LANES), np.empty(12 * LANES), np.empty(6 * model.kind.shape[0] * LANES),
        np.empty(64),
    )  # fmt: skip
    trial = np.empty(n)
    chosen = np.empty(n)
    s_out[0] = nodes[0]
    _copy(q[0], q_out[0])
    count = 1
    end = nodes[-1]
    step = 0.1 * (end - nodes[0])
    while s_out[count - 1] < end:
        if count >= s_out.shape[0]:
            return THIN, count
        a = s_out[count - 1]
        good = a
        bad = np.inf
        b = min(a + step, end)
        for _ in range(40):
            curve(model, helix, rows, nodes, q, dq, lower, upper, tolerance, b, trial, T, J, w)
            far, off = tube(model, helix, lever, q_out[count - 1], a, trial, b, 1, buffers)
            if (far > deviation or off > angle) and (far < 1.6 * deviation and off < 1.6 * angle):
                far, off = tube(model, helix, lever, q_out[count - 1], a, trial, b, 4, buffers)
            used = max(far / deviation, off / angle)
            if used <= 1.0:
                good = b
                _copy(trial, chosen)
                bounds[count - 1, 0] = far
                bounds[count - 1, 1] = off
                if b >= end:
                    break
            else:
                bad = b
            if good > a and (bad - good <= 0.01 * (good - a) or (used > 0.985 and used <= 1.0)):
                break
            b = a + (b - a) * min(math.sqrt(0.995 / max(used, 1e-6)), 2.5)
            if b <= good or b >= bad:
                b = 0.5 * (good + bad) if bad < np.inf else good + (good - a)
            b = min(b, end)
            if b - a < 1e-9 * (end - nodes[0]):
                return THIN, count
        if good <= a:
            return THIN, count
        step = good - a
        s_out[count] = good
        _copy(chosen, q_out[count])
        count += 1
    return OK, count
