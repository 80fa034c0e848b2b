"""The MJCF reader: MuJoCo itself reads, includes and compiles the file; what it compiled becomes a `Description`.

So defaults, nested includes, inertias from geometry and every orientation syntax mean exactly what they mean in the
simulator. The root is the world body, so that poses equal MuJoCo's. A body with several joints, or with a joint that
does not sit at its origin, gets massless links between; the frame of the body keeps its name. Joint equalities that are
linear become mimics, fixed tendons and motors become `Tendon` and `Actuator`. Free and ball joints become chains of
single joints and are reported, as is everything that a tree of joints cannot say.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, choice
from ..errors import DescriptionError, MeshError
from .description import (
    Actuator,
    Description,
    Inertial,
    Joint,
    JointLimits,
    JointType,
    Link,
    Loop,
    Mimic,
    Repair,
    Tendon,
)
from .export_mjcf import UNLIMITED
from .mjcf_files import check_files
from .mjcf_shapes import body_shapes
from .paths import MeshPaths, Packages
from .poses import from_quaternion, motion, shift, turn
from .tree import ordered, resolved_mimics


def read_mjcf(
    path: str | Path, *, packages: Packages = None, meshes: str = "require", loops: str = "refuse"
) -> Description:
    """Read an MJCF file.

    *packages*: further folders that the file may read from. *meshes*: ``"require"`` that every mesh file exists, or
    ``"ignore"`` missing ones (reported). *loops* (equalities that close a chain): ``"refuse"``, or ``"cut"`` them and
    list them in `Description.loops`. Raises `DescriptionError` or `MeshError`.
    """
    choice(loops, "loops", ("refuse", "cut"))
    path = Path(path)
    model, repairs, name = _compile(path, packages, meshes)
    return _Compiled(model, path, repairs, loops).read(name)


def compiled_file(path: Path) -> tuple[Any, list[Repair]]:
    """The compiled model of an MJCF file, and what had to be repaired."""
    model, repairs, _ = _compile(path, None, "require")
    return model, repairs


def _compile(path: Path, packages: Packages, meshes: str) -> tuple[Any, list[Repair], str]:
    choice(meshes, "meshes", ("require", "ignore"))
    paths = MeshPaths(path, packages)
    document = check_files(path, paths)
    import mujoco

    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise DescriptionError(f"{path}: {_one_line(error)}") from None
    repairs = list(document.repairs)
    _missing_meshes(spec, path, meshes, repairs)
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            model = spec.compile()
    except ValueError as error:
        raise DescriptionError(f"{path}: {_one_line(error)}") from None
    repairs += [Repair(path.name, _one_line(w.message), "read as MuJoCo reads it") for w in said]
    for mesh in spec.meshes:
        if np.any(mesh.refpos) or not np.array_equal(mesh.refquat, [1.0, 0.0, 0.0, 0.0]):
            model.mesh_pathadr[mesh.id] = -1  # moved against its file: taken as compiled
    return model, repairs, document.root.get("model") or path.stem


def _one_line(error: Exception | Warning | str) -> str:
    return " ".join(str(error).split())


def _missing_meshes(spec: Any, path: Path, meshes: str, repairs: list[Repair]) -> None:
    folder = path.parent / (spec.compiler.meshdir or "")
    for mesh in list(spec.meshes):
        if not mesh.file or (folder / mesh.file).is_file():
            continue
        if meshes == "require":
            raise MeshError(f"{path}: mesh {mesh.file!r} does not exist (looked for {(folder / mesh.file).resolve()}); "
                            "meshes='ignore' loads without it")  # fmt: skip
        repairs.append(Repair(path.name, f"mesh {mesh.file!r} was not found", "left its shapes out, as asked"))
        name = mesh.name or Path(mesh.file).stem
        for geom in [g for g in spec.geoms if g.meshname == name]:
            spec.delete(geom)
        spec.delete(mesh)


class _Compiled:
    """A compiled model on its way to a description."""

    def __init__(self, model: Any, path: Path, repairs: list[Repair], loops: str) -> None:
        import mujoco

        self.mj = mujoco
        self.m = model
        self.path = path
        self.repairs = repairs
        self.cut = loops == "cut"
        self.links: dict[str, Link] = {}
        self.joints: list[Joint] = []
        self.loops: list[Loop] = []
        self.body = [model.body(i).name or f"body{i}" for i in range(model.nbody)]
        self.joint = [model.jnt(i).name or f"{self.body[model.jnt_bodyid[i]]}_joint{i}" for i in range(model.njnt)]
        self.coordinates: dict[int, list[str]] = {}  # joint number → names of our joints

    def report(self, what: str, problem: str, remedy: str) -> None:
        self.repairs.append(Repair(f"{self.path.name}, {what}", problem, remedy))

    def read(self, name: str) -> Description:
        m = self.m
        for i in range(m.nbody):
            self._body(i)
        mimics, fixed = self._equalities()
        self.joints = [self._coupled(j, mimics, fixed) for j in self.joints]
        actuators, effort = self._actuators()
        self.joints = [
            replace(j, limits=replace(j.limits, effort=min(j.limits.effort, effort.get(j.name, math.inf))))
            for j in self.joints
        ]
        root, joints = ordered(self.links, self.joints, lambda _: str(self.path))
        joints = resolved_mimics(joints, lambda _: self.path.name, self.repairs)
        return Description(
            name=name,
            root=root,
            links=self.links,
            joints=joints,
            home=self._home(),
            allowed_collisions=self._excluded(),
            repairs=tuple(self.repairs),
            source=self.path,
            tendons=self._tendons(),
            actuators=actuators,
            loops=tuple(self.loops),
        )

    # ---- bodies and joints

    def _body(self, i: int) -> None:
        m, name = self.m, self.body[i]
        inertial = None
        if i and (m.body_mass[i] > 0.0 or m.body_inertia[i].any()):
            R = from_quaternion(np.zeros(3), m.body_iquat[i])[:3, :3]
            inertial = Inertial(float(m.body_mass[i]), m.body_ipos[i].copy(), (R * m.body_inertia[i]) @ R.T)
        visuals, collisions = body_shapes(m, i, self.path, self.report)
        self.links[name] = Link(name, inertial, visuals, collisions)
        if not i:
            return
        pose, parent = from_quaternion(m.body_pos[i], m.body_quat[i]), self.body[m.body_parentid[i]]
        first, count = int(m.body_jntadr[i]), int(m.body_jntnum[i])
        for k in range(first, first + count):
            parent, pose = self._joint(k, parent, pose, name, last=k == first + count - 1)
        if parent != name:
            self._add(Joint(f"{name}_fixed", JointType.FIXED, parent, name, pose))

    def _joint(self, k: int, parent: str, pose: Array, body: str, *, last: bool) -> tuple[str, Array]:
        """Add joint *k*; returns the link that it carries and the pose of what follows in that link."""
        m, kind, name = self.m, int(self.m.jnt_type[k]), self.joint[k]
        types = self.mj.mjtJoint
        anchor = shift(m.jnt_pos[k])
        if kind in (types.mjJNT_FREE, types.mjJNT_BALL):
            return self._chain(k, parent, pose, body, anchor, free=kind == types.mjJNT_FREE, last=last)
        axis = m.jnt_axis[k] / np.linalg.norm(m.jnt_axis[k])
        reference = float(m.qpos0[m.jnt_qposadr[k]])
        limited = bool(m.jnt_limited[k])
        lower, upper = _range(m.jnt_range[k], limited)
        if kind == types.mjJNT_SLIDE:
            type_ = JointType.PRISMATIC
            back = shift(-reference * axis)
        else:
            type_ = JointType.REVOLUTE if limited else JointType.CONTINUOUS
            back = turn(axis, -reference)
        if kind == types.mjJNT_SLIDE:
            anchor = np.eye(4)
        dof = int(m.jnt_dofadr[k])
        bound = m.jnt_actfrcrange[k] if m.jnt_actfrclimited[k] else (-math.inf, math.inf)
        child = body if last and not anchor[:3, 3].any() else f"{body}__{name}"
        if child != body:
            self.links[child] = Link(child)
        self._add(
            Joint(
                name, type_, parent, child, pose @ anchor @ back, axis,
                JointLimits(lower, upper, effort=float(max(abs(bound[0]), abs(bound[1])))),
                damping=float(m.dof_damping[dof]), friction=float(m.dof_frictionloss[dof]),
                armature=float(m.dof_armature[dof]),
            )
        )  # fmt: skip
        self.coordinates[k] = [name]
        anchor[:3, 3] *= -1.0
        return child, anchor

    def _chain(
        self, k: int, parent: str, pose: Array, body: str, anchor: Array, *, free: bool, last: bool
    ) -> tuple[str, Array]:
        """A free or ball joint as single joints about and along x, y, z of the parent."""
        name, (x, y, z) = self.joint[k], np.eye(3)
        steps = [
            ("yaw", JointType.CONTINUOUS, z),
            ("pitch", JointType.CONTINUOUS, y),
            ("roll", JointType.CONTINUOUS, x),
        ]
        if free:
            slides = [("x", JointType.PRISMATIC, x), ("y", JointType.PRISMATIC, y), ("z", JointType.PRISMATIC, z)]
            steps = slides + steps
            anchor = np.eye(4)
        self.coordinates[k] = [f"{name}_{suffix}" for suffix, _, _ in steps]
        start = pose @ anchor
        for n, (suffix, type_, axis) in enumerate(steps):
            final = n == len(steps) - 1
            child = body if final and last and not anchor[:3, 3].any() else f"{body}__{name}_{suffix}"
            if child != body:
                self.links[child] = Link(child)
            self._add(Joint(f"{name}_{suffix}", type_, parent, child, start, axis))
            parent, start = child, np.eye(4)
        what = "free" if free else "ball"
        self.report(f"joint {name!r}", f"is a {what} joint", f"read as single joints {', '.join(self.coordinates[k])}")
        anchor[:3, 3] *= -1.0
        return parent, anchor

    def _add(self, joint: Joint) -> None:
        self.joints.append(joint)

    # ---- couplings

    def _equalities(self) -> tuple[Mapping[str, Mimic], Mapping[str, float]]:
        """Mimics and constants from joint equalities; loops from those that close a chain."""
        m, kinds = self.m, self.mj.mjtEq
        mimics: dict[str, Mimic] = {}
        fixed: dict[str, float] = {}
        for i in range(m.neq):
            if not m.eq_active0[i]:
                continue
            kind, data = int(m.eq_type[i]), m.eq_data[i]
            what = f"equality {m.eq(i).name or i!r}"
            a, b = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
            if kind == kinds.mjEQ_JOINT:
                if data[2:5].any():
                    self.report(what, "couples joints by a polynomial of degree 2 or more", "left them free")
                    continue
                y0 = float(m.qpos0[m.jnt_qposadr[a]])
                if b < 0:
                    fixed[self.joint[a]] = y0 + float(data[0])
                    continue
                x0 = float(m.qpos0[m.jnt_qposadr[b]])
                slope = float(data[1])
                mimics[self.joint[a]] = Mimic(self.joint[b], slope, y0 + float(data[0]) - slope * x0)
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                self._loop(i, what, kind == kinds.mjEQ_CONNECT, a, b)
            else:
                self.report(what, "couples tendons or flexible bodies", "left it out")
        return mimics, fixed

    def _loop(self, i: int, what: str, point: bool, a: int, b: int) -> None:
        m, data = self.m, self.m.eq_data[i]
        first, second = np.eye(4), np.eye(4)
        if int(m.eq_objtype[i]) == int(self.mj.mjtObj.mjOBJ_SITE):
            first, second = (from_quaternion(m.site_pos[s], m.site_quat[s]) for s in (a, b))
            a, b = int(m.site_bodyid[a]), int(m.site_bodyid[b])
        elif point:
            first[:3, 3], second[:3, 3] = data[:3], data[3:6]
        else:
            first, second = from_quaternion(data[3:6], data[6:10]), np.eye(4)
            second[:3, 3] = data[:3]
        if not self.cut:
            raise DescriptionError(
                f"{self.path}: {what} closes a chain: it ties body {self.body[a]!r} to {self.body[b]!r}; pass "
                "loops='cut' to read the tree without it (it is then listed in description.loops)"
            )
        name = m.eq(i).name or f"loop{i}"
        self.loops.append(Loop(name, self.body[a], self.body[b], first, second, "point" if point else "pose"))
        self.report(what, f"ties body {self.body[a]!r} to {self.body[b]!r}: a closed chain", "cut it, as asked")

    def _coupled(self, joint: Joint, mimics: Mapping[str, Mimic], fixed: Mapping[str, float]) -> Joint:
        if joint.name in mimics:
            return replace(joint, mimic=mimics[joint.name])
        if joint.name in fixed:
            pose = joint.pose @ motion(joint, fixed[joint.name])
            return replace(joint, type=JointType.FIXED, pose=pose, limits=JointLimits())
        return joint

    def _tendon_arms(self, t: int) -> dict[str, float] | None:
        """Joint → arm of a fixed tendon; None for a tendon in space."""
        m = self.m
        arms: dict[str, float] = {}
        for w in range(int(m.tendon_adr[t]), int(m.tendon_adr[t] + m.tendon_num[t])):
            if int(m.wrap_type[w]) != int(self.mj.mjtWrap.mjWRAP_JOINT):
                return None
            joint = self.joint[int(m.wrap_objid[w])]
            arms[joint] = arms.get(joint, 0.0) + float(m.wrap_prm[w])
        return arms

    def _tendons(self) -> tuple[Tendon, ...]:
        m = self.m
        found = []
        for t in range(m.ntendon):
            arms, name = self._tendon_arms(t), m.tendon(t).name or f"tendon{t}"
            if arms is None:
                self.report(
                    f"tendon {name!r}", "runs through space, so that its arms change with the posture", "left it out"
                )
                continue
            lower, upper = _range(m.tendon_range[t], m.tendon_limited[t])
            found.append(Tendon(name, arms, lower, upper))
        return tuple(found)

    def _actuators(self) -> tuple[tuple[Actuator, ...], Mapping[str, float]]:
        """Motors on joints and fixed tendons, and the largest torque that motors of its own give each joint."""
        m, kinds = self.m, self.mj.mjtTrn
        found = []
        effort: dict[str, float] = {}
        for u in range(m.nu):
            name, gear = m.actuator(u).name or f"actuator{u}", float(m.actuator_gear[u, 0])
            target = int(m.actuator_trnid[u, 0])
            kind = int(m.actuator_trntype[u])
            arms: dict[str, float] | None = None
            if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT) and len(self.coordinates[target]) == 1:
                arms = {self.joint[target]: gear}
            elif kind == kinds.mjTRN_TENDON:
                tendon = self._tendon_arms(target)
                arms = None if tendon is None else {j: gear * arm for j, arm in tendon.items()}
            if arms is None:
                self.report(f"actuator {name!r}", "acts on neither a single joint nor a fixed tendon", "left it out")
                continue
            lower, upper = self._force_range(u)
            found.append(Actuator(name, arms, lower, upper))
            if len(arms) == 1:
                joint, strongest = next(iter(arms)), abs(gear) * max(abs(lower), abs(upper))
                effort[joint] = effort.get(joint, 0.0) + strongest
        return tuple(found), effort

    def _force_range(self, u: int) -> tuple[float, float]:
        m = self.m
        if m.actuator_forcelimited[u]:
            return _range(m.actuator_forcerange[u])
        direct = (
            int(m.actuator_gaintype[u]) == int(self.mj.mjtGain.mjGAIN_FIXED)
            and int(m.actuator_biastype[u]) == int(self.mj.mjtBias.mjBIAS_NONE)
            and int(m.actuator_dyntype[u]) == int(self.mj.mjtDyn.mjDYN_NONE)
        )
        if direct and m.actuator_ctrllimited[u]:
            ends = sorted(float(m.actuator_gainprm[u, 0] * c) for c in m.actuator_ctrlrange[u])
            return ends[0], ends[1]
        return -math.inf, math.inf

    def _home(self) -> dict[str, float]:
        """The keyframe named home, or the only one; else the reference positions where they are not zero."""
        m = self.m
        names = [m.key(k).name for k in range(m.nkey)]
        q = m.qpos0
        if "home" in names:
            q = m.key_qpos[names.index("home")]
        elif len(names) == 1:
            q = m.key_qpos[0]
        home = {}
        free = {j.name for j in self.joints if j.mimic is None and j.type is not JointType.FIXED}
        for k, ours in self.coordinates.items():
            if len(ours) == 1 and ours[0] in free:
                value = float(q[m.jnt_qposadr[k]])
                if m.nkey or value:
                    home[ours[0]] = value
        return home

    def _excluded(self) -> frozenset[frozenset[str]]:
        pairs = set()
        for signature in self.m.exclude_signature:
            pairs.add(frozenset((self.body[int(signature) >> 16], self.body[int(signature) & 0xFFFF])))
        return frozenset(p for p in pairs if len(p) == 2)


def _range(ends: Array, limited: bool = True) -> tuple[float, float]:
    """The two ends of a range; what is as large as `UNLIMITED`, or not *limited*, is infinite."""
    lower, upper = (float(end) for end in ends)
    if not limited:
        return -math.inf, math.inf
    return (-math.inf if lower <= -UNLIMITED else lower), (math.inf if upper >= UNLIMITED else upper)
