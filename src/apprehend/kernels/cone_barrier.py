"""Analytic centres of contact forces: Newton's method on a logarithmic barrier.

Minimises ``cost · f − Σ power log q(f) − weight Σ log(right − rows f)`` over ``f = f₀ + N ξ``. The determinants of
friction cones' matrices are products of linear forms and diagonal quadratic forms q of a contact's components; at most
four numbers each.
"""

from __future__ import annotations

import numpy as np

from ._jit import kernel

SURE = 1e-10
"""Newton decrement at which a centre counts as found."""
MOST_STEPS, LONGEST = 60, 1e12


@kernel
def _value(f, cost, places, power, form, rows, right, weight):  # type: ignore[no-untyped-def]
    """The barrier's value, inf outside."""
    value = 0.0
    for j in range(f.shape[0]):
        value += cost[j] * f[j]
    for i in range(places.shape[0]):
        s, k, square = places[i, 0], places[i, 1], places[i, 2]
        q = 0.0
        for a in range(k):
            q += form[i, a] * (f[s + a] * f[s + a] if square else f[s + a])
        if not (q > 0.0 and f[s + places[i, 3]] > 0.0):
            return np.inf
        value -= power[i] * np.log(q)
    for i in range(rows.shape[0]):
        left = right[i]
        for j in range(f.shape[0]):
            left -= rows[i, j] * f[j]
        if not left > 0.0:
            return np.inf
        if weight > 0.0:
            value -= weight * np.log(left)
    return value


@kernel
def _derivatives(f, cost, places, power, form, rows, right, weight, N, g, H, low, grad, half):  # type: ignore[no-untyped-def]
    """Gradient g and Hessian H (lower part) in the coordinates of N."""
    m, n = N.shape
    for j in range(m):
        grad[j] = cost[j]
    for a in range(n):
        g[a] = 0.0
        for b in range(a + 1):
            H[a, b] = 0.0
    for i in range(places.shape[0]):
        s, k, square = places[i, 0], places[i, 1], places[i, 2]
        q = 0.0
        for a in range(k):
            q += form[i, a] * (f[s + a] * f[s + a] if square else f[s + a])
        for a in range(k):
            low[a] = (2.0 * form[i, a] * f[s + a] if square else form[i, a]) / q
            grad[s + a] -= power[i] * low[a]
        for b in range(n):
            t = 0.0
            for a in range(k):
                t += low[a] * N[s + a, b]
            half[b] = t
        for b in range(n):
            for d in range(b + 1):
                H[b, d] += power[i] * half[b] * half[d]
        if square:
            for a in range(k):
                t = -2.0 * power[i] * form[i, a] / q
                for b in range(n):
                    u = t * N[s + a, b]
                    for d in range(b + 1):
                        H[b, d] += u * N[s + a, d]
    for i in range(rows.shape[0]):
        left = right[i]
        for j in range(m):
            left -= rows[i, j] * f[j]
        for j in range(m):
            grad[j] += weight * rows[i, j] / left
        for b in range(n):
            t = 0.0
            for j in range(m):
                t += rows[i, j] * N[j, b]
            half[b] = t / left
        for b in range(n):
            for d in range(b + 1):
                H[b, d] += weight * half[b] * half[d]
    for j in range(m):
        for a in range(n):
            g[a] += grad[j] * N[j, a]


@kernel
def _newton(H, g, step):  # type: ignore[no-untyped-def]
    """``step = −H⁻¹ g`` by Cholesky, in place; the square of Newton's decrement."""
    n = g.shape[0]
    for j in range(n):
        before = H[j, j]
        for i in range(j, n):
            t = H[i, j]
            for m in range(j):
                t -= H[i, m] * H[j, m]
            H[i, j] = t
        inverse = 1.0 / np.sqrt(H[j, j]) if H[j, j] > 1e-15 * before else 0.0
        for i in range(j + 1, n):
            H[i, j] *= inverse
        H[j, j] = inverse
    square = 0.0
    for j in range(n):
        t = -g[j]
        for m in range(j):
            t -= H[j, m] * step[m]
        step[j] = t * H[j, j]
        square += step[j] * step[j]
    for back in range(n):
        j = n - 1 - back
        t = step[j]
        for m in range(j + 1, n):
            t -= H[m, j] * step[m]
        step[j] = t * H[j, j]
    return square


@kernel
def centre(N, cost, places, power, form, rows, right, stages, f, out):  # type: ignore[no-untyped-def]
    """Move each of ``f (count, m)`` to its centre; ``out (count, 3)``: value without limits, decrement, steps.

    ``N (m, n)`` spans what may be added. *places* of the factors of the determinants: the first component, how many,
    whether they are squared, and which one is the normal force; *form* their coefficients; the logarithms
    of limits ``rows f < right`` weigh as much as the *stages* say, one after the other. A negative decrement says that
    f runs away.
    """
    m, n = N.shape
    g, step, half, H = np.empty(n), np.empty(n), np.empty(n), np.empty((n, n))
    grad, move, trial, low = np.empty(m), np.empty(m), np.empty(m), np.empty(4)
    for p in range(f.shape[0]):
        x, steps, decrement = f[p], 0, np.inf
        for stage in range(stages.shape[0]):
            weight = stages[stage]
            value = _value(x, cost, places, power, form, rows, right, weight)
            for _ in range(MOST_STEPS):
                _derivatives(x, cost, places, power, form, rows, right, weight, N, g, H, low, grad, half)
                decrement = np.sqrt(_newton(H, g, step))
                if decrement < SURE:
                    break
                steps += 1
                largest = 0.0
                for j in range(m):
                    t = 0.0
                    for a in range(n):
                        t += N[j, a] * step[a]
                    move[j] = t
                    largest = max(largest, abs(x[j]))
                if largest > LONGEST:
                    decrement = -1.0
                    break
                length, after = 1.0, np.inf
                while length > 1e-12:
                    for j in range(m):
                        trial[j] = x[j] + length * move[j]
                    after = _value(trial, cost, places, power, form, rows, right, weight)
                    if after <= value + 1e-12 * abs(value) - 0.1 * length * decrement * decrement:
                        break
                    length *= 0.5
                if not length > 1e-12:
                    break
                for j in range(m):
                    x[j] = trial[j]
                value = after
        out[p, 0] = _value(x, cost, places, power, form, rows, right, 0.0)
        out[p, 1], out[p, 2] = decrement, steps
