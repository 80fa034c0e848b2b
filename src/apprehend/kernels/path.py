"""Piecewise polynomials: evaluation, proven ranges, and composition with a polynomial timing.

A piecewise polynomial has ``breaks (K + 1,)`` and ``coefficients (K, D + 1, n)``, low order first, in the local
variable ``x − breaks[k]``. Ranges are proven by the convex-hull property of the Bernstein basis: on an interval a
polynomial lies between its smallest and its largest Bernstein coefficient.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel


@kernel
def locate(breaks, x):
    """Index of the piece that holds *x*; the pieces are closed on the left, the last one on both sides."""
    low = 0
    high = breaks.shape[0] - 2
    while low < high:
        mid = (low + high + 1) // 2
        if breaks[mid] <= x:
            low = mid
        else:
            high = mid - 1
    return low


@kernel
def evaluate(breaks, coefficients, x, order, out):
    """The derivative *order* at every ``x (M,)`` into ``out (M, n)``."""
    top = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    for i in range(x.shape[0]):
        k = locate(breaks, x[i])
        z = x[i] - breaks[k]
        for j in range(n):
            out[i, j] = 0.0
        for p in range(top, order - 1, -1):
            factor = 1.0
            for m in range(order):
                factor *= p - m
            for j in range(n):
                out[i, j] = out[i, j] * z + factor * coefficients[k, p, j]


@kernel
def to_bernstein(power, h, binomial, out):
    """Bernstein coefficients on [0, h] of the polynomial with low-first coefficients *power*; ``binomial (m,)``: of its
    degree."""
    degree = power.shape[0] - 1
    scale = 1.0
    for k in range(degree + 1):
        out[k] = power[k] * scale / binomial[k]
        scale *= h
    for level in range(1, degree + 1):
        for k in range(degree, level - 1, -1):
            out[k] += out[k - 1]


@kernel
def _derivative(coefficients, k, j, order, sign, power):
    """Low-first coefficients of ``sign × derivative`` of coordinate j on piece k."""
    for p in range(power.shape[0]):
        power[p] = 0.0
        if p + order < coefficients.shape[1]:
            factor = sign
            for q in range(order):
                factor *= p + order - q
            power[p] = factor * coefficients[k, p + order, j]


@kernel
def _split(b, left, right):
    """De Casteljau at the middle."""
    m = b.shape[0]
    for k in range(m):
        right[k] = b[k]
    for level in range(m):
        left[level] = right[0]
        for k in range(m - 1 - level):
            right[k] = 0.5 * (right[k] + right[k + 1])
    # `right` now holds the right half's coefficients in place: right[k] = b_k^(m-1-k)


@kernel
def upper_bound(breaks, coefficients, order, sign, tolerance, bound, where):
    """Proven maximum of ``sign × derivative`` per coordinate, within *tolerance*, and where it is attained.

    Branch and bound over Bernstein pieces: ``bound (n,)`` is never below the true maximum, and at most *tolerance*
    (relative to the largest magnitude at any break, and to the maximum) above a value attained at ``where (n,)``.
    """
    pieces = coefficients.shape[0]
    n = coefficients.shape[2]
    m = max(coefficients.shape[1] - order, 1)
    power = np.zeros(m)
    stack = np.empty((64, m))
    span = np.empty((64, 2))
    left = np.empty(m)
    right = np.empty(m)
    b = np.empty(m)
    binomial = np.ones(m)
    for p in range(1, m):
        binomial[p] = binomial[p - 1] * (m - p) / p
    for j in range(n):
        attained = -np.inf
        proven = -np.inf
        size = 0.0
        place = breaks[0]
        # ends of all pieces first: a good incumbent prunes nearly everything
        for k in range(pieces):
            h = breaks[k + 1] - breaks[k]
            _derivative(coefficients, k, j, order, sign, power)
            end = 0.0
            for p in range(m - 1, -1, -1):
                end = end * h + power[p]
            size = max(size, max(abs(power[0]), abs(end)))
            if power[0] > attained:
                attained = power[0]
                place = breaks[k]
            if end > attained:
                attained = end
                place = breaks[k + 1]
        for k in range(pieces):
            h = breaks[k + 1] - breaks[k]
            _derivative(coefficients, k, j, order, sign, power)
            to_bernstein(power, h, binomial, b)
            depth = 1
            for p in range(m):
                stack[0, p] = b[p]
            span[0, 0] = breaks[k]
            span[0, 1] = breaks[k + 1]
            while depth > 0:
                depth -= 1
                for p in range(m):
                    b[p] = stack[depth, p]
                lo = span[depth, 0]
                hi = span[depth, 1]
                top = b[0]
                for p in range(1, m):
                    if b[p] > top:
                        top = b[p]
                if b[0] > attained:
                    attained = b[0]
                    place = lo
                if b[m - 1] > attained:
                    attained = b[m - 1]
                    place = hi
                slack = tolerance * max(size, abs(attained))
                if top <= attained + slack or depth >= 60 or hi - lo <= 1e-14 * (1.0 + abs(hi)):
                    if top > proven:
                        proven = top
                    continue
                _split(b, left, right)
                mid = 0.5 * (lo + hi)
                for p in range(m):
                    stack[depth, p] = left[p]
                    stack[depth + 1, p] = right[p]
                span[depth, 0] = lo
                span[depth, 1] = mid
                span[depth + 1, 0] = mid
                span[depth + 1, 1] = hi
                depth += 2
        bound[j] = max(proven, attained)
        where[j] = place


@kernel
def compose(breaks, coefficients, t_breaks, timing, out):
    """Coefficients in time of ``q(s(t))`` on every timing interval.

    ``timing (N, E + 1)`` holds the low-first coefficients of s on each ``[t_i, t_{i+1}]``, which must lie in one piece
    of the path; ``out (N, D E + 1, n)``.
    """
    count = timing.shape[0]
    e = timing.shape[1] - 1
    degree = coefficients.shape[1] - 1
    n = coefficients.shape[2]
    z = np.empty(e + 1)
    work = np.empty(degree * e + 1)
    for i in range(count):
        middle = 0.0
        h = 0.5 * (t_breaks[i + 1] - t_breaks[i])
        for p in range(e, -1, -1):
            middle = middle * h + timing[i, p]
        k = locate(breaks, middle)
        for p in range(e + 1):
            z[p] = timing[i, p]
        z[0] -= breaks[k]
        for j in range(n):
            for p in range(out.shape[1]):
                out[i, p, j] = 0.0
            out[i, 0, j] = coefficients[k, degree, j]
            length = 1
            for p in range(degree - 1, -1, -1):
                for a in range(length + e):
                    work[a] = 0.0
                for a in range(length):
                    for c in range(e + 1):
                        work[a + c] += out[i, a, j] * z[c]
                length += e
                for a in range(length):
                    out[i, a, j] = work[a]
                out[i, 0, j] += coefficients[k, p, j]
