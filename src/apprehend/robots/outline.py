"""A description as text for a person: the tree of links and joints, and what was repaired."""

from __future__ import annotations

import math

from .description import Description, Joint, JointType


def outline(description: Description, *, degrees: bool = False, fixed: bool = True) -> str:
    """The tree of *description*, one line for each link: joint, type, limits, who is mimicked, mass.

    Angles are in radians, or in degrees if *degrees*. With *fixed* False, links that are fixed to their parent and
    carry nothing that moves are left out.
    """
    children: dict[str, list[Joint]] = {name: [] for name in description.links}
    moves: set[str] = set()
    for j in reversed(description.joints):
        children[j.parent].insert(0, j)
        if j.type is not JointType.FIXED or j.child in moves:
            moves.add(j.parent)
    lines = [f"{description.name}: {len(description.free_joints)} coordinates, {len(description.links)} links"]
    stack: list[tuple[Joint | None, str, str]] = [(None, "", "")]
    while stack:
        joint, branch, indent = stack.pop()
        name = description.root if joint is None else joint.child
        text = f"{branch}{name}{_mass(description, name)}"
        lines.append(text if joint is None else f"{text}  ← {_said(joint, degrees)}")
        below = [j for j in children[name] if fixed or j.type is not JointType.FIXED or j.child in moves]
        for i, child in reversed(list(enumerate(below))):
            last = i == len(below) - 1
            stack.append((child, indent + ("└─ " if last else "├─ "), indent + ("   " if last else "│  ")))
    for kind, things in (("tendon", description.tendons), ("actuator", description.actuators)):
        for thing in things:
            arms = " ".join(f"{arm:+.6g}·{joint}" for joint, arm in thing.arms.items())
            lines.append(f"{kind} {thing.name}: {arms}  [{thing.lower:.6g}, {thing.upper:.6g}]")
    lines += [f"loop {loop.name}: {loop.first} – {loop.second}, free: {loop.free}" for loop in description.loops]
    lines += [f"repaired: {repair}" for repair in description.repairs]
    return "\n".join(lines)


def _mass(description: Description, link: str) -> str:
    inertial = description.links[link].inertial
    return f" ({inertial.mass:.4g} kg)" if inertial is not None and inertial.mass else ""


def _said(joint: Joint, degrees: bool) -> str:
    """Name, type and limits of *joint*, in words."""
    if joint.type is JointType.FIXED:
        return f"{joint.name}: fixed"
    slides = joint.type is JointType.PRISMATIC
    scale, unit = (1.0, "m") if slides else ((180.0 / math.pi, "°") if degrees else (1.0, "rad"))
    limits = joint.limits
    parts = [f"{joint.name}: {joint.type.value}"]
    if math.isfinite(limits.lower) or math.isfinite(limits.upper):
        parts.append(f"[{scale * limits.lower:.4g}, {scale * limits.upper:.4g}] {unit}")
    if math.isfinite(limits.velocity):
        parts.append(f"{scale * limits.velocity:.4g} {unit}/s")
    if math.isfinite(limits.acceleration):
        parts.append(f"{scale * limits.acceleration:.4g} {unit}/s²")
    if math.isfinite(limits.effort):
        parts.append(f"{limits.effort:.4g} {'N' if slides else 'N m'}")
    if joint.mimic is not None:
        mimic = joint.mimic
        parts.append(f"= {mimic.multiplier:.6g}·{mimic.joint}" + (f" {mimic.offset:+.6g}" if mimic.offset else ""))
    return ", ".join(parts)
