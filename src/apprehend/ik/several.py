"""Inverse kinematics of several frames at once: two arms on one torso, all fingertips of a hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_array, as_pose, as_shaped
from ..errors import InputError
from ..kernels.ik_tasks import POSE, TaskList
from ..kernels.ik_tree import solve_tree
from ..kernels.ik_tree_nearest import descend_tree
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import PreparedChain, prepare
from .result import IKResult, IKStatus
from .solve import residual_of, solve

ALONE_STARTS = 20
"""Starts for each frame alone, whose solutions are put together to a start for all."""
WHY_STARTS = 60
"""Starts of every search for a reason."""
POLISH = 300
"""Steps of the last descent to the nearest joint vector."""


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
    problem = _read(robot, T, frames, q0, tolerance, max_starts, rng)
    count, shape = problem.poses.shape[0], problem.shape
    q, found, used, _ = _run(problem, np.arange(count), max_starts)
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
        q[failed] = _nearest(problem, failed)
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


@dataclass(frozen=True, eq=False)
class _Problem:
    """A batch of N targets for F frames."""

    robot: Robot
    frames: tuple[str, ...]
    chains: tuple[PreparedChain, ...]
    poses: Array  # (N, F, 4, 4)
    box: Array  # (F, 6)
    guesses: Array  # (N, 2, n): what was given, and the solutions of the frames one by one
    moving: BoolArray  # (n,) coordinates that move some frame
    low: Array  # (n,) bounds of random starts
    high: Array
    seed: int
    shape: tuple[int, ...]

    @property
    def reach(self) -> float:
        """The longest reach of the chains."""
        return max(chain.reach for chain in self.chains)


def _read(
    robot: Robot,
    T: ArrayLike,
    frames: Sequence[str],
    q0: ArrayLike | None,
    tolerance: ArrayLike,
    max_starts: int,
    rng: np.random.Generator | None,
) -> _Problem:
    """Check the arguments, and solve for each frame alone."""
    F = len(frames)
    if isinstance(frames, str) or F < 2 or len(set(frames)) != F:
        raise InputError(f"frames is {frames!r}; expected two or more different ones (for one frame: ik.solve)")
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
    if not np.isfinite(box).any(axis=1).all():
        at = int(np.flatnonzero(~np.isfinite(box).any(axis=1))[0])
        raise InputError(f"tolerance of frame {frames[at]!r} is inf in all axes: nothing is asked of it; leave it out")
    chains = tuple(prepare(robot, frame) for frame in frames)
    shape = T.shape[:-3]
    count = math.prod(shape)
    poses = np.ascontiguousarray(T.reshape(count, F, 4, 4))
    start = np.broadcast_to(robot.home if q0 is None else as_shaped(q0, "q0", robot.n), (*shape, robot.n))
    start = start.reshape(count, robot.n)
    moving = np.zeros(robot.n, dtype=bool)
    low, high = robot.limits.lower.copy(), robot.limits.upper.copy()
    joined = start.copy()
    for i, (frame, chain) in enumerate(zip(frames, chains, strict=True)):
        low[chain.free], high[chain.free] = chain.program.low * chain.unit, chain.program.high * chain.unit
        one = solve(robot, poses[:, i], frame, start, tolerance=box[i], max_starts=ALONE_STARTS, diagnose=False)
        fresh = [c for c in chain.free if not moving[c]]
        joined[:, fresh] = one.q[:, fresh]
        moving[chain.free] = True
    guesses = np.ascontiguousarray(np.stack([start, joined], axis=1))
    seed = 0 if rng is None else int(rng.integers(1 << 62))
    return _Problem(robot, tuple(frames), chains, poses, box, guesses, moving, low, high, seed, shape)


@dataclass(frozen=True, eq=False)
class _Rows:
    """What the kernels read of a problem: rows of all frames, and limits."""

    tasks: TaskList
    data: Array  # (M, F, 16)
    box: Array  # (6 F,)
    scale: Array  # (6 F,)
    lower: Array  # (n,)
    upper: Array


def _rows(problem: _Problem, index: IntArray, limits: bool) -> _Rows:
    """The targets *index* for the kernels."""
    robot, F = problem.robot, len(problem.frames)
    tasks = TaskList(
        kind=np.full(F, POSE, dtype=np.int64),
        frame=np.array([(robot.frame_index(f), -1) for f in problem.frames], dtype=np.int64),
        row=np.arange(0, 6 * F + 1, 6, dtype=np.int64),
        point=np.zeros((F, 3)),
        axis=np.tile([0.0, 0.0, 1.0], (F, 1)),
        weight=np.ones(6 * F),
        gain=np.ones(F),
        pick=np.zeros(6 * F, dtype=np.int64),
    )
    bounded = problem.moving & limits
    return _Rows(
        tasks,
        np.ascontiguousarray(problem.poses[index].reshape(index.size, F, 16)),
        np.ascontiguousarray(problem.box.reshape(-1)),
        np.tile([problem.reach] * 3 + [1.0] * 3, F),
        np.where(bounded, robot.limits.lower, -np.inf),
        np.where(bounded, robot.limits.upper, np.inf),
    )


def _run(
    problem: _Problem, index: IntArray, starts: int, *, limits: bool = True, nearest: bool = False
) -> tuple[Array, IntArray, IntArray, Array]:
    """Solutions of the targets *index* (else their first guesses), which are found, starts used; and the nearest."""
    rows = _rows(problem, index, limits)
    guesses = np.ascontiguousarray(problem.guesses[index])
    out = guesses[:, 0].copy()
    found, used = np.zeros(index.size, dtype=np.int64), np.zeros(index.size, dtype=np.int64)
    least, best = np.full(index.size if nearest else 0, np.inf), out.copy()

    def work(first: int, last: int) -> None:
        solve_tree(
            problem.robot.model, rows.tasks, rows.data, rows.box, rows.scale, rows.lower, rows.upper, problem.low,
            problem.high, ~problem.moving, guesses, problem.seed, starts, first, last, out, found, used, least, best,
        )  # fmt: skip

    over_ranges(work, index.size, 32)
    return out, found, used, best


def _nearest(problem: _Problem, failed: IntArray) -> Array:
    """Joint vectors within the limits that come nearest: the best of many descents, followed to its end."""
    best = _run(problem, failed, WHY_STARTS, nearest=True)[3]
    rows = _rows(problem, failed, True)
    cost = np.empty(failed.size)

    def work(first: int, last: int) -> None:
        descend_tree(
            problem.robot.model, rows.tasks, rows.data, rows.box, rows.scale, rows.lower, rows.upper, POLISH, first,
            last, best, cost,
        )  # fmt: skip

    over_ranges(work, failed.size, 16)
    return best


def _reasons(problem: _Problem, failed: IntArray, codes: IntArray, at_fault: IntArray) -> tuple[IntArray, IntArray]:
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
        found = _run(problem, failed[at], WHY_STARTS, limits=False)[1]
        codes[at] = np.where(found > 0, IKStatus.LIMITS.code, IKStatus.CONFLICT.code)
    return codes, at_fault
