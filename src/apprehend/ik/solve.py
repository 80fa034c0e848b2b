"""Global inverse kinematics: many starts, limits, batches."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, IntArray, as_array, as_pose, as_shaped
from ..errors import InputError
from ..kernels.chain import chain_poses
from ..kernels.ik_queue import solve_queue, solve_wide
from ..kernels.ik_seeds import nearest_starts, residuals
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import GROUPS, PreparedChain, prepare
from .result import IKResult, IKStatus

WIDE = 16
"""Batches smaller than this give all lanes to one target after the other."""
GRAIN = 128
"""Smallest share of a batch that is worth a thread."""


def solve(
    robot: Robot,
    T: ArrayLike,
    frame: str,
    q0: ArrayLike | None = None,
    *,
    tolerance: ArrayLike = 1e-6,
    n_solutions: int = 1,
    distinct: float = 0.1,
    max_starts: int = 200,
    rng: np.random.Generator | None = None,
) -> IKResult:
    """Joint vectors that bring *frame* to the poses ``T (..., 4, 4)``, T_world_frame, within the position limits.

    Every target gets up to *max_starts* starts of a damped Newton iteration (`kernels.ik_chain`): from *q0*
    ``(..., n)`` if given, from the nearest of a table of known configurations, then from random ones. The answer is
    that of the first start that succeeds; so with *q0* near, the solution continues from it. It depends on the
    target, *q0* and *rng* (one draw; without it the random starts are always the same), not on threads, and but for
    rounding not on the rest of the batch.

    *tolerance*: the largest distance (m) and angle (rad) that count as reached; or ``(6,)``, one per axis of the
    target frame: x, y, z in m, then about x, y, z in rad, ``inf`` for an axis that is free. So
    ``[1e-6] * 5 + [inf]`` leaves the rotation about the tool's z open and ``[1e-6] * 3 + [inf] * 3`` asks for a
    position only.

    *n_solutions*: up to that many solutions, any two of which differ by more than *distinct* rad (or shares of the
    reach) in some coordinate; then ``q`` is ``(..., n_solutions, n)``, see `IKResult`.

    Coordinates that do not move *frame* keep their value of *q0*, or of ``robot.home``. Joints that may make a whole
    turn are returned on the turn nearest to *q0*, or to the middle of their limits.
    """
    T = as_pose(T, "T")
    if n_solutions < 1:
        raise InputError(f"n_solutions is {n_solutions}; expected 1 or more")
    if max_starts < 1:
        raise InputError(f"max_starts is {max_starts}; expected 1 or more")
    chain = prepare(robot, frame)
    box, partial, free_axis = _tolerance(tolerance, chain.reach)
    shape = T.shape[:-2]
    if q0 is not None:
        q0 = as_shaped(q0, "q0", robot.n)
        try:
            shape = np.broadcast_shapes(shape, q0.shape[:-1])
        except ValueError as error:
            raise InputError(f"q0 has batch shape {q0.shape[:-1]} and T {shape}; they do not broadcast") from error
    count = math.prod(shape)
    poses = np.ascontiguousarray(np.broadcast_to(T, (*shape, 4, 4))).reshape(count, 4, 4)
    fill = np.broadcast_to(robot.home if q0 is None else q0, (*shape, robot.n)).reshape(count, robot.n)
    seed = 0 if rng is None else int(rng.integers(1 << 62))
    x, found, starts = _run(
        chain, chain.targets(poses), None if q0 is None else chain.to_kernel(fill), box, partial, free_axis,
        n_solutions, distinct, max_starts, seed,
    )  # fmt: skip
    near = fill[:, chain.free] if q0 is not None else np.broadcast_to(chain.middle, (count, chain.free.size))
    q = np.repeat(fill[:, None, :], n_solutions, axis=1)
    solved = found > 0
    values = chain.from_kernel(x, near[:, None, :])
    q[:, :, chain.free] = np.where(solved[:, None, None], values, q[:, :, chain.free])
    if n_solutions > 1:
        spare = np.arange(n_solutions) >= found[:, None]
        q = np.where(spare[..., None], q[:, :1], q)
    far = np.linalg.norm(poses[:, :3, 3] - chain.before[:3, 3], axis=1) > chain.reach + _slack(box) * chain.reach
    codes = np.where(solved, IKStatus.SUCCESS.code, np.where(far, IKStatus.OUT_OF_REACH.code, IKStatus.NOT_FOUND.code))
    return IKResult(
        q=q.reshape(*shape, n_solutions, robot.n) if n_solutions > 1 else q.reshape(*shape, robot.n),
        codes=codes.reshape(shape),
        residual=_residual(robot, frame, q[:, 0], poses).reshape(*shape, 2),
        found=found.reshape(shape),
        starts=starts.reshape(shape),
        facts=(frame, chain.reach, chain.before[:3, 3]),
    )


def _tolerance(tolerance: ArrayLike, reach: float) -> tuple[Array, bool, int]:
    """Box of errors in the kernels' units, whether it differs from axis to axis, the one free rotation axis or −1."""
    box = as_array(tolerance, "tolerance", finite=False)
    if box.shape not in ((), (6,)):
        raise InputError(f"tolerance has shape {box.shape}; expected a number, or (6,) for x, y, z, about x, y, z")
    if not (box > 0.0).all():
        raise InputError(f"tolerance is {box}; every entry must be positive (inf: the axis is free)")
    if box.ndim == 0 and not np.isfinite(box):
        raise InputError("tolerance is inf: nothing would be asked for; give six numbers to free single axes")
    if not np.isfinite(box).any():
        raise InputError("tolerance is inf in all six axes: nothing is asked for")
    if box.ndim == 0:
        box = np.full(6, float(box))
        partial = False
    else:
        partial = True
    free = np.flatnonzero(np.isinf(box[3:]))
    scaled = box.copy()
    scaled[:3] /= reach
    return scaled, partial, int(free[0]) if free.size == 1 else -1


def _slack(box: Array) -> float:
    """Length by which the frame may miss the target's position, over the reach."""
    return float(np.linalg.norm(box[:3]))


def _run(
    chain: PreparedChain,
    targets: Array,
    guesses: Array | None,
    box: Array,
    partial: bool,
    free_axis: int,
    n_solutions: int,
    distinct: float,
    max_starts: int,
    seed: int,
) -> tuple[Array, IntArray, IntArray]:
    """Solutions ``(N, s, k)`` in kernel units, how many, and starts used, for target rows ``(N, 12)``."""
    count, k = targets.shape[0], chain.free.size
    out = np.zeros((count, n_solutions, k))
    found = np.zeros(count, dtype=np.int64)
    starts = np.zeros(count, dtype=np.int64)
    within = np.flatnonzero(np.linalg.norm(targets[:, 9:], axis=1) <= 1.0 + _slack(box))
    if within.size < count:
        o, f, s = np.zeros((within.size, n_solutions, k)), found[within], starts[within]
        if within.size:
            o, f, s = _run(
                chain, targets[within], None if guesses is None else guesses[within], box, partial, free_axis,
                n_solutions, distinct, max_starts, seed,
            )  # fmt: skip
        out[within], found[within], starts[within] = o, f, s
        return out, found, starts
    table, weighted, half = chain.table
    order = np.zeros((count, GROUPS), dtype=np.int64)
    given = np.zeros((0, k)) if guesses is None else guesses
    driver = solve_wide if count < WIDE else solve_queue

    def work(first: int, last: int) -> None:
        nearest_starts(weighted, half, targets, first, last, order)
        driver(
            chain.program, targets, first, last, given, table, order, seed, max_starts, box, partial, free_axis,
            distinct, out, found, starts,
        )  # fmt: skip

    over_ranges(work, count, GRAIN)
    return out, found, starts


def _residual(robot: Robot, frame: str, q: Array, T: Array) -> Array:
    """Distance and angle ``(N, 2)`` between targets and the poses that the robot's forward kinematics gives."""
    count = q.shape[0]
    model = robot.chain_model(frame)
    reached = np.empty((count, 16))
    out = np.empty((count, 2))
    wanted = T.reshape(count, 16)
    q = np.ascontiguousarray(q)

    def work(first: int, last: int) -> None:
        chain_poses(model, q, first, last, reached)
        residuals(reached, wanted, first, last, out)

    over_ranges(work, count, 2048)
    return out
