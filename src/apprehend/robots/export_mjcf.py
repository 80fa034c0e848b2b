"""A description as MJCF text."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from .description import Description, Inertial, Joint, JointType, Link, Shape, ShapeKind
from .export_urdf import MeshName, number, numbers
from .inertia import check, nearest

UNLIMITED = 1e10
"""How one infinite end of a range is written."""
LOCKED = 1e-12
"""Width of the range of a joint whose limits are equal: MuJoCo demands one."""
TINY_MASS, TINY_INERTIA = 1e-9, 1e-12
"""What a moving link without mass gets, since MuJoCo demands some: kg and kg m²."""


def mjcf_text(description: Description, mesh_name: MeshName) -> tuple[str, tuple[str, ...]]:
    """The MJCF of *description*, and what it cannot say."""
    from lxml import etree

    writer = _Writer(etree, description, mesh_name)
    return etree.tostring(writer.root, pretty_print=True, encoding="unicode"), tuple(writer.lost)


class _Writer:
    def __init__(self, etree: Any, description: Description, mesh_name: MeshName) -> None:
        self.etree = etree
        self.description = description
        self.mesh_name = mesh_name
        self.lost: list[str] = []
        self.meshes: dict[tuple[Path, tuple[float, ...]], str | None] = {}
        self.root = etree.Element("mujoco", model=description.name)
        etree.SubElement(self.root, "compiler", angle="radian", autolimits="false", inertiafromgeom="false")
        self.assets = etree.SubElement(self.root, "asset")
        self.children: dict[str, list[Joint]] = {name: [] for name in description.links}
        for joint in description.joints:
            self.children[joint.parent].append(joint)
        self._bodies(etree.SubElement(self.root, "worldbody"))
        self._couplings()
        self._motors()
        self._contacts_and_home()

    def add(self, parent: Any, tag: str, **attributes: str) -> Any:
        return self.etree.SubElement(parent, tag, **attributes)

    # ---- bodies

    def _bodies(self, world: Any) -> None:
        root = self.description.root
        top = world
        if root != "world":
            top = self.add(world, "body", name=root)
        stack: list[tuple[Any, str, Joint | None]] = [(top, root, None)]
        while stack:
            element, name, joint = stack.pop()
            self._link(element, self.description.links[name], joint)
            below = []
            for child in self.children[name]:
                body = self.add(element, "body", name=child.child, pos=numbers(child.pose[:3, 3]),
                                quat=numbers(quaternion(child.pose[:3, :3])))  # fmt: skip
                below.append((body, child.child, child))
            stack.extend(reversed(below))

    def _link(self, element: Any, link: Link, joint: Joint | None) -> None:
        moves = joint is not None and joint.type is not JointType.FIXED
        inertial = link.inertial
        if inertial is not None and inertial.mass > 0.0 and (inertial.inertia.any() or not moves):
            moments, axes = self._principal(link.name, inertial)
            self.add(element, "inertial", pos=numbers(inertial.com), mass=number(inertial.mass),
                     quat=numbers(quaternion(axes)), diaginertia=numbers(moments))  # fmt: skip
        elif moves:
            mass = TINY_MASS if inertial is None or inertial.mass == 0.0 else inertial.mass
            com = np.zeros(3) if inertial is None else inertial.com
            self.add(element, "inertial", pos=numbers(com), mass=number(mass), diaginertia=numbers((TINY_INERTIA,) * 3))
            self.lost.append(f"link {link.name!r} moves and has no mass or inertia of its own: MuJoCo needs some; "
                             f"wrote {mass:g} kg and {TINY_INERTIA:g} kg m²")  # fmt: skip
        if joint is not None and moves:
            self._joint(element, joint)
        for shape in link.visuals:
            self._geom(element, shape, contype="0", conaffinity="0", group="2")
        for shape in link.collisions:
            self._geom(element, shape, group="3")

    def _principal(self, name: str, inertial: Inertial) -> tuple[Array, Array]:
        """Principal moments that MuJoCo accepts, descending, and their axes as a rotation."""
        if check(inertial):
            self.lost.append(f"link {name!r}: {check(inertial)}: MuJoCo refuses it; wrote the nearest it can have")
            inertial = nearest(inertial)
        moments, axes = np.linalg.eigh(inertial.inertia)
        moments = np.maximum(moments, 0.0)
        moments[2] = min(moments[2], moments[0] + moments[1])  # rounding
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        return moments, axes

    def _joint(self, element: Any, joint: Joint) -> None:
        limits = joint.limits
        attributes = {"name": joint.name, "type": "slide" if joint.type is JointType.PRISMATIC else "hinge",
                      "axis": numbers(joint.axis)}  # fmt: skip
        bounded = math.isfinite(limits.lower) or math.isfinite(limits.upper)
        if joint.type is not JointType.CONTINUOUS and bounded:
            attributes |= {"limited": "true", "range": _range(limits.lower, limits.upper)}
        if math.isfinite(limits.effort):
            attributes |= {"actuatorfrclimited": "true", "actuatorfrcrange": _range(-limits.effort, limits.effort)}
        for key, value in (("damping", joint.damping), ("frictionloss", joint.friction), ("armature", joint.armature)):
            if value:
                attributes[key] = number(value)
        self.add(element, "joint", **attributes)
        for kind in ("velocity", "acceleration"):
            if math.isfinite(getattr(limits, kind)):
                self.lost.append(f"joint {joint.name!r}: MJCF has no {kind} limits")

    def _geom(self, element: Any, shape: Shape, **more: str) -> None:
        attributes = {"pos": numbers(shape.pose[:3, 3]), "quat": numbers(quaternion(shape.pose[:3, :3])), **more}
        if shape.rgba is not None:
            attributes["rgba"] = numbers(shape.rgba)
        if shape.kind is ShapeKind.MESH:
            mesh = self._mesh(shape)
            if mesh is None:
                return
            attributes |= {"type": "mesh", "mesh": mesh}
        else:
            halves = [0.5 * x for x in shape.size]
            sizes = {
                ShapeKind.BOX: halves,
                ShapeKind.SPHERE: [shape.size[0]],
                ShapeKind.CYLINDER: [shape.size[0], halves[-1]],
                ShapeKind.CAPSULE: [shape.size[0], halves[-1]],
            }
            attributes |= {"type": shape.kind.value, "size": numbers(sizes[shape.kind])}
        self.add(element, "geom", **attributes)

    def _mesh(self, shape: Shape) -> str | None:
        """The asset of a mesh shape, made on first use."""
        if shape.mesh is None:
            return None
        key = (shape.mesh, shape.size)
        if key not in self.meshes:
            file = self.mesh_name(shape.mesh)
            self.meshes[key] = None
            if file is not None:
                name = f"{shape.mesh.stem}_{len(self.meshes)}"
                self.add(self.assets, "mesh", name=name, file=file, scale=numbers(shape.size), inertia="shell")
                self.meshes[key] = name
        return self.meshes[key]

    # ---- what couples joints

    def _couplings(self) -> None:
        equality = self.add(self.root, "equality")
        for joint in self.description.joints:
            if joint.mimic is not None:
                poly = numbers((joint.mimic.offset, joint.mimic.multiplier, 0, 0, 0))
                self.add(equality, "joint", joint1=joint.name, joint2=joint.mimic.joint, polycoef=poly)
        for loop in self.description.loops:
            common = {"name": loop.name, "body1": loop.first, "body2": loop.second}
            if loop.free == "point":
                self.add(equality, "connect", anchor=numbers(loop.T_first[:3, 3]), **common)
            elif loop.free == "pose" and np.array_equal(loop.T_second[:3, :3], np.eye(3)):
                pose = (*loop.T_first[:3, 3], *quaternion(loop.T_first[:3, :3]))
                self.add(equality, "weld", anchor=numbers(loop.T_second[:3, 3]), relpose=numbers(pose), **common)
            else:
                self.lost.append(f"loop {loop.name!r}: MJCF cannot close a chain that is free as {loop.free!r}")

    def _motors(self) -> None:
        tendons, motors = self.add(self.root, "tendon"), self.add(self.root, "actuator")
        written: dict[str, dict[str, float]] = {}

        def tendon(name: str, arms: dict[str, float], **more: str) -> None:
            fixed = self.add(tendons, "fixed", name=name, **more)
            for joint, arm in arms.items():
                self.add(fixed, "joint", joint=joint, coef=number(arm))
            written[name] = arms

        for t in self.description.tendons:
            more = {}
            if math.isfinite(t.lower) or math.isfinite(t.upper):
                more = {"limited": "true", "range": _range(t.lower - t.offset, t.upper - t.offset)}
            tendon(t.name, dict(t.arms), **more)
        for actuator in self.description.actuators:
            arms = dict(actuator.arms)
            attributes = {"name": actuator.name}
            if math.isfinite(actuator.lower) or math.isfinite(actuator.upper):
                attributes |= {"forcelimited": "true", "forcerange": _range(actuator.lower, actuator.upper)}
            if len(arms) == 1:
                joint, arm = next(iter(arms.items()))
                self.add(motors, "motor", joint=joint, gear=number(arm), **attributes)
                continue
            along = next((name for name, known in written.items() if known == arms), None)
            if along is None:
                along = f"{actuator.name}_tendon"
                tendon(along, arms)
            self.add(motors, "motor", tendon=along, **attributes)

    def _contacts_and_home(self) -> None:
        contact = self.add(self.root, "contact")
        for pair in sorted(sorted(p) for p in self.description.allowed_collisions):
            self.add(contact, "exclude", body1=pair[0], body2=pair[1])
        if not self.description.home:
            return
        q = {joint.name: self.description.rest(joint) for joint in self.description.free_joints}
        for joint in self.description.joints:
            if joint.mimic is not None:
                q[joint.name] = joint.mimic.multiplier * q[joint.mimic.joint] + joint.mimic.offset
        moving = [j.name for j in self.description.joints if j.type is not JointType.FIXED]
        keyframe = self.add(self.root, "keyframe")
        self.add(keyframe, "key", name="home", qpos=numbers(q[name] for name in moving))


def _range(lower: float, upper: float) -> str:
    """A range as MuJoCo wants it: finite, and not empty (one end of a locked joint moves by `LOCKED`)."""
    return numbers((max(lower, -UNLIMITED), min(upper if upper > lower else lower + LOCKED, UNLIMITED)))


def quaternion(R: Array) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a rotation ``(3, 3)``, from its largest component."""
    m = R
    squares = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    k = int(np.argmax(squares))
    s = 2.0 * math.sqrt(squares[k])
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    rows = [(0.25 * s * s, x, y, z), (x, 0.25 * s * s, xy, xz), (y, xy, 0.25 * s * s, yz), (z, xz, yz, 0.25 * s * s)]
    q = np.array(rows[k]) / s
    q /= np.linalg.norm(q)
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])
