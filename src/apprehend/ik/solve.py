"""Global inverse kinematics: many starts, limits, batches, and a reason for every failure."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_array, as_pose, as_shaped
from ..errors import InputError
from ..kernels.chain import chain_poses
from ..kernels.ik_seeds import residuals
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import PreparedChain, prepare
from .diagnose import diagnose as diagnose_failures
from .queue import Request, run
from .result import IKResult, IKStatus

Accept = Callable[[Array], Any]
"""Says for joint vectors ``(N, n)`` which are acceptable ``(N,)``: free of collision, for instance."""


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
    accept: Accept | None = None,
    diagnose: bool = True,
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

    *accept* ``(N, n) -> (N,)`` booleans filters solutions (``CollisionModel.free``): up to 32 distinct ones of every
    target are tried, and targets all of whose solutions are refused get the status COLLISION.

    Targets that are not reached get a reason and the joint vector that comes nearest (see `IKResult`); that takes some
    tenths of a millisecond each. Without *diagnose* they are NOT_FOUND, or OUT_OF_REACH where the lengths of the links
    prove it, and q is *q0* or home.

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
    request = Request(box, partial, free_axis, n_solutions, distinct, max_starts, seed)
    near = fill[:, chain.free] if q0 is not None else np.broadcast_to(chain.middle, (count, chain.free.size))
    targets = chain.targets(poses)
    guesses = None if q0 is None else chain.to_kernel(fill)
    certified = _certified(chain, poses, box)
    x = np.zeros((count, n_solutions, chain.free.size))
    found, starts = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    codes = np.where(certified, IKStatus.OUT_OF_REACH.code, IKStatus.NOT_FOUND.code)
    todo = np.flatnonzero(~certified)
    if todo.size:
        some = targets if todo.size == count else targets[todo]
        mine = guesses if guesses is None or todo.size == count else guesses[todo]
        if accept is None:
            x[todo], found[todo], starts[todo] = run(chain, some, mine, request)
        else:
            x[todo], found[todo], starts[todo], refused = _accepted(
                chain, some, mine, request, accept, fill[todo], near[todo]
            )
            codes[todo[refused]] = IKStatus.COLLISION.code
    codes[found > 0] = IKStatus.SUCCESS.code
    q = np.repeat(fill[:, None, :], n_solutions, axis=1)
    values = chain.from_kernel(x, near[:, None, :])
    failed = np.flatnonzero((found == 0) & (codes != IKStatus.COLLISION.code))
    if diagnose and failed.size:
        why = diagnose_failures(
            chain, poses[failed], targets[failed], None if guesses is None else guesses[failed], request
        )
        codes[failed], certified[failed] = why.codes, why.certified
        values[failed] = chain.from_kernel(why.x, near[failed])[:, None, :]
    known = found > 0
    known[failed] = diagnose
    q[:, :, chain.free] = np.where(known[:, None, None], values, q[:, :, chain.free])
    if n_solutions > 1:
        spare = (np.arange(n_solutions) >= found[:, None]) & (found > 0)[:, None]
        q = np.where(spare[..., None], q[:, :1], q)
    limiting = np.zeros((count, robot.n), dtype=bool)
    at_nearest = q[failed, 0]
    limiting[failed] = (at_nearest <= robot.limits.lower + 1e-9) | (at_nearest >= robot.limits.upper - 1e-9)
    limiting[:, [i for i in range(robot.n) if i not in chain.free]] = False
    return IKResult(
        q=q.reshape(*shape, n_solutions, robot.n) if n_solutions > 1 else q.reshape(*shape, robot.n),
        codes=codes.reshape(shape),
        residual=residual_of(robot, frame, q[:, 0], poses).reshape(*shape, 2),
        found=found.reshape(shape),
        starts=starts.reshape(shape),
        certified=certified.reshape(shape),
        limiting=limiting.reshape(*shape, robot.n),
        frame=frame,
        joint_names=robot.joint_names,
    )


def _certified(chain: PreparedChain, poses: Array, box: Array) -> BoolArray:
    """Which poses are certainly out of reach, whatever the joints do."""
    if not np.isfinite(box[:3]).all():
        return np.zeros(poses.shape[0], dtype=bool)
    return chain.bound.beyond(poses, float(np.linalg.norm(box[:3])) * chain.reach, float(np.linalg.norm(box[3:])))


def _accepted(
    chain: PreparedChain,
    targets: Array,
    guesses: Array | None,
    request: Request,
    accept: Accept,
    fill: Array,
    near: Array,
) -> tuple[Array, IntArray, IntArray, BoolArray]:
    """As `queue.run`, keeping only accepted solutions; also which targets had solutions, but none accepted."""
    count, k = targets.shape[0], chain.free.size
    x = np.zeros((count, request.wanted, k))
    found, starts = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    refused = np.zeros(count, dtype=bool)
    todo = np.arange(count)
    for most in (max(4, 2 * request.wanted), max(32, 4 * request.wanted)):
        mine = None if guesses is None else guesses[todo]
        many, number, used = run(chain, targets[todo], mine, request.with_(wanted=most))
        starts[todo] = used
        row, column = np.nonzero(np.arange(most) < number[:, None])
        q = fill[todo[row]].copy()
        q[:, chain.free] = chain.from_kernel(many[row, column], near[todo[row]])
        verdict = np.asarray(accept(q)) if row.size else np.zeros(0, dtype=bool)
        if verdict.shape != (row.size,):
            raise InputError(
                f"accept returned shape {verdict.shape} for {row.size} joint vectors; expected ({row.size},)"
            )
        good = np.zeros((todo.size, most), dtype=bool)
        good[row, column] = verdict.astype(bool)
        rank = np.cumsum(good, axis=1) - 1
        r, c = np.nonzero(good & (rank < request.wanted))
        x[todo[r], rank[r, c]] = many[r, c]
        found[todo] = np.minimum(good.sum(axis=1), request.wanted)
        refused[todo] = (number > 0) & ~good.any(axis=1)
        todo = todo[(found[todo] < request.wanted) & (number == most)]
        if not todo.size:
            break
    return x, found, starts, refused


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


def residual_of(robot: Robot, frame: str, q: Array, T: Array) -> Array:
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
