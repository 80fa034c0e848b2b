"""A description as URDF and SRDF text."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..arrays import Array
from .description import Description, Joint, JointType, Link, Shape, ShapeKind
from .poses import to_rpy

MeshName = Callable[[Path], str | None]
"""Gives the name that an exported file uses for a mesh file; None leaves the shape out."""
UNLIMITED = 1e308
"""How an infinite limit is written: URDF wants a number."""
DRAKE = "http://drake.mit.edu"


def number(value: float) -> str:
    """The shortest text that reads back as exactly *value*."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """`number` of each, with spaces between."""
    return " ".join(number(v) for v in values)


def urdf_text(description: Description, mesh_name: MeshName) -> tuple[str, tuple[str, ...]]:
    """The URDF of *description*, and what it cannot say."""
    from lxml import etree

    root = etree.Element("robot", name=description.name, nsmap={"drake": DRAKE})
    for link in description.links.values():
        _link(etree, root, link, mesh_name)
    for joint in description.joints:
        _joint(etree, root, joint)
    lost = [f"tendon {t.name!r}: URDF has no tendons" for t in description.tendons]
    lost += [f"loop {loop.name!r}: URDF has no closed chains" for loop in description.loops]
    for actuator in description.actuators:
        if len(actuator.arms) != 1:
            lost.append(f"actuator {actuator.name!r}: URDF has no motors that drive several joints")
            continue
        joint_name, arm = next(iter(actuator.arms.items()))
        transmission = etree.SubElement(root, "transmission", name=f"{actuator.name}_transmission")
        etree.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
        etree.SubElement(transmission, "joint", name=joint_name)
        motor = etree.SubElement(transmission, "actuator", name=actuator.name)
        etree.SubElement(motor, "mechanicalReduction").text = number(arm)
        if math.isfinite(actuator.lower) or math.isfinite(actuator.upper):
            lost.append(f"actuator {actuator.name!r}: URDF has no force limits of motors")
    lost += [f"joint {j.name!r}: URDF has no rotor inertia (armature)" for j in description.joints if j.armature]
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="utf-8").decode(), tuple(lost)


def srdf_text(description: Description) -> str:
    """The SRDF of *description* (allowed pairs, home posture), or nothing if it would be empty."""
    from lxml import etree

    if not description.allowed_collisions and not description.home:
        return ""
    root = etree.Element("robot", name=description.name)
    if description.home:
        group = etree.SubElement(root, "group", name="all")
        state = etree.SubElement(root, "group_state", name="home", group="all")
        for joint, value in description.home.items():
            etree.SubElement(group, "joint", name=joint)
            etree.SubElement(state, "joint", name=joint, value=number(value))
    for pair in sorted(sorted(p) for p in description.allowed_collisions):
        etree.SubElement(root, "disable_collisions", link1=pair[0], link2=pair[1], reason="User")
    return str(etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="utf-8").decode())


def _origin(etree: Any, parent: Any, T: Array) -> None:
    etree.SubElement(parent, "origin", xyz=numbers(T[:3, 3]), rpy=numbers(to_rpy(T[:3, :3])))


def _link(etree: Any, root: Any, link: Link, mesh_name: MeshName) -> None:
    element = etree.SubElement(root, "link", name=link.name)
    if link.inertial is not None:
        at = etree.SubElement(element, "inertial")
        etree.SubElement(at, "origin", xyz=numbers(link.inertial.com), rpy="0 0 0")
        etree.SubElement(at, "mass", value=number(link.inertial.mass))
        inertia = link.inertial.inertia
        entries = {
            f"i{a}{b}": number(inertia[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz") if j >= i
        }
        etree.SubElement(at, "inertia", **entries)
    for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for shape in shapes:
            _shape(etree, element, tag, shape, mesh_name)


def _shape(etree: Any, link: Any, tag: str, shape: Shape, mesh_name: MeshName) -> None:
    name = None
    if shape.kind is ShapeKind.MESH:
        name = mesh_name(shape.mesh) if shape.mesh is not None else None
        if name is None:
            return
    element = etree.SubElement(link, tag, **({"name": shape.name} if shape.name else {}))
    _origin(etree, element, shape.pose)
    geometry = etree.SubElement(element, "geometry")
    if shape.kind is ShapeKind.BOX:
        etree.SubElement(geometry, "box", size=numbers(shape.size))
    elif shape.kind is ShapeKind.SPHERE:
        etree.SubElement(geometry, "sphere", radius=number(shape.size[0]))
    elif shape.kind is ShapeKind.MESH:
        etree.SubElement(geometry, "mesh", filename=name, scale=numbers(shape.size))
    else:
        size = {"radius": number(shape.size[0]), "length": number(shape.size[1])}
        etree.SubElement(geometry, shape.kind.value, **size)
    if shape.rgba is not None:
        material = etree.SubElement(element, "material", name="")
        etree.SubElement(material, "color", rgba=numbers(shape.rgba))


def _joint(etree: Any, root: Any, joint: Joint) -> None:
    element = etree.SubElement(root, "joint", name=joint.name, type=joint.type.value)
    _origin(etree, element, joint.pose)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    if joint.type is JointType.FIXED:
        return
    etree.SubElement(element, "axis", xyz=numbers(joint.axis))
    limits = joint.limits
    bounded = {k: number(max(-UNLIMITED, min(UNLIMITED, getattr(limits, k)))) for k in ("effort", "velocity")}
    if joint.type is not JointType.CONTINUOUS:
        bounded |= {k: number(max(-UNLIMITED, min(UNLIMITED, getattr(limits, k)))) for k in ("lower", "upper")}
    if math.isfinite(limits.acceleration):
        bounded[f"{{{DRAKE}}}acceleration"] = number(limits.acceleration)
    etree.SubElement(element, "limit", **bounded)
    if joint.damping or joint.friction:
        etree.SubElement(element, "dynamics", damping=number(joint.damping), friction=number(joint.friction))
    if joint.mimic is not None:
        mimic = joint.mimic
        etree.SubElement(
            element, "mimic", joint=mimic.joint, multiplier=number(mimic.multiplier), offset=number(mimic.offset)
        )
