"""A MuJoCo model of a whole scene, taken apart: the robot, the bodies that move freely, and what stands still."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import DescriptionError, InputError, unknown_name
from .combine import without
from .description import Description, Repair, Shape
from .mjcf import _Compiled, compiled_file
from .mjcf_shapes import body_shapes
from .poses import from_quaternion


@dataclass(frozen=True, eq=False)
class FreeBody:
    """A body with a free joint, and what is fixed to it."""

    name: str
    pose: Array  # (4, 4) in the world
    shapes: tuple[Shape, ...]  # what touches, in its frame
    mass: float
    com: Array  # (3,)
    inertia: Array  # (3, 3) about the centre of mass
    friction: float


@dataclass(frozen=True, eq=False)
class FixedThing:
    """One geom that stands still: a shape, a plane (whose normal is z of its pose), or a surface of triangles."""

    name: str
    body: str  # that it belongs to
    pose: Array  # (4, 4) in the world
    shape: Shape | None  # at its pose in the world; None: a plane, or *surface*
    surface: tuple[Array, IntArray] | None
    rgba: tuple[float, float, float, float]
    friction: float
    radii: Array | None = None  # of an ellipsoid, which *shape* encloses


@dataclass(frozen=True, eq=False)
class World:
    """The parts of a model; poses are those of its keyframe ``home`` (or only one), else of its reference."""

    description: Description
    bodies: tuple[FreeBody, ...]
    fixed: tuple[FixedThing, ...]
    gravity: float  # m/s², along −z
    excluded: frozenset[frozenset[str]]  # pairs of the model's bodies that never touch
    source: Path | None


def read_world(source: object, robot: str | None = None) -> World:
    """Take a model apart: *source* is the path of an MJCF file, or a compiled ``mujoco.MjModel``.

    The robot is what hangs on the world by joints other than a free one: all that has motors, or, without motors, the
    tree with the most joints; or the tree of the body *robot*. Its root is the world, and frames keep their names.
    Other trees with joints stand still in their posture, which `Description.repairs` says. Geoms that touch nothing
    (contype and conaffinity 0) are only seen, and are no obstacles.
    """
    import mujoco

    repairs: list[Repair] = []
    if isinstance(source, mujoco.MjModel):
        model, path = source, Path("the model")
    elif isinstance(source, str | Path):
        path = Path(source)
        model, repairs = compiled_file(path)
    else:
        raise InputError(f"source is a {type(source).__name__}; expected the path of an MJCF file or a mujoco.MjModel")
    return _World(model, path, repairs, isinstance(source, mujoco.MjModel)).read(robot)


class _World:
    """A compiled model on its way to a world."""

    def __init__(self, model: Any, path: Path, repairs: list[Repair], bare: bool) -> None:
        import mujoco

        self.mj, self.m, self.path, self.bare, self.repairs = mujoco, model, path, bare, repairs
        self.data = mujoco.MjData(model)
        names = [model.key(k).name for k in range(model.nkey)]
        if "home" in names or len(names) == 1:
            mujoco.mj_resetDataKeyframe(model, self.data, names.index("home") if "home" in names else 0)
        mujoco.mj_kinematics(model, self.data)
        self.body = [model.body(i).name or f"body{i}" for i in range(model.nbody)]
        self.top = np.zeros(model.nbody, np.int64)  # the body under the world that carries each body
        for i in range(1, model.nbody):
            parent = int(model.body_parentid[i])
            self.top[i] = i if parent == 0 else self.top[parent]

    def read(self, robot: str | None) -> World:
        m = self.m
        joints: dict[int, list[int]] = {}
        for j in range(m.njnt):
            joints.setdefault(int(self.top[m.jnt_bodyid[j]]), []).append(j)
        free = [b for b, js in joints.items() if len(js) == 1 and m.jnt_type[js[0]] == self.mj.mjtJoint.mjJNT_FREE]
        trees = {b: js for b, js in joints.items() if b not in free}
        chosen = self._robot(trees, robot)
        description = _Compiled(m, self.path, list(self.repairs), "cut").read(self._model_name())
        still = [b for b in trees if b not in chosen]
        for b in range(1, m.nbody):
            if self.top[b] == b and b not in chosen:
                description = without(description, self._first_link(description, b))
        world = description.links[description.root]
        notes = tuple(
            Repair(f"{self.path.name}, body {self.body[b]!r}", "moves by joints without belonging to the robot",
                   "left it standing in its posture") for b in still
        )  # fmt: skip
        elsewhere = ("is a free joint", "is a plane, a height field")  # which are taken over as such
        kept = tuple(r for r in description.repairs if not r.problem.startswith(elsewhere))
        description = replace(
            description,
            links={**description.links, world.name: replace(world, visuals=(), collisions=())},
            repairs=kept + notes,
            source=None if self.bare else self.path,
        )
        standing = [b for b in range(m.nbody) if self.top[b] not in chosen and self.top[b] not in free]
        return World(
            description,
            tuple(self._free(b) for b in sorted(free)),
            tuple(thing for b in standing for thing in self._fixed(b)),
            -float(m.opt.gravity[2]),
            self._excluded(),
            None if self.bare else self.path,
        )

    def _excluded(self) -> frozenset[frozenset[str]]:
        numbers = [(int(s) >> 16, int(s) & 0xFFFF) for s in self.m.exclude_signature]
        return frozenset(frozenset((self.body[a], self.body[b])) for a, b in numbers)

    def _model_name(self) -> str:
        return self.m.names[: self.m.names.index(b"\0")].decode() or self.path.stem

    def _robot(self, trees: dict[int, list[int]], robot: str | None) -> set[int]:
        if not trees:
            raise DescriptionError(f"{self.path}: no body moves by a joint other than a free one, so there is no robot")
        if robot is not None:
            if robot not in self.body:
                unknown_name("body", robot, self.body[1:], str(self.path))
            top = int(self.top[self.body.index(robot)])
            if top not in trees:
                raise DescriptionError(f"{self.path}: body {robot!r} has no joints of its own, so it is no robot")
            return {top}
        m = self.m
        kinds = self.mj.mjtTrn
        driven = set()
        for u in range(m.nu):
            target, kind = int(m.actuator_trnid[u, 0]), int(m.actuator_trntype[u])
            numbers = [target] if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT) else []
            if kind == kinds.mjTRN_TENDON:
                wraps = range(int(m.tendon_adr[target]), int(m.tendon_adr[target] + m.tendon_num[target]))
                numbers = [int(m.wrap_objid[w]) for w in wraps if m.wrap_type[w] == self.mj.mjtWrap.mjWRAP_JOINT]
            driven |= {int(self.top[m.jnt_bodyid[j]]) for j in numbers}
        return {b for b in trees if b in driven} or {max(trees, key=lambda b: len(trees[b]))}

    def _first_link(self, description: Description, body: int) -> str:
        """The first link beyond the world on the way to a body under it."""
        parents, link = description.parent_joint, self.body[body]
        while parents[link].parent != description.root:
            link = parents[link].parent
        return link

    def _place(self, b: int) -> Array:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.data.xmat[b].reshape(3, 3), self.data.xpos[b]
        return T

    def _free(self, top: int) -> FreeBody:
        m, base = self.m, np.linalg.inv(self._place(top))
        shapes: list[Shape] = []
        mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
        frictions = []
        for b in (b for b in range(m.nbody) if self.top[b] == top):
            T = base @ self._place(b)
            _, collisions = body_shapes(m, b, self.path, self._note)
            shapes += [replace(shape, pose=T @ shape.pose) for shape in collisions]
            R = T[:3, :3] @ from_quaternion(np.zeros(3), m.body_iquat[b])[:3, :3]
            c, own = T[:3, :3] @ m.body_ipos[b] + T[:3, 3], float(m.body_mass[b])
            mass, first = mass + own, first + own * c
            second += (R * m.body_inertia[b]) @ R.T + own * (c @ c * np.eye(3) - np.outer(c, c))
            begin, end = int(m.body_geomadr[b]), int(m.body_geomadr[b] + m.body_geomnum[b])
            frictions += [float(m.geom_friction[g, 0]) for g in range(begin, end)]
        com = first / mass if mass > 0.0 else first
        inertia = second - mass * (com @ com * np.eye(3) - np.outer(com, com))
        friction = max(frictions, default=1.0)
        return FreeBody(self.body[top], self._place(top), tuple(shapes), mass, com, inertia, friction)

    def _note(self, what: str, problem: str, remedy: str) -> None:
        self.repairs.append(Repair(f"{self.path.name}, {what}", problem, remedy))

    def _fixed(self, b: int) -> list[FixedThing]:
        m, kinds = self.m, self.mj.mjtGeom
        T = self._place(b)
        found = []
        geoms = range(int(m.body_geomadr[b]), int(m.body_geomadr[b] + m.body_geomnum[b]))
        touching = [g for g in geoms if m.geom_contype[g] or m.geom_conaffinity[g]]
        for g in touching:
            alone = b > 0 and len(touching) == 1
            name = m.geom(g).name or (self.body[b] if alone else f"{self.body[b]}_geom{g}")
            rgba = m.geom_rgba[g] if m.geom_matid[g] < 0 else m.mat_rgba[m.geom_matid[g]]
            colour = (float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3]))
            pose = T @ from_quaternion(m.geom_pos[g], m.geom_quat[g])
            shape, surface = None, None
            if m.geom_type[g] == kinds.mjGEOM_HFIELD:
                surface = height_field(m, int(m.geom_dataid[g]))
            elif m.geom_type[g] != kinds.mjGEOM_PLANE:
                shape = self._shape(b, g, T)
                if shape is None:
                    continue
            radii = m.geom_size[g].copy() if m.geom_type[g] == kinds.mjGEOM_ELLIPSOID else None
            friction = float(m.geom_friction[g, 0])
            found.append(FixedThing(name, self.body[b], pose, shape, surface, colour, friction, radii))
        return found

    def _shape(self, b: int, g: int, T: Array) -> Shape | None:
        from .mjcf_shapes import _shape

        shape = _shape(self.m, g, self.path, self._note)
        return None if shape is None else replace(shape, pose=T @ shape.pose)


def height_field(m: Any, number: int) -> tuple[Array, IntArray]:
    """The upper surface of a height field as triangles in the frame of its geom."""
    rows, columns, start = int(m.hfield_nrow[number]), int(m.hfield_ncol[number]), int(m.hfield_adr[number])
    x, y, top, _ = (float(s) for s in m.hfield_size[number])
    height = np.asarray(m.hfield_data[start : start + rows * columns], dtype=np.float64).reshape(rows, columns) * top
    u, v = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    vertices = np.stack([u, v, height], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + columns + 1], axis=1),
            np.stack([corner, corner + columns + 1, corner + columns], axis=1),
        ]
    )
    return vertices, faces.astype(np.int64)
