"""Inverse kinematics of several frames at once: two arms on one torso, all fingertips of a hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import IntArray, as_array, as_pose, as_shaped, spread
from ..errors import InputError
from ..kinematics import Robot
from .chain import prepare
from .queue import seed_of, whole
from .result import IKResult, IKStatus
from .solve import residual_of, solve
from .tree import WHY_STARTS, TreeProblem, nearest_in_tree, run_tree

ALONE_STARTS = 20
"""Starts for each frame alone, whose solutions are put together to a start for all."""


def solve_frames(
    robot: Robot,
    T: ArrayLike,
    frames: Sequence[str],
    q0: ArrayLike | None = None,
    *,
    tolerance: ArrayLike = 1e-6,
    max_starts: int = 200,
    diagnose: bool = True,
    rng: np.random.Generator | None = None,
) -> IKResult:
    """Joint vectors that bring *frames* to the poses ``T (..., F, 4, 4)`` all at once, within the position limits.

    *tolerance* as in `solve`, or ``(F, 6)`` for each frame its own (``inf`` frees an axis; ``[1e-6] * 3 + [inf] * 3``
    asks for positions, as for fingertips). Starts: *q0* or home; the solutions of the frames one by one, put together
    (a shared joint as the first frame has it); then random ones.

    ``residual`` of the result is the largest distance and the largest angle over the frames. A failure gets a reason:
    that of the first frame that cannot reach its target even alone (``at_fault (...)``, its number, else −1); LIMITS
    if all together reach them outside the limits; else CONFLICT. Its q is the nearest found: least sum over the frames
    of squared distances over the longest reach, and squared angles. Without *diagnose* it is *q0* or home.
    """
    whole(max_starts, "max_starts")
    problem, shape = _read(robot, T, frames, q0, tolerance, rng)
    count = problem.poses.shape[0]
    q, found, used, _ = run_tree(problem, np.arange(count), max_starts)
    certified = np.zeros((count, len(frames)), dtype=bool)
    for i, chain in enumerate(problem.chains):
        box = problem.box[i]
        if np.isfinite(box[:3]).all():
            slack = float(np.linalg.norm(box[:3])), float(np.linalg.norm(box[3:]))
            certified[:, i] = chain.bound.beyond(problem.poses[:, i], *slack)
    codes = np.where(found > 0, 0, IKStatus.NOT_FOUND.code)
    codes[certified.any(axis=1)] = IKStatus.OUT_OF_REACH.code
    at_fault = np.where(certified.any(axis=1), certified.argmax(axis=1), -1)
    failed = np.flatnonzero(found == 0)
    limiting = np.zeros((count, robot.n), dtype=bool)
    if diagnose and failed.size:
        q[failed] = nearest_in_tree(problem, failed)[0]
        codes[failed], at_fault[failed] = _reasons(problem, failed, codes[failed], at_fault[failed])
        at = (q <= robot.limits.lower + 1e-9) | (q >= robot.limits.upper - 1e-9)
        limiting[failed] = (at & problem.moving)[failed]
    gaps = [residual_of(robot, f, q, problem.poses[:, i]) for i, f in enumerate(frames)]
    return IKResult(
        q=q.reshape(*shape, robot.n),
        codes=codes.reshape(shape),
        residual=np.max(gaps, axis=0).reshape(*shape, 2),
        found=found.reshape(shape),
        starts=used.reshape(shape),
        certified=certified.any(axis=1).reshape(shape),
        limiting=limiting.reshape(*shape, robot.n),
        frame=", ".join(frames),
        joint_names=robot.joint_names,
        at_fault=at_fault.reshape(shape),
    )


def _read(
    robot: Robot,
    T: ArrayLike,
    frames: Sequence[str],
    q0: ArrayLike | None,
    tolerance: ArrayLike,
    rng: np.random.Generator | None,
) -> tuple[TreeProblem, tuple[int, ...]]:
    """Check the arguments, and solve for each frame alone; the batch shape."""
    F = len(frames)
    if isinstance(frames, str) or F < 2 or len(set(frames)) != F:
        raise InputError(f"frames is {frames!r}; expected two or more different ones (for one frame: ik.solve)")
    T = as_pose(T, "T")
    if T.ndim < 3 or T.shape[-3] != F:
        raise InputError(f"T has shape {T.shape}; expected (..., {F}, 4, 4), one pose for each of {list(frames)}")
    box = as_array(tolerance, "tolerance", finite=False)
    if box.shape not in ((), (6,), (F, 6)):
        raise InputError(f"tolerance has shape {box.shape}; expected a number, (6,) or ({F}, 6)")
    if not (box > 0.0).all():
        raise InputError("every entry of tolerance must be positive (inf: the axis is free)")
    box = spread(box, (F, 6))
    if not np.isfinite(box).any(axis=1).all():
        at = int(np.flatnonzero(~np.isfinite(box).any(axis=1))[0])
        raise InputError(f"tolerance of frame {frames[at]!r} is inf in all axes: nothing is asked of it; leave it out")
    chains = tuple(prepare(robot, frame) for frame in frames)
    shape = T.shape[:-3]
    count = math.prod(shape)
    poses = np.ascontiguousarray(T.reshape(count, F, 4, 4))
    start = robot.home if q0 is None else as_shaped(q0, "q0", robot.n)
    try:
        start = spread(start, (*shape, robot.n)).reshape(count, robot.n)
    except ValueError:
        raise InputError(f"q0 has batch shape {start.shape[:-1]} and T {shape}; they do not broadcast") from None
    moving = np.zeros(robot.n, dtype=bool)
    joined = start.copy()
    for i, (frame, chain) in enumerate(zip(frames, chains, strict=True)):
        one = solve(robot, poses[:, i], frame, start, tolerance=box[i], max_starts=ALONE_STARTS, diagnose=False)
        fresh = [c for c in chain.free if not moving[c]]
        joined[:, fresh] = one.q[:, fresh]
        moving[chain.free] = True
    guesses = np.ascontiguousarray(np.stack([start, joined], axis=1))
    seed = seed_of(rng)
    return TreeProblem(robot, tuple(frames), chains, poses, box, guesses, seed), shape


def _reasons(problem: TreeProblem, failed: IntArray, codes: IntArray, at_fault: IntArray) -> tuple[IntArray, IntArray]:
    """Status codes of the failed targets, and the frame that cannot reach its target alone, if there is one."""
    codes, at_fault = codes.copy(), at_fault.copy()
    for i, frame in enumerate(problem.frames):
        at = np.flatnonzero(at_fault < 0)
        if not at.size:
            return codes, at_fault
        start = problem.guesses[failed[at], 0]
        alone = solve(problem.robot, problem.poses[failed[at], i], frame, start, tolerance=problem.box[i])
        bad = at[alone.codes != 0]
        codes[bad], at_fault[bad] = alone.codes[alone.codes != 0], i
    at = np.flatnonzero(at_fault < 0)
    if at.size:
        found = run_tree(problem, failed[at], WHY_STARTS, limits=False)[1]
        codes[at] = np.where(found > 0, IKStatus.LIMITS.code, IKStatus.CONFLICT.code)
    return codes, at_fault
