"""All branches of inverse kinematics, by the closed form that fits the arm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, BoolArray, IntArray, as_pose, as_shaped
from ..errors import InputError, expect
from ..kernels import ik_branches as kernels
from ..kernels.chain import ChainModel
from ..kernels.ik_chain import IKChain
from ..kernels.ik_refine import finish
from ..kinematics import Robot
from ..parallel import over_ranges
from ..result import Result, Status
from .chain import PreparedChain, prepare, read_targets
from .continua import self_motions, within_limits
from .flat import flat_branches, flat_structure
from .general import first_pair, general_branches
from .structure import EXACT, Geometry, Structure, detect, idealised, lines, locked_geometry, revolute_only

GRAIN = 256
GENERAL = "six revolute joints in any position"
ANY_JOINT = 2
"""The joint that is locked on arms of seven revolute joints that no form fits better with another locked."""


class BranchStatus(Status):
    """What the closed form says on one target."""

    SUCCESS = "there is at least one branch within the limits"
    LIMITS = "the target can be reached, but every branch leaves the joint limits"
    OUT_OF_REACH = "no branch exists: the target is outside the arm's workspace"


_STATUSES = tuple(BranchStatus)
_OBJECTS = np.array(_STATUSES, dtype=object)
LIMITS = _STATUSES.index(BranchStatus.LIMITS)


@dataclass(frozen=True, eq=False)
class BranchResult(Result):
    """Branches of a batch of targets; leading dimensions are the targets'.

    ``q (..., B, n)`` with ``valid (..., B)``: rows that are no branch hold the first one (or the home position).
    ``residual (..., B)`` is the larger of distance over the reach and angle. *family* says which closed form it was.
    """

    q: Array
    valid: BoolArray
    residual: Array
    codes: IntArray
    family: str

    @property
    def found(self) -> Any:
        """Number of branches of every target."""
        return self.valid.sum(axis=-1)

    @property
    def success(self) -> Any:
        """Whether there is a branch, for every target."""
        good = self.codes == 0
        return bool(good) if good.ndim == 0 else good

    @property
    def status(self) -> Any:  # type: ignore[override]
        """`BranchStatus` of every target."""
        return _OBJECTS[self.codes]

    def solutions(self, *index: int) -> Array:
        """The branches ``(found, n)`` of one target."""
        if len(index) != self.codes.ndim:
            raise InputError(f"{len(index)} indices for a batch of shape {self.codes.shape}; give one per dimension")
        rows: Array = self.q[index][self.valid[index]]
        return rows

    def explain(self) -> str:
        """The status of one target, or how many targets have branches."""
        if self.codes.ndim == 0:
            return f"{int(self.found)} branches ({self.family}): {_STATUSES[int(self.codes)].value}"
        good = self.codes == 0
        return f"{int(good.sum())} of {good.size} targets have branches within the limits ({self.family})"


@dataclass(frozen=True, eq=False)
class _Arm:
    """What is kept of a chain: its structure with nothing locked, and the chain without limits for refining."""

    chain: PreparedChain
    free: IKChain
    structure: Structure | None  # of six joints, or of seven with one locked
    locked: int = -1  # the joint to lock, −1: none
    seven: Geometry | None = None  # all seven axes
    general: Geometry | None = None  # six axes that fit no form, or seven with one locked somewhere

    @cached_property
    def pair(self) -> int:
        """The first of the two joints that `general_branches` eliminates."""
        assert self.general is not None
        g = self.general
        return first_pair(g.h, g.o, g.R0)


_arms: WeakKeyDictionary[Robot, dict[str, _Arm]] = WeakKeyDictionary()


def _arm(robot: Robot, frame: str) -> _Arm:
    known = _arms.setdefault(robot, {})
    if frame not in known:
        chain = prepare(robot, frame)
        model = robot.chain_model(frame)
        k = chain.free.size
        wide = chain.program._replace(lower=np.full(k, -np.inf), upper=np.full(k, np.inf))
        known[frame] = _Arm(chain, wide, None)
        if revolute_only(model) and k == 6:
            g = lines(model)
            known[frame] = _Arm(chain, wide, detect(g), general=g)
        elif revolute_only(model) and k == 7:
            for joint in (2, 6, 3, 0, 1, 4, 5):
                structure = _when_locked(model, joint)
                if structure is not None:
                    known[frame] = _Arm(chain, wide, structure, joint, lines(model))
                    break
            else:
                locked = lines(model, {ANY_JOINT: 0.4})
                known[frame] = _Arm(chain, wide, None, ANY_JOINT, lines(model), locked)
    return known[frame]


def _when_locked(model: ChainModel, joint: int) -> Structure | None:
    """The exact closed form that locking *joint* leaves at several values: so by structure, not by chance."""
    found = [detect(lines(model, {joint: value})) for value in (-0.7, 0.4, 1.3)]
    first = found[0]
    if first is None:
        return None
    for s in found:
        if s is None or s.deviation > EXACT or (s.family, s.backwards) != (first.family, first.backwards):
            return None
    return first


def tip_of(robot: Robot) -> str:
    """The frame at the end of the only, or the longest, chain of joints: what an arm without a named tool means."""
    depth = {robot.description.root: 0}
    for joint in robot.description.joints:
        depth[joint.child] = depth[joint.parent] + (joint.type.value != "fixed")
    most = max(depth.values())
    ends = [name for name in robot.frame_names if depth[name] == most]
    return ends[-1]


def redundant_joint(robot: Robot, frame: str) -> str | None:
    """The joint of a seven-joint arm whose angle is the parameter of its branches; None if the arm needs none."""
    arm = _arm(robot, frame)
    if arm.locked < 0:
        return None
    return robot.joint_names[int(robot.chain_model(frame).coordinate[arm.locked])]


def branches(
    robot: Robot,
    T: ArrayLike,
    frame: str | None = None,
    *,
    redundancy: ArrayLike | None = None,
    limits: bool = True,
    q0: ArrayLike | None = None,
) -> BranchResult:
    """Every joint vector that brings *frame* to ``T (..., 4, 4)``, by the closed form that fits the arm's axes.

    Six revolute joints with three neighbouring axes that meet at one end of the arm (a wrist, or a shoulder), or with
    parallel axes 2, 3, 4 (or 3, 4, 5): up to eight branches. Seven joints that become such an arm when one is locked
    (spherical–revolute–spherical arms, the Panda): *redundancy* ``(...)`` is the angle of `redundant_joint`, in rad.
    Planar arms of up to three joints and SCARA arms: up to two. Six revolute joints in any other position: up to
    sixteen, by elimination and an eigenvalue problem (`general`), about a hundred times slower. What fits is found from
    the axes. An arm whose axes are slightly off (a calibrated one) gets the ideal branches, refined by Newton steps on
    its true axes. At a singularity that leaves a continuum of joint vectors, one member stands for it.

    With *limits* only branches within the position limits are returned, on the turn nearest to *q0* ``(..., n)`` or to
    the middle of the limits; else all, in (−π, π]. Coordinates that do not move the frame keep *q0* or home.
    """
    expect(robot, "Robot", "robot")
    frame = tip_of(robot) if frame is None else frame
    arm = _arm(robot, frame)
    poses, fill, shape = read_targets(robot, as_pose(T, "T"), q0)
    if q0 is None:
        fill, near = robot.home[None], arm.chain.middle[None]
    else:
        near = np.ascontiguousarray(fill[:, arm.chain.free])
    model = robot.chain_model(frame)
    if arm.locked >= 0:
        x, number, family = _seven(robot, frame, arm, poses, redundancy, shape)
    elif arm.structure is not None:
        x, number, family = _six(arm.structure, poses)
    elif arm.general is not None:
        g = arm.general
        x, number = general_branches(g.h[None], g.o[None], g.R0[None], poses, arm.pair)
        family = GENERAL
    else:
        flat = flat_structure(model)
        if flat is None:
            raise InputError(
                f"no closed form fits the {arm.chain.free.size} joints that move frame {frame!r} of robot "
                f"{robot.name!r}; use ik.solve(..., n_solutions=8)"
            )
        x, number, family = flat_branches(flat, model, poses)
    q, valid, residual, codes = _finish(arm, poses, x, number, fill, near, limits)
    outside = np.flatnonzero(codes == LIMITS)
    if outside.size and revolute_only(model) and x.shape[2] >= 6:
        every = _Part(poses, x, number, fill, near)
        _move_within(robot, frame, arm, every.rows(outside), outside, (q, valid, residual, codes))
    return BranchResult(
        q=q.reshape(*shape, valid.shape[1], robot.n),
        valid=valid.reshape(*shape, valid.shape[1]),
        residual=residual.reshape(*shape, valid.shape[1]),
        codes=codes.reshape(shape),
        family=family,
    )


def _run(structure: Structure, poses: Array, h: Array, o: Array, R0: Array) -> tuple[Array, IntArray]:
    """Candidates ``(N, MOST, 6)`` of the six joints in the arm's order and how many, for one or N geometries."""
    count = poses.shape[0]
    out = np.zeros((count, kernels.MOST, 6))
    number = np.zeros(count, dtype=np.int64)
    if structure.backwards:
        T = np.zeros_like(poses)
        T[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
        T[:, :3, 3] = -np.einsum("nji,nj->ni", poses[:, :3, :3], poses[:, :3, 3])
        T[:, 3, 3] = 1.0
        poses = T
    rows = np.ascontiguousarray(poses).reshape(count, 16)
    slack = kernels.EXACT if structure.deviation <= EXACT else 20.0 * structure.deviation

    def work(first: int, last: int) -> None:
        kernels.branches(structure.family, h, o, R0, slack, rows, first, last, out, number)

    over_ranges(work, count, GRAIN)
    if structure.backwards:
        out = np.ascontiguousarray(out[:, :, ::-1])
    return out, number


def _six(structure: Structure, poses: Array) -> tuple[Array, IntArray, str]:
    g = structure.geometry
    x, number = _run(structure, poses, g.h[None], g.o[None], np.ascontiguousarray(g.R0)[None])
    return x, number, structure.name


def _seven(
    robot: Robot, frame: str, arm: _Arm, poses: Array, redundancy: ArrayLike | None, shape: tuple[int, ...]
) -> tuple[Array, IntArray, str]:
    joint = arm.locked
    model = robot.chain_model(frame)
    name = robot.joint_names[int(model.coordinate[joint])]
    if redundancy is None:
        raise InputError(
            f"robot {robot.name!r} has one joint more than a pose needs: give redundancy, the angle of joint {name!r} "
            "in rad (ik.redundancy_intervals lists the feasible ones)"
        )
    values = as_shaped(redundancy, "redundancy")
    try:
        values = np.broadcast_to(values, shape).reshape(-1)
    except ValueError as error:
        raise InputError(f"redundancy has shape {values.shape}, T has batch shape {shape}; they must match") from error
    assert arm.seven is not None
    at = locked_geometry(arm.seven, joint, values)
    if arm.structure is None:
        six, number = general_branches(*at, poses, arm.pair)
        family = GENERAL
    else:
        six, number = _run(arm.structure, poses, *idealised(arm.structure, *at))
        family = arm.structure.name
    x = np.insert(six, joint, values[:, None], axis=2)
    return np.ascontiguousarray(x), number, f"{family}, with joint {name!r} locked"


def _finish(
    arm: _Arm, poses: Array, x: Array, number: IntArray, fill: Array, near: Array, limits: bool
) -> tuple[Array, BoolArray, Array, IntArray]:
    """Refine the candidates on the true chain; drop what does not reach, doubles, and what leaves the limits."""
    chain = arm.chain
    count = x.shape[0]
    most = max(int(number.max(initial=0)), 1)
    q = np.empty((count, most, fill.shape[1]))
    valid = np.zeros((count, most), dtype=bool)
    residual = np.zeros((count, most))
    codes = np.zeros(count, dtype=np.int64)
    targets = chain.targets(poses)

    def work(first: int, last: int) -> None:
        finish(
            arm.free, chain.unit, targets, number, x, near, chain.lower, chain.upper, limits, chain.free, fill, first,
            last, q, valid, residual, codes,
        )  # fmt: skip

    over_ranges(work, count, GRAIN)
    return q, valid, residual, codes


class _Part(NamedTuple):
    """What `_finish` reads of a batch of targets."""

    poses: Array
    x: Array
    number: IntArray
    fill: Array
    near: Array

    def rows(self, index: IntArray) -> _Part:
        """The targets *index* alone."""
        fill, near = (v if v.shape[0] == 1 else v[index] for v in (self.fill, self.near))
        return _Part(self.poses[index], self.x[index], self.number[index], fill, near)


def _move_within(
    robot: Robot, frame: str, arm: _Arm, part: _Part, place: IntArray, out: tuple[Array, BoolArray, Array, IntArray]
) -> None:
    """Write into rows *place* of *out* a branch within the limits where a singularity leaves one to be chosen."""
    chain, column = arm.chain, arm.free.column
    q, valid, _, _ = _finish(arm, *part, limits=False)
    owner, which = np.nonzero(valid)
    q = q[owner, which]
    six = np.delete(chain.free[column], arm.locked) if arm.locked >= 0 else chain.free[column]
    at, moves = self_motions(robot, frame, q, six)
    lower, upper = robot.limits.lower[six], robot.limits.upper[six]
    good, moved = within_limits(q[at][:, six], moves, lower, upper)
    if not good.size:
        return
    q, owner = q[at[good]], owner[at[good]]
    q[:, six] = moved
    near = part.near if part.near.shape[0] == 1 else part.near[owner]
    fill = part.fill if part.fill.shape[0] == 1 else part.fill[owner]
    x = np.ascontiguousarray(q[:, None, chain.free[column]])
    q, valid, residual, codes = _finish(
        arm, part.poses[owner], x, np.ones(owner.size, np.int64), fill, near, limits=True
    )
    for i in np.flatnonzero(codes == 0)[::-1]:
        row = place[owner[i]]
        out[0][row], out[1][row], out[2][row], out[3][row] = q[i], False, 0.0, 0
        out[1][row, 0], out[2][row, 0] = True, residual[i, 0]


def redundancy_intervals(
    robot: Robot, T: ArrayLike, frame: str | None = None, *, samples: int = 720, tolerance: float = 1e-6
) -> Array:
    """Intervals ``(m, 2)`` of the redundant joint's angle for which some branch reaches ``T (4, 4)`` within the limits.

    Found by *samples* evaluations of the closed form over the joint's range and bisection of every change to
    *tolerance* rad; an interval shorter than the spacing may be missed.
    """
    T = as_pose(T, "T")
    if T.shape != (4, 4):
        raise InputError(f"T has shape {T.shape}; expected one pose (4, 4)")
    frame = tip_of(robot) if frame is None else frame
    if samples < 2:
        raise InputError(f"samples is {samples}; expected 2 or more")
    if not tolerance > 0.0:
        raise InputError(f"tolerance is {tolerance}; expected a positive number")
    name = redundant_joint(robot, frame)
    if name is None:
        raise InputError(f"frame {frame!r} of robot {robot.name!r} has no redundant joint")
    joint = robot.index(name)
    low = max(float(robot.limits.lower[joint]), -math.pi)
    high = min(float(robot.limits.upper[joint]), math.pi)
    grid = np.linspace(low, high, samples)

    def feasible(values: Array) -> Any:
        poses = np.broadcast_to(T, (values.size, 4, 4))
        return branches(robot, poses, frame, redundancy=values).success

    good = feasible(grid)
    at = np.flatnonzero(good[1:] != good[:-1])
    a, b = grid[at].copy(), grid[at + 1].copy()
    while at.size and (b - a).max() > tolerance:
        middle = 0.5 * (a + b)
        same = feasible(middle) == good[at]
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    edges = np.where(good[at], a, b)
    bounds = np.concatenate([[low] if good[0] else [], edges, [high] if good[-1] else []])
    return bounds.reshape(-1, 2)
