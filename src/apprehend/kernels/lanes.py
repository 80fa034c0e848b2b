"""Lanes: blocks of independent problems laid out so that the innermost loop is one vector instruction.

A lane array has shape ``(blocks, components, LANES)``: lane ``l`` of block ``b`` belongs to problem
``b * LANES + l``. The last block is padded with copies of problem 0, so that its arithmetic stays ordinary.
"""

from __future__ import annotations

import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic

from ._jit import kernel

LANES = 16
"""Problems per block: two AVX-512 or four AVX2 registers of float64, measured best on both."""


@intrinsic
def fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """a b + c, rounded once, of three numbers or three values of lanes; the compiler does not rearrange it."""

    def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
        kind = args[0].type
        name = f"llvm.fma.v{kind.count}f64" if hasattr(kind, "count") else "llvm.fma.f64"
        whole = cgutils.ir.FunctionType(kind, [kind] * 3)
        return builder.call(cgutils.get_or_insert_function(builder.module, whole, name), args)

    return (a(a, a, a), generate) if a == b == c else None


@kernel(inline=True)
def sincos(x):  # type: ignore[no-untyped-def]
    """Sine and cosine without branches: Cody–Waite reduction to [−π/4, π/4] and minimax polynomials.

    The error is below 2 ulp of 1 for |x| ≤ 1e5, which covers joint angles; it vectorises over lanes. The three parts of
    π/2 come off by `fma`: fast-math would add them up first, and lose what is gained by having three.
    """
    k = np.floor(x * 0.6366197723675814 + 0.5)
    r = fma(-k, 1.5707963267341256, x)
    r = fma(-k, 6.077100506303966e-11, r)
    r = fma(-k, 2.0222662487959506e-21, r)
    z = r * r
    s = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
            )
        )
    )
    c = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z
                    * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11))
                )
            )
        )
    )
    half = np.floor(0.5 * k)
    odd = k != 2.0 * half
    down = half != 2.0 * np.floor(0.5 * half)
    sine = c if odd else s
    cosine = s if odd else c
    return -sine if down else sine, -cosine if down != odd else cosine


@kernel
def pack(problems, out):  # type: ignore[no-untyped-def]
    """Lay ``problems (N, m)`` out as lanes ``out (ceil(N / LANES), m, LANES)``; padding repeats problem 0."""
    count, m = problems.shape
    for b in range(out.shape[0]):
        for lane in range(LANES):
            i = b * LANES + lane
            if i >= count:
                i = 0
            for j in range(m):
                out[b, j, lane] = problems[i, j]


@kernel
def unpack(lanes, out):  # type: ignore[no-untyped-def]
    """Inverse of `pack` without the padding: ``lanes (B, m, LANES)`` into ``out (N, m)``."""
    count, m = out.shape
    for i in range(count):
        for j in range(m):
            out[i, j] = lanes[i // LANES, j, i % LANES]


def blocks(count: int) -> int:
    """Number of blocks that hold *count* problems."""
    return -(-count // LANES)


def to_lanes(problems: np.ndarray) -> np.ndarray:
    """``(N, m)`` to lanes ``(blocks, m, LANES)``."""
    out = np.empty((blocks(problems.shape[0]), problems.shape[1], LANES))
    if problems.shape[0]:
        pack(problems, out)
    return out
