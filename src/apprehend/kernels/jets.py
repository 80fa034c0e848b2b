"""Proven bounds of derivatives along a path: of torques and of the motion of a frame, over whole intervals.

A *jet* of a vector function f on an interval, σ ∈ [0, 1], is ``(j_0 … j_5)`` with ``|f^(k)(σ)|/k! ≤ j_k`` for all σ.
Jets of sums add, those of any product that is no longer than the product of the lengths (scalar, vector, matrix times
vector) convolve, ``(f ⋆ g)_k = Σ f_i g_{k−i}``, and a rotation by an angle whose jet is d has the jet of
``exp(d_1 σ + d_2 σ² + …)``: each derivative of a rotation by its angle is no longer than 1. So the recursion of the
inverse dynamics, run on jets of lengths in the joints' own frames, bounds every derivative of its outcome.

Lanes are intervals. A lane buffer of jets is flat: order k of lane l at ``k * WIDE + l``.
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel
from .chain import REVOLUTE
from .path import locate
from .timing_cubic import WIDE

ORDERS = 6
"""Derivatives 0 … 5: what the error of a quartic interpolant needs."""
DEEP = 8
"""Derivatives of the path that they need: torques hold its second derivative."""


@kernel
def path_jets(breaks, coefficients, grid, start, out):
    """Jets ``out (n, DEEP, WIDE)`` of all coordinates on the intervals *start* … of *grid*; past the last, it again."""
    degree = coefficients.shape[1] - 1
    local = np.empty(degree + 1)
    for lane in range(WIDE):
        i = min(start + lane, grid.shape[0] - 2)
        h = grid[i + 1] - grid[i]
        k = locate(breaks, 0.5 * (grid[i] + grid[i + 1]))
        z = grid[i] - breaks[k]
        for j in range(coefficients.shape[2]):
            for p in range(degree + 1):
                local[p] = coefficients[k, p, j]
            for p in range(degree):
                for r in range(degree - 1, p - 1, -1):
                    local[r] += z * local[r + 1]
            scale = 1.0
            for p in range(degree + 1):
                local[p] = abs(local[p] * scale)
                scale *= h
            for m in range(DEEP):
                total = 0.0
                binomial = 1.0
                for p in range(m, degree + 1):
                    total += binomial * local[p]
                    binomial = binomial * (p + 1) / (p + 1 - m)
                out[j, m, lane] = total


@kernel
def _add_product(f, g, scale, out):
    """``out += scale · f ⋆ g``."""
    for lane in range(WIDE):
        f0, f1, f2, f3, f4, f5 = (
            scale * f[lane], scale * f[WIDE + lane], scale * f[2 * WIDE + lane], scale * f[3 * WIDE + lane],
            scale * f[4 * WIDE + lane], scale * f[5 * WIDE + lane],
        )  # fmt: skip
        g0, g1, g2, g3, g4, g5 = (
            g[lane], g[WIDE + lane], g[2 * WIDE + lane], g[3 * WIDE + lane], g[4 * WIDE + lane], g[5 * WIDE + lane],
        )  # fmt: skip
        out[lane] += f0 * g0
        out[WIDE + lane] += f0 * g1 + f1 * g0
        out[2 * WIDE + lane] += f0 * g2 + f1 * g1 + f2 * g0
        out[3 * WIDE + lane] += f0 * g3 + f1 * g2 + f2 * g1 + f3 * g0
        out[4 * WIDE + lane] += f0 * g4 + f1 * g3 + f2 * g2 + f3 * g1 + f4 * g0
        out[5 * WIDE + lane] += f0 * g5 + f1 * g4 + f2 * g3 + f3 * g2 + f4 * g1 + f5 * g0


@kernel
def _set(value, out):
    """The jet of a constant."""
    for k in range(ORDERS * WIDE):
        out[k] = 0.0
    for lane in range(WIDE):
        out[lane] = value


@kernel
def _add(f, scale, out):
    """``out += scale · f``."""
    for k in range(ORDERS * WIDE):
        out[k] += scale * f[k]


@kernel
def _joint(jets, gain, offset, place, turning, turn, reach, rate, rate_rate):
    """Jets of one joint from those of its coordinate: its rotation, the distance of its frame from its parent's, and
    the first and second derivative of its value."""
    multiplier = abs(gain)
    for lane in range(WIDE):
        for k in range(ORDERS):
            rate[k * WIDE + lane] = multiplier * (k + 1.0) * jets[k + 1, lane]
            rate_rate[k * WIDE + lane] = multiplier * (k + 2.0) * (k + 1.0) * jets[k + 2, lane]
    _set(1.0, turn)
    _set(math.sqrt(place[9] ** 2 + place[10] ** 2 + place[11] ** 2), reach)
    if turning > 0.0:
        for k in range(1, ORDERS):
            for i in range(1, k + 1):
                for lane in range(WIDE):
                    turn[k * WIDE + lane] += i * multiplier * jets[i, lane] * turn[(k - i) * WIDE + lane] / k
    else:
        for lane in range(WIDE):
            reach[lane] += multiplier * jets[0, lane] + abs(offset)
            for k in range(1, ORDERS):
                reach[k * WIDE + lane] += multiplier * jets[k, lane]


@kernel
def _move(turning, turn, reach, rate, rate_rate, before, here, work):
    """Jets of the motion of a joint's frame from those of its parent's, both ``(4, ORDERS WIDE)``: angular velocity,
    velocity, angular acceleration, acceleration of the origin, for a path speed of 1 and no path acceleration."""
    swing, carried = work[0], work[1]
    _set(0.0, swing)
    _add_product(turn, before[0], 1.0, swing)  # the parent's angular velocity in the joint's frame
    for k in range(4):
        _set(0.0, here[k])
    _add(swing, 1.0, here[0])
    _add(before[1], 1.0, here[1])
    _add_product(before[0], reach, 1.0, here[1])
    _set(0.0, carried)
    _add_product(turn, here[1], 1.0, carried)
    _set(0.0, here[1])
    _add(carried, 1.0, here[1])
    _add_product(turn, before[2], 1.0, here[2])
    # acceleration of the joint's place: a + α × r + ω × (ω × r)
    _set(0.0, carried)
    _add_product(before[0], reach, 1.0, carried)
    _add_product(before[0], carried, 1.0, here[3])
    _add_product(before[2], reach, 1.0, here[3])
    _add(before[3], 1.0, here[3])
    _set(0.0, carried)
    _add_product(turn, here[3], 1.0, carried)
    _set(0.0, here[3])
    _add(carried, 1.0, here[3])
    if turning > 0.0:
        _add(rate, 1.0, here[0])
        _add_product(swing, rate, 1.0, here[2])
        _add(rate_rate, 1.0, here[2])
    else:
        _add(rate, 1.0, here[1])
        _add_product(swing, rate, 2.0, here[3])
        _add(rate_rate, 1.0, here[3])


@kernel
def _forces(row, motion, weight, square, force, moment):
    """Add the jets of force and moment on one body ``(3, ORDERS WIDE)``, for path acceleration 1, path speed 1, and
    gravity; *row* is its inertia about the frame's origin, *weight* the jet of gravity there."""
    mass = row[0]
    first = math.sqrt(row[1] ** 2 + row[2] ** 2 + row[3] ** 2)
    # the Frobenius norm bounds what the inertia makes of a vector
    second = math.sqrt(row[4] ** 2 + row[7] ** 2 + row[9] ** 2 + 2.0 * (row[5] ** 2 + row[6] ** 2 + row[8] ** 2))
    _add(motion[1], mass, force[0])
    _add(motion[0], first, force[0])
    _add(motion[0], second, moment[0])
    _add(motion[1], first, moment[0])
    _set(0.0, square)
    _add_product(motion[0], motion[0], 1.0, square)
    _add(motion[3], mass, force[1])
    _add(motion[2], first, force[1])
    _add(square, first, force[1])
    _add(motion[2], second, moment[1])
    _add(square, second, moment[1])
    _add(motion[3], first, moment[1])
    _add(weight, mass, force[2])
    _add(weight, first, moment[2])


@kernel
def torque_jets(model, gravity, breaks, coefficients, grid, power, out):
    """Jets ``out (N, n, 3, ORDERS)`` of A, B, C in ``τ = A s̈ + B ṡ² + C`` on every interval of *grid*, in σ.

    A and B belong to derivatives by σ: divide A by h and B by h² for those by s. With *power* all three are multiplied
    by the derivative of the coordinate.
    """
    m = model.kind.shape[0]
    n = coefficients.shape[2]
    size = ORDERS * WIDE
    jets = np.empty((n, DEEP, WIDE))
    turn = np.empty((m, size))
    reach = np.empty((m, size))
    rate = np.empty((m, size))
    rate_rate = np.empty((m, size))
    weight = np.empty((m, size))
    motion = np.zeros((m + 1, 4, size))  # the last: the root, which stands still
    force, moment = np.zeros((m, 3, size)), np.zeros((m, 3, size))
    tau = np.empty((n, 3, size))
    work = np.empty((2, size))
    hung = np.empty(size)
    for start in range(0, grid.shape[0] - 1, WIDE):
        path_jets(breaks, coefficients, grid, start, jets)
        for i in range(m):
            turning = 1.0 if model.kind[i] == REVOLUTE else 0.0
            c = model.coordinate[i]
            _joint(
                jets[c], model.gain[i, 0], model.gain[i, 1], model.place[i], turning, turn[i], reach[i], rate[i],
                rate_rate[i],
            )  # fmt: skip
            parent = model.parent[i]
            before = m if parent < 0 else parent
            _move(turning, turn[i], reach[i], rate[i], rate_rate[i], motion[before], motion[i], work)
            _set(gravity, hung)
            _set(0.0, weight[i])
            _add_product(turn[i], hung if parent < 0 else weight[parent], 1.0, weight[i])
            for k in range(3):
                _set(0.0, force[i, k])
                _set(0.0, moment[i, k])
            _forces(model.inertia[i], motion[i], weight[i], work[0], force[i], moment[i])
        tau[:] = 0.0
        for r in range(m):
            i = m - 1 - r
            c = model.coordinate[i]
            multiplier = abs(model.gain[i, 0])
            _add(rate[i], model.armature[i] * multiplier, tau[c, 0])
            _add(rate_rate[i], model.armature[i] * multiplier, tau[c, 1])
            parent = model.parent[i]
            for k in range(3):
                _add(moment[i, k] if model.kind[i] == REVOLUTE else force[i, k], multiplier, tau[c, k])
                if parent >= 0:
                    _set(0.0, work[0])
                    _add_product(turn[i], force[i, k], 1.0, work[0])
                    _add(work[0], 1.0, force[parent, k])
                    _add_product(reach[i], work[0], 1.0, moment[parent, k])
                    _add_product(turn[i], moment[i, k], 1.0, moment[parent, k])
        for c in range(n):
            _joint(jets[c], 1.0, 0.0, model.place[0], 1.0, work[0], work[1], rate[0], rate_rate[0])
            for k in range(3):
                kept = tau[c, k]
                if power:
                    _set(0.0, work[0])
                    _add_product(tau[c, k], rate[0], 1.0, work[0])
                    kept = work[0]
                for lane in range(min(WIDE, grid.shape[0] - 1 - start)):
                    for o in range(ORDERS):
                        out[start + lane, c, k, o] = kept[o * WIDE + lane]


@kernel
def frame_jets(model, breaks, coefficients, grid, out):
    """Jets ``out (N, 4, ORDERS)`` of the motion of a chain's end on every interval of *grid*, in the world's axes and
    in σ: angular velocity, velocity, angular acceleration, acceleration, for a path speed of 1 and no acceleration."""
    m = model.kind.shape[0]
    size = ORDERS * WIDE
    jets = np.empty((coefficients.shape[2], DEEP, WIDE))
    turn = np.empty(size)
    reach = np.empty(size)
    rate = np.empty(size)
    rate_rate = np.empty(size)
    whole = np.empty(size)
    motion = np.zeros((2, 4, size))
    work = np.empty((2, size))
    for start in range(0, grid.shape[0] - 1, WIDE):
        path_jets(breaks, coefficients, grid, start, jets)
        motion[:] = 0.0
        _set(1.0, whole)
        for i in range(m + 1):
            here = motion[i % 2]
            before = motion[(i + 1) % 2]
            if i < m:
                turning = 1.0 if model.kind[i] == REVOLUTE else 0.0
                _joint(
                    jets[model.coordinate[i]], model.gain[i, 0], model.gain[i, 1], model.place[i], turning, turn,
                    reach, rate, rate_rate,
                )  # fmt: skip
            else:  # the end, fixed to the last joint
                turning = 0.0
                end = model.place[m]
                _set(1.0, turn)
                _set(math.sqrt(end[9] ** 2 + end[10] ** 2 + end[11] ** 2), reach)
                _set(0.0, rate)
                _set(0.0, rate_rate)
            _move(turning, turn, reach, rate, rate_rate, before, here, work)
            _set(0.0, work[0])
            _add_product(whole, turn, 1.0, work[0])
            _set(0.0, whole)
            _add(work[0], 1.0, whole)
        for k in range(4):
            _set(0.0, work[0])
            _add_product(whole, motion[m % 2, k], 1.0, work[0])
            for lane in range(min(WIDE, grid.shape[0] - 1 - start)):
                for o in range(ORDERS):
                    out[start + lane, k, o] = work[0, o * WIDE + lane]
