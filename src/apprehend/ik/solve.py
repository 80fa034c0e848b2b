"""Global inverse kinematics: many starts, limits, batches, and a reason for every failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_array, as_pose, as_vector
from ..errors import InputError, expect
from ..kernels.chain import chain_poses
from ..kernels.ik_seeds import residuals
from ..kinematics import Robot
from ..parallel import over_ranges
from .chain import PreparedChain, prepare, read_targets
from .diagnose import diagnose as diagnose_failures
from .queue import Request, run, seed_of, whole
from .result import IKResult, IKStatus
from .tree import TreeProblem, nearest_in_tree

Accept = Callable[[Array], Any]
"""Says for joint vectors ``(N, n)`` which are acceptable ``(N,)``: free of collision, for instance."""
Cost = Callable[[Array], Any]
"""Says what joint vectors ``(N, n)`` cost ``(N,)``."""
CHOICE = 16
"""Solutions of every target among which the preferred is chosen."""


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
    prefer: ArrayLike | Cost | None = None,
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

    *prefer*: a joint vector ``(n,)``, or a cost ``(N, n) -> (N,)``: of up to `CHOICE` solutions of every target
    those nearest to it (largest difference of a joint), or cheapest, come first.

    Targets that are not reached get a reason and the joint vector that comes nearest (see `IKResult`); that takes some
    tenths of a millisecond each. Without *diagnose* they are NOT_FOUND, or OUT_OF_REACH where the lengths of the links
    prove it, and q is *q0* or home.

    Coordinates that do not move *frame* keep their value of *q0*, or of ``robot.home``. Joints that may make a whole
    turn are returned on the turn nearest to *q0*, or to the middle of their limits.
    """
    expect(robot, "Robot", "robot")
    whole(n_solutions, "n_solutions")
    whole(max_starts, "max_starts")
    if not distinct > 0.0:
        raise InputError(f"distinct is {distinct}; expected a positive number")
    if prefer is not None:
        more = solve(
            robot, T, frame, q0, tolerance=tolerance, n_solutions=max(CHOICE, n_solutions), distinct=distinct,
            max_starts=max_starts, accept=accept, diagnose=diagnose, rng=rng,
        )  # fmt: skip
        return _preferred(robot, more, read_targets(robot, as_pose(T, "T"), q0)[0], prefer, n_solutions)
    poses, fill, shape = read_targets(robot, as_pose(T, "T"), q0)
    chain = prepare(robot, frame)
    box, partial, free_axis = _tolerance(tolerance, chain.reach)
    seed = seed_of(rng)
    request = Request(box, partial, free_axis, n_solutions, distinct, max_starts, seed)
    near = chain.middle[None] if q0 is None else fill[:, chain.free]
    problem = _Problem(
        chain, poses, chain.targets(poses), fill, near, None if q0 is None else chain.to_kernel(fill), request
    )
    x, found, starts, codes, certified = _search(problem, accept)
    count = poses.shape[0]
    limiting = np.zeros((count, robot.n), dtype=bool)
    q = np.empty((count, n_solutions, robot.n))
    q[:] = fill[:, None, :]
    if found.all():
        q[:, :, chain.free] = chain.from_kernel(x, near[:, None, :])
    else:
        _fill_failures(robot, frame, problem, x, found, codes, certified, q, limiting, diagnose, accept)
    if n_solutions > 1:
        spare = (np.arange(n_solutions) >= found[:, None]) & (found > 0)[:, None]
        q = np.where(spare[..., None], q[:, :1], q)
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


def _preferred(robot: Robot, many: IKResult, poses: Array, prefer: ArrayLike | Cost, wanted: int) -> IKResult:
    """The same answer with the *wanted* preferred solutions of every target, the best first."""
    shape, most = many.codes.shape, many.q.shape[-2]
    q, found = many.q.reshape(-1, most, robot.n), many.found.reshape(-1)
    if callable(prefer):
        cost = np.asarray(prefer(q.reshape(-1, robot.n)), dtype=np.float64)
        if cost.shape != (q.shape[0] * most,):
            raise InputError(f"prefer returned shape {cost.shape} for {q.shape[0] * most} joint vectors")
        if np.isnan(cost).any():
            raise InputError("prefer returned NaN; expected a cost for every joint vector")
        cost = cost.reshape(-1, most)
    else:
        cost = np.abs(q - as_vector(prefer, "prefer", robot.n)).max(axis=-1)
    spare = np.arange(most) >= np.maximum(found, 1)[:, None]
    order = np.argsort(np.where(spare, np.inf, cost), axis=1, kind="stable")[:, :wanted]
    chosen = np.take_along_axis(q, order[..., None], axis=1)
    chosen = np.where((np.arange(wanted) < np.maximum(found, 1)[:, None])[..., None], chosen, chosen[:, :1])
    best = np.ascontiguousarray(chosen[:, 0])
    return replace(
        many,
        q=chosen.reshape(*shape, wanted, robot.n) if wanted > 1 else best.reshape(*shape, robot.n),
        found=np.minimum(many.found, wanted),
        residual=residual_of(robot, many.frame, best, poses).reshape(*shape, 2),
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """A batch of targets for one chain."""

    chain: PreparedChain
    poses: Array  # (N, 4, 4)
    targets: Array  # (N, 12)
    fill: Array  # (N, n) values of the coordinates outside the chain
    near: Array  # (N or 1, k) where whole turns are counted from
    guesses: Array | None  # (N, k) in kernel units
    request: Request

    def some(self, index: IntArray) -> _Problem:
        """The targets *index* alone."""
        if index.size == self.targets.shape[0]:
            return self
        near = self.near if self.near.shape[0] == 1 else self.near[index]
        guesses = None if self.guesses is None else self.guesses[index]
        return replace(
            self,
            poses=self.poses[index],
            targets=self.targets[index],
            fill=self.fill[index],
            near=near,
            guesses=guesses,
        )


def _search(problem: _Problem, accept: Accept | None) -> tuple[Array, IntArray, IntArray, IntArray, BoolArray]:
    """Solutions ``(N, s, k)`` in kernel units, how many, starts used, status codes, and what is certified."""
    chain, request = problem.chain, problem.request
    count = problem.targets.shape[0]
    certified = np.zeros(count, dtype=bool)
    if np.isfinite(request.box[:3]).all():
        certified = chain.bound.beyond(problem.poses, *request.slack(chain.reach))
    todo = np.flatnonzero(~certified)
    part = problem.some(todo)
    codes = np.full(count, IKStatus.NOT_FOUND.code, dtype=np.int64)
    codes[certified] = IKStatus.OUT_OF_REACH.code
    if accept is None:
        x, found, starts = run(chain, part.targets, part.guesses, request)
    else:
        x, found, starts, refused = _accepted(part, accept)
        codes[todo[refused]] = IKStatus.COLLISION.code
    if todo.size < count:
        every = np.zeros((count, *x.shape[1:])), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        for whole, value in zip(every, (x, found, starts), strict=True):
            whole[todo] = value
        x, found, starts = every
    codes[found > 0] = IKStatus.SUCCESS.code
    return x, found, starts, codes, certified


def _nearest_partial(robot: Robot, frame: str, part: _Problem) -> tuple[Array, Array]:
    """Kernel coordinates that come nearest where the axes have tolerances of their own, and half the squared errors."""
    chain = part.chain
    box = part.request.box.copy()
    box[:3] *= chain.reach
    guesses = np.ascontiguousarray(part.fill[:, None, :])
    problem = TreeProblem(robot, (frame,), (chain,), part.poses[:, None], box[None], guesses, part.request.seed)
    q, cost = nearest_in_tree(problem, np.arange(part.poses.shape[0]))
    return chain.to_kernel(q), 0.5 * cost


def _fill_failures(
    robot: Robot,
    frame: str,
    problem: _Problem,
    x: Array,
    found: IntArray,
    codes: IntArray,
    certified: BoolArray,
    q: Array,
    limiting: BoolArray,
    diagnose: bool,
    accept: Accept | None,
) -> None:
    """Write solutions into q, and for the targets without, their reasons and the nearest joint vectors."""
    chain = problem.chain
    known = found > 0
    values = chain.from_kernel(x, problem.near[:, None, :])
    failed = np.flatnonzero(~known & (codes != IKStatus.COLLISION.code))
    if diagnose and failed.size:
        part = problem.some(failed)
        known_nearest = _nearest_partial(robot, frame, part) if problem.request.partial else None
        why = diagnose_failures(chain, part.poses, part.targets, part.guesses, problem.request, known_nearest)
        codes[failed], certified[failed] = why.codes, why.certified
        values[failed] = chain.from_kernel(why.x, part.near)[:, None, :]
        known[failed] = True
    q[:, :, chain.free] = np.where(known[:, None, None], values, q[:, :, chain.free])
    if diagnose and failed.size:
        at = q[failed[:, None], 0, chain.free]
        limiting[failed[:, None], chain.free] = (at <= chain.lower + 1e-9) | (at >= chain.upper - 1e-9)
        # at a singularity the steps creep, and only the long descent to the nearest pose gets there
        late = failed[_reaches(robot, frame, part, q[failed, 0], why.cost)]
        if accept is not None and late.size:
            late = late[np.asarray(accept(q[late, 0]), dtype=bool)]
        codes[late], found[late], limiting[late] = IKStatus.SUCCESS.code, 1, False


def _reaches(robot: Robot, frame: str, part: _Problem, q: Array, cost: Array) -> BoolArray:
    """Which of the nearest joint vectors are within the tolerance."""
    if part.request.partial:
        return cost <= 0.0
    tolerance = part.request.box[3]
    inside: BoolArray = (residual_of(robot, frame, q, part.poses) <= tolerance).all(axis=1)
    return inside


def _accepted(problem: _Problem, accept: Accept) -> tuple[Array, IntArray, IntArray, BoolArray]:
    """As `queue.run`, keeping only accepted solutions; also which targets had solutions, but none accepted."""
    chain, request, near = problem.chain, problem.request, problem.near
    count, k = problem.targets.shape[0], chain.free.size
    x = np.zeros((count, request.wanted, k))
    found, starts = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    refused = np.zeros(count, dtype=bool)
    todo = np.arange(count)
    for most in (max(4, 2 * request.wanted), max(32, 4 * request.wanted)):
        part = problem.some(todo)
        many, number, used = run(chain, part.targets, part.guesses, request.with_(wanted=most))
        starts[todo] = used
        row, column = np.nonzero(np.arange(most) < number[:, None])
        q = part.fill[row]
        q[:, chain.free] = chain.from_kernel(many[row, column], part.near if near.shape[0] == 1 else part.near[row])
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
