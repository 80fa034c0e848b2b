"""The URDF reader: every feature of the format, each message with file and line, each repair reported.

Decisions. Soft limits of a ``safety_controller`` belong to a controller and are not read. A velocity or effort limit
of zero means "not given" in the files that carry it; it is read as unlimited and reported. Acceleration limits are
read from ``drake:acceleration`` (or ``acceleration``) of ``<limit>``. A planar joint becomes two prismatic joints and
a revolute one, a floating joint three prismatic ones and yaw, pitch and roll; both are reported. Without an ``<axis>``
a joint moves about or along x, as the format says. ``rpy`` is extrinsic xyz.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, choice
from ..errors import MeshError
from . import inertia as inertia_rules
from .description import (
    Description,
    Inertial,
    Joint,
    JointLimits,
    JointType,
    Link,
    Loop,
    Mimic,
    Repair,
    Shape,
    ShapeKind,
)
from .markup import Document, extension_attribute, local, plain_children, read_text
from .paths import MeshPaths, Packages
from .poses import from_rpy
from .tree import check_limits, ordered, resolved_mimics
from .urdf_extras import actuators, filter_groups

Rgba = tuple[float, float, float, float]
HUGE = 1e300
"""A limit beyond this is an infinite one: the format wants a number where there is none."""
_JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "planar", "floating")


def read_urdf(
    path: str | Path,
    *,
    packages: Packages = None,
    meshes: str = "require",
    inertias: str = "repair",
    loops: str = "refuse",
) -> Description:
    """Read a URDF file.

    *packages*: folders of the packages that mesh names refer to. *meshes*: ``"require"`` that every mesh file exists,
    or ``"ignore"`` missing ones (reported). *inertias* that no body can have: ``"repair"`` (reported), ``"keep"``, or
    ``"refuse"``. Raises `DescriptionError` or `MeshError` with file and line.
    """
    path = Path(path)
    return parse_urdf(read_text(path), path, packages=packages, meshes=meshes, inertias=inertias, loops=loops)


def parse_urdf(
    text: str | bytes,
    source: str | Path = "<urdf>",
    *,
    packages: Packages = None,
    meshes: str = "require",
    inertias: str = "repair",
    loops: str = "refuse",
) -> Description:
    """Read URDF from *text*; relative mesh names count from the folder of *source*. Options as in `read_urdf`."""
    choice(meshes, "meshes", ("require", "ignore"))
    choice(inertias, "inertias", ("repair", "keep", "refuse"))
    choice(loops, "loops", ("refuse", "cut"))
    data = text.encode() if isinstance(text, str) else text
    return _Reader(Document(data, source), packages, meshes, inertias, loops).read()


class _Reader:
    def __init__(self, document: Document, packages: Packages, meshes: str, inertias: str, loops: str) -> None:
        self.doc = document
        self.paths = MeshPaths(document.source, packages)
        self.meshes, self.inertias, self.cut = meshes, inertias, loops == "cut"
        self.materials: dict[str, Rgba] = {}
        self.links: dict[str, Link] = {}
        self.link_at: dict[str, Any] = {}
        self.joints: dict[str, Joint] = {}
        self.joint_at: dict[str, Any] = {}

    def read(self) -> Description:
        doc, root = self.doc, self.doc.root
        if local(root) != "robot":
            doc.fail(root, f"expected <robot> as the outermost element of a URDF, found <{local(root)}>")
        for element in root:
            if "xacro" in str(element.tag):
                doc.fail(
                    element, f"<{local(element)}> is a xacro macro; expand the file first: xacro in.xacro > out.urdf"
                )
        for element in plain_children(root, "material"):
            self._material(element)
        for element in plain_children(root, "link"):
            self._link(element)
        for element in plain_children(root, "joint"):
            self._joint(element)
        loops = self._cut_loops() if self.cut else ()
        top, joints = ordered(self.links, self.joints.values(), self._where)
        joints = resolved_mimics(joints, self._where, doc.repairs)
        self._massless(joints)
        motors = actuators(doc, self.joints)
        return Description(
            name=root.get("name") or doc.source.stem,
            root=top,
            links=self.links,
            joints=joints,
            allowed_collisions=filter_groups(doc, self.links),
            repairs=tuple(doc.repairs),
            source=doc.source,
            actuators=motors,
            loops=loops,
        )

    def _cut_loops(self) -> tuple[Loop, ...]:
        """Remove every joint whose child already has a parent, and return what it demanded."""
        loops, carried = [], set()
        for joint in list(self.joints.values()):
            if joint.child in carried and joint.parent in self.links:
                free = "pose" if joint.type is JointType.FIXED else joint.type.value
                loops.append(Loop(joint.name, joint.parent, joint.child, joint.pose, np.eye(4), free, joint.axis))
                self.doc.repair(self.joint_at[joint.name], f"joint {joint.name!r} closes a chain at {joint.child!r}",
                                "cut it, as asked")  # fmt: skip
                del self.joints[joint.name]
            carried.add(joint.child)
        return tuple(loops)

    def _where(self, joint: str) -> str:
        element = self.joint_at.get(joint, self.doc.root)
        return f"{self.doc.source}:{element.sourceline}"

    # ---- links

    def _link(self, element: Any) -> None:
        name = self.doc.attribute(element, "name", "link")
        if name in self.links:
            self.doc.fail(element, f"a second link is named {name!r} (the first: line {self.link_at[name].sourceline})")
        what = f"link {name!r}"
        self.link_at[name] = element
        self.links[name] = Link(
            name,
            self._inertial(element, what),
            tuple(s for e in plain_children(element, "visual") if (s := self._shape(e, what))),
            tuple(s for e in plain_children(element, "collision") if (s := self._shape(e, what))),
        )

    def _inertial(self, link: Any, what: str) -> Inertial | None:
        element = next(plain_children(link, "inertial"), None)
        if element is None:
            return None
        doc = self.doc
        pose = self._origin(element, what)
        mass_at = next(plain_children(element, "mass"), None)
        if mass_at is None:
            doc.fail(element, f"{what}: <inertial> lacks <mass>")
        mass = doc.number(mass_at, "value", what)
        if mass < 0.0:
            doc.fail(mass_at, f"{what}: mass is {mass:g} kg; expected zero or more")
        inertia_at = next(plain_children(element, "inertia"), None)
        if inertia_at is None:
            if mass > 0.0:
                doc.repair(element, f"{what} has {mass:g} kg but no <inertia>",
                           "took that of a solid sphere of this mass and 1000 kg/m³")  # fmt: skip
            return Inertial(mass, pose[:3, 3], inertia_rules.solid_sphere(mass))
        v = {k: doc.number(inertia_at, k, what, 0.0 if k in ("ixy", "ixz", "iyz") else None)
             for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}  # fmt: skip
        local_inertia = np.array(
            [[v["ixx"], v["ixy"], v["ixz"]], [v["ixy"], v["iyy"], v["iyz"]], [v["ixz"], v["iyz"], v["izz"]]]
        )
        R = pose[:3, :3]
        inertial = Inertial(mass, pose[:3, 3].copy(), R @ local_inertia @ R.T)
        problem = inertia_rules.check(inertial) if self.inertias != "keep" else ""
        if problem and self.inertias == "refuse":
            doc.fail(inertia_at, f"{what}: {problem}")
        if problem:
            doc.repair(inertia_at, f"{what}: {problem}",
                       "took the nearest that a rigid body can have")  # fmt: skip
            inertial = inertia_rules.nearest(inertial)
        return inertial

    def _massless(self, joints: tuple[Joint, ...]) -> None:
        """Report moving parts without any mass from there on: they are kept, but dynamics is singular for them."""
        heavy = {n for n, link in self.links.items() if link.inertial is not None and link.inertial.mass > 0.0}
        if not any(link.inertial for link in self.links.values()):
            return  # a purely kinematic description
        for joint in reversed(joints):
            if joint.child in heavy:
                heavy.add(joint.parent)
            elif joint.type is not JointType.FIXED:
                self.doc.repairs.append(
                    Repair(
                        f"{self.doc.source.name}:{self.joint_at[joint.name].sourceline}",
                        f"joint {joint.name!r} moves links without any mass",
                        "kept massless: forward dynamics is singular for this joint",
                    )
                )

    # ---- geometry

    def _material(self, element: Any) -> Rgba | None:
        color = next(plain_children(element, "color"), None)
        name = element.get("name") or ""
        if color is None:
            return self.materials.get(name)
        r, g, b, a = self.doc.numbers(color, "rgba", 4, f"material {name!r}")
        if name and name not in self.materials:
            self.materials[name] = (r, g, b, a)
        return (r, g, b, a)

    def _shape(self, element: Any, what: str) -> Shape | None:
        doc = self.doc
        tag = f"{what}: <{local(element)}>"
        geometry = next(plain_children(element, "geometry"), None)
        inner = [] if geometry is None else list(geometry)
        if not inner:
            doc.repair(element, f"{tag} has no geometry", "left it out")
            return None
        at, kind = inner[0], local(inner[0])
        mesh: Path | None = None
        size: tuple[float, ...]
        if kind == "box":
            size = doc.numbers(at, "size", 3, tag)
        elif kind == "sphere":
            size = (doc.number(at, "radius", tag),)
        elif kind in ("cylinder", "capsule"):
            size = (doc.number(at, "radius", tag), doc.number(at, "length", tag))
        elif kind == "mesh":
            size = doc.numbers(at, "scale", 3, tag, (1.0, 1.0, 1.0))
            mesh = self._mesh(at, tag)
            if mesh is None:
                return None
        else:
            doc.fail(at, f"{tag}: geometry <{kind}> is unknown; expected box, sphere, cylinder, capsule or mesh")
        if (0.0 in size) if kind == "mesh" else (min(size) < 0.0):
            doc.fail(at, f"{tag}: {kind} of size {' '.join(f'{x:g}' for x in size)}; expected positive numbers")
        if kind != "mesh" and min(size) == 0.0:
            doc.repair(at, f"{tag} is a {kind} of size {' '.join(f'{x:g}' for x in size)}", "left it out")
            return None
        material = next(plain_children(element, "material"), None)
        rgba = None if material is None else self._material(material)
        return Shape(ShapeKind(kind), size, self._origin(element, tag), mesh, rgba, element.get("name") or "")

    def _mesh(self, element: Any, what: str) -> Path | None:
        name = self.doc.attribute(element, "filename", what)
        if "\\" in name:
            self._repair_once(element, "mesh names have backslashes", "read as slashes, in all of them")
            name = name.replace("\\", "/")
        if name.startswith("package:///"):
            self._repair_once(element, "mesh names have three slashes after package:", "read as two, in all of them")
        try:
            path = self.paths.resolve(name, f"{self.doc.source}:{element.sourceline}")
            for package, folder in self.paths.guessed.items():
                self._repair_once(element, f"no folder of the package {package!r} was found", f"took {folder} for it")
            return path
        except MeshError:
            if self.meshes == "require":
                raise
            self.doc.repair(element, f"{what}: mesh {name!r} was not found", "left the shape out, as asked")
            return None

    def _repair_once(self, element: Any, problem: str, remedy: str) -> None:
        if not any(r.problem == problem for r in self.doc.repairs):
            self.doc.repair(element, problem, remedy)

    def _origin(self, element: Any, what: str) -> Array:
        origin = next(plain_children(element, "origin"), None)
        if origin is None:
            return np.eye(4)
        xyz = self.doc.numbers(origin, "xyz", 3, what, (0.0, 0.0, 0.0))
        rpy = self.doc.numbers(origin, "rpy", 3, what, (0.0, 0.0, 0.0))
        return from_rpy(xyz, rpy)

    # ---- joints

    def _joint(self, element: Any) -> None:
        doc = self.doc
        name = doc.attribute(element, "name", "joint")
        what = f"joint {name!r}"
        if name in self.joints:
            doc.fail(element, f"a second joint is named {name!r} (the first: line {self.joint_at[name].sourceline})")
        kind = doc.attribute(element, "type", what)
        if kind not in _JOINT_TYPES:
            doc.fail(element, f"{what}: type {kind!r} is unknown; expected one of {', '.join(_JOINT_TYPES)}")
        ends = []
        for role in ("parent", "child"):
            at = next(plain_children(element, role), None)
            if at is None:
                doc.fail(element, f"{what} lacks <{role} link=…>")
            ends.append(doc.attribute(at, "link", what))
        pose = self._origin(element, what)
        if kind in ("planar", "floating"):
            self._composite(element, name, kind, ends[0], ends[1], pose)
            return
        dynamics = next(plain_children(element, "dynamics"), None)
        damping = 0.0 if dynamics is None else doc.number(dynamics, "damping", what, 0.0)
        friction = 0.0 if dynamics is None else doc.number(dynamics, "friction", what, 0.0)
        if damping < 0.0 or friction < 0.0:
            doc.fail(dynamics, f"{what}: damping {damping:g}, friction {friction:g}; expected zero or more")
        fixed = kind == "fixed"
        self._add(
            element,
            Joint(
                name, JointType(kind), ends[0], ends[1], pose,
                np.array([1.0, 0.0, 0.0]) if fixed else self._axis(element, what),
                JointLimits() if fixed else self._limits(element, kind, name),
                self._mimic(element, what, fixed), damping, friction,
            ),
        )  # fmt: skip

    def _add(self, element: Any, joint: Joint) -> None:
        self.joints[joint.name] = joint
        self.joint_at[joint.name] = element

    def _axis(self, joint: Any, what: str) -> Array:
        element = next(plain_children(joint, "axis"), None)
        xyz = (1.0, 0.0, 0.0) if element is None else self.doc.numbers(element, "xyz", 3, what)
        length = math.sqrt(sum(x * x for x in xyz))
        if length < 1e-9:
            self.doc.fail(element, f"{what}: the axis is zero; expected a direction such as '0 0 1'")
        if abs(length - 1.0) > 1e-3:
            self.doc.repair(element, f"{what}: the axis has length {length:.6g}", "normalised it")
        return np.array(xyz) / length

    def _limits(self, joint: Any, kind: str, name: str) -> JointLimits:
        doc, what = self.doc, f"joint {name!r}"
        element = next(plain_children(joint, "limit"), None)
        if element is None:
            if kind != "continuous":
                doc.repair(joint, f"{what} is {kind} but has no <limit>", "took it as unlimited")
            return JointLimits()
        given = {}
        for key in ("velocity", "effort"):
            given[key] = doc.number(element, key, what, math.inf)
            if given[key] == 0.0:
                doc.repair(element, f"{what}: {key} limit is 0", "read as not given: unlimited")
                given[key] = math.inf
        acceleration = extension_attribute(element, "acceleration")
        if acceleration is not None:
            key = next(k for k in element.attrib if k.endswith("acceleration"))
            given["acceleration"] = doc.number(element, key, what)
        if kind == "continuous":
            lower, upper = -math.inf, math.inf
        else:
            if element.get("lower") is None and element.get("upper") is None:
                doc.repair(element, f"{what} is {kind} but <limit> has neither lower nor upper",
                           "took both as 0, as the format says: the joint cannot move")  # fmt: skip
            lower = doc.number(element, "lower", what, 0.0)
            upper = doc.number(element, "upper", what, 0.0)
        given |= {"lower": lower, "upper": upper}
        limits = JointLimits(**{k: math.copysign(math.inf, v) if abs(v) > HUGE else v for k, v in given.items()})
        check_limits(limits, name, f"{doc.source}:{element.sourceline}")
        return limits

    def _mimic(self, joint: Any, what: str, fixed: bool) -> Mimic | None:
        element = next(plain_children(joint, "mimic"), None)
        if element is None:
            return None
        if fixed:
            self.doc.repair(element, f"{what} is fixed and mimics another", "left the mimic out")
            return None
        leader = self.doc.attribute(element, "joint", what)
        multiplier = self.doc.number(element, "multiplier", what, 1.0)
        return Mimic(leader, multiplier, self.doc.number(element, "offset", what, 0.0))

    def _composite(self, element: Any, name: str, kind: str, parent: str, child: str, pose: Array) -> None:
        """A planar or floating joint as a chain of single joints with massless links between them."""
        x, y, z = np.eye(3)
        steps: list[tuple[str, JointType, Array]]
        if kind == "planar":
            z = self._axis(element, f"joint {name!r}")
            x = np.eye(3)[int(np.argmin(np.abs(z)))] if abs(z[2]) < 0.999 else x
            x = x - z * (x @ z)
            x /= np.linalg.norm(x)
            y = np.cross(z, x)
            steps = [("x", JointType.PRISMATIC, x), ("y", JointType.PRISMATIC, y), ("theta", JointType.CONTINUOUS, z)]
        else:
            steps = [("x", JointType.PRISMATIC, x), ("y", JointType.PRISMATIC, y), ("z", JointType.PRISMATIC, z),
                     ("yaw", JointType.CONTINUOUS, z), ("pitch", JointType.CONTINUOUS, y),
                     ("roll", JointType.CONTINUOUS, x)]  # fmt: skip
        for i, (suffix, type_, axis) in enumerate(steps):
            last = i == len(steps) - 1
            link = child if last else f"{child}__{suffix}"
            if not last:
                self.links[link] = Link(link)
                self.link_at[link] = element
            joint = Joint(f"{name}_{suffix}", type_, parent, link, pose if i == 0 else np.eye(4), axis)
            self._add(element, joint)
            parent = link
        names = ", ".join(f"{name}_{s[0]}" for s in steps)
        self.doc.repair(element, f"joint {name!r} is {kind}", f"read as a chain of single joints: {names}")
