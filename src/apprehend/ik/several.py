"""Inverse kinematics of several frames at once: two arms on one torso, all fingertips of a hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array, as_pose, as_shaped
from ..errors import InputError
from ..kernels.ik_tasks import POSE, TaskList
from ..kernels.ik_tree import solve_tree
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import prepare
from .result import IKResult, IKStatus
from .solve import residual_of, solve


def solve_frames(
    robot: Robot,
    T: ArrayLike,
    frames: Sequence[str],
    q0: ArrayLike | None = None,
    *,
    tolerance: ArrayLike = 1e-6,
    max_starts: int = 200,
    rng: np.random.Generator | None = None,
) -> IKResult:
    """Joint vectors that bring *frames* to the poses ``T (..., F, 4, 4)`` all at once, within the position limits.

    *tolerance* as in `solve`, or ``(F, 6)`` for each frame its own (``inf`` frees an axis; ``[1e-6] * 3 + [inf] * 3``
    asks for positions, as for fingertips). Starts: *q0* or home; the solutions of the frames one by one, put together
    (a shared joint as the first frame has it); then random ones. ``residual`` of the result is the largest distance
    and the largest angle over the frames; on failure q is the guess or home.
    """
    F = len(frames)
    if F < 2 or len(set(frames)) != F:
        raise InputError(f"frames is {list(frames)}; expected two or more different ones (for one frame: ik.solve)")
    T = as_pose(T, "T")
    if T.ndim < 3 or T.shape[-3] != F:
        raise InputError(f"T has shape {T.shape}; expected (..., {F}, 4, 4), one pose for each of {list(frames)}")
    if max_starts < 1:
        raise InputError(f"max_starts is {max_starts}; expected 1 or more")
    box = as_array(tolerance, "tolerance", finite=False)
    if box.shape not in ((), (6,), (F, 6)):
        raise InputError(f"tolerance has shape {box.shape}; expected a number, (6,) or ({F}, 6)")
    if not (box > 0.0).all():
        raise InputError("every entry of tolerance must be positive (inf: the axis is free)")
    box = np.broadcast_to(box, (F, 6))
    chains = [prepare(robot, frame) for frame in frames]
    shape = T.shape[:-3]
    count = math.prod(shape)
    poses = T.reshape(count, F, 4, 4)
    start = np.broadcast_to(robot.home if q0 is None else as_shaped(q0, "q0", robot.n), (*shape, robot.n))
    start = start.reshape(count, robot.n)
    limits = robot.limits
    moving = np.zeros(robot.n, dtype=bool)
    low, high = limits.lower.copy(), limits.upper.copy()
    joined = start.copy()
    taken = np.zeros(robot.n, dtype=bool)
    for i, (frame, chain) in enumerate(zip(frames, chains, strict=True)):
        moving[chain.free] = True
        low[chain.free], high[chain.free] = chain.program.low * chain.unit, chain.program.high * chain.unit
        one = solve(robot, poses[:, i], frame, start, tolerance=box[i], max_starts=20, diagnose=False)
        fresh = [c for c in chain.free if not taken[c]]
        joined[:, fresh] = one.q[:, fresh]
        taken[chain.free] = True
    guesses = np.ascontiguousarray(np.stack([start, joined], axis=1))
    data = np.ascontiguousarray(poses.reshape(count, F, 16))
    tasks = TaskList(
        kind=np.full(F, POSE, dtype=np.int64),
        frame=np.array([(robot.frame_index(f), -1) for f in frames], dtype=np.int64),
        row=np.arange(0, 6 * F + 1, 6, dtype=np.int64),
        point=np.zeros((F, 3)),
        axis=np.tile([0.0, 0.0, 1.0], (F, 1)),
        weight=np.ones(6 * F),
        gain=np.ones(F),
        pick=np.zeros(6 * F, dtype=np.int64),
    )
    reach = max(chain.reach for chain in chains)
    scale = np.tile([reach] * 3 + [1.0] * 3, F)
    out = start.copy()
    found, used = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    seed = 0 if rng is None else int(rng.integers(1 << 62))
    still = ~moving
    lower, upper = np.where(still, -np.inf, limits.lower), np.where(still, np.inf, limits.upper)
    rows = np.ascontiguousarray(box.reshape(-1))

    def work(first: int, last: int) -> None:
        solve_tree(
            robot.model, tasks, data, rows, scale, lower, upper, low, high, still, guesses, seed, max_starts, first,
            last, out, found, used,
        )  # fmt: skip

    over_ranges(work, count, 32)
    gaps = np.stack([residual_of(robot, f, out, poses[:, i]) for i, f in enumerate(frames)], axis=1)
    certified = np.zeros(count, dtype=bool)
    for i, chain in enumerate(chains):
        if np.isfinite(box[i, :3]).all():
            slack = float(np.linalg.norm(box[i, :3])), float(np.linalg.norm(box[i, 3:]))
            certified |= chain.bound.beyond(poses[:, i], *slack)
    codes = np.where(found > 0, 0, np.where(certified, IKStatus.OUT_OF_REACH.code, IKStatus.NOT_FOUND.code))
    return IKResult(
        q=out.reshape(*shape, robot.n),
        codes=codes.reshape(shape),
        residual=gaps.max(axis=1).reshape(*shape, 2),
        found=found.reshape(shape),
        starts=used.reshape(shape),
        certified=certified.reshape(shape),
        limiting=np.zeros((*shape, robot.n), dtype=bool),
        frame=", ".join(frames),
        joint_names=robot.joint_names,
    )
