"""New descriptions from old: a tool attached to a robot, and a part cut out of one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_pose
from ..errors import InputError, unknown_name
from .branches import divide
from .description import Description, Joint, JointType, Mimic
from .poses import motion


def renamed(description: Description, prefix: str) -> Description:
    """*description* with *prefix* put before the name of every link and joint."""
    if not prefix:
        return description

    def put(arms: Mapping[str, float]) -> dict[str, float]:
        return {prefix + joint: arm for joint, arm in arms.items()}

    joints = tuple(
        replace(
            j, name=prefix + j.name, parent=prefix + j.parent, child=prefix + j.child,
            mimic=None if j.mimic is None else Mimic(prefix + j.mimic.joint, j.mimic.multiplier, j.mimic.offset),
        )
        for j in description.joints
    )  # fmt: skip
    return replace(
        description,
        root=prefix + description.root,
        links={prefix + n: replace(link, name=prefix + n) for n, link in description.links.items()},
        joints=joints,
        home={prefix + n: v for n, v in description.home.items()},
        allowed_collisions=frozenset(frozenset(prefix + n for n in pair) for pair in description.allowed_collisions),
        tendons=tuple(replace(t, name=prefix + t.name, arms=put(t.arms)) for t in description.tendons),
        actuators=tuple(replace(a, name=prefix + a.name, arms=put(a.arms)) for a in description.actuators),
        loops=tuple(
            replace(loop, name=prefix + loop.name, first=prefix + loop.first, second=prefix + loop.second)
            for loop in description.loops
        ),
        hand=prefix + description.hand if description.hand else "",
        tool=prefix + description.tool if description.tool else "",
    )


def attach(
    base: Description, tool: Description, at: str, pose: ArrayLike | None = None, prefix: str = ""
) -> Description:
    """*tool* fixed to link *at* of *base*; *pose* is T_at_tool (identity if None), *prefix* goes before its names.

    Names must not collide: pass a *prefix* if they do. The tool frame of the result is the tool's, if it has one. What
    divides into fingers after at most two moving joints is a hand: the result's hand begins at its root.
    """
    if at not in base.links:
        unknown_name("link", at, base.links, f"robot {base.name!r}")
    T = np.eye(4) if pose is None else as_pose(pose, "pose")
    if T.shape != (4, 4):
        raise InputError(f"pose has shape {T.shape}; expected (4, 4)")
    hand = renamed(tool, prefix)
    joint_name = f"{at}_to_{hand.root}"
    links_twice = base.links.keys() & hand.links.keys()
    joints_twice = {j.name for j in base.joints} & ({j.name for j in hand.joints} | {joint_name})
    if links_twice or joints_twice:
        kind, twice = ("link", links_twice) if links_twice else ("joint", joints_twice)
        shown = ", ".join(map(repr, sorted(twice)[:3]))
        raise InputError(
            f"{base.name!r} and {tool.name!r} both have the {kind}{'s' if len(twice) > 1 else ''} {shown}; "
            f"attach with prefix='{tool.name}_' (now {prefix!r})"
        )
    weld = Joint(joint_name, JointType.FIXED, at, hand.root, T)
    return replace(
        base,
        name=f"{base.name}+{tool.name}",
        links={**base.links, **hand.links},
        joints=(*base.joints, weld, *hand.joints),
        home={**base.home, **hand.home},
        allowed_collisions=base.allowed_collisions | hand.allowed_collisions,
        repairs=base.repairs + hand.repairs,
        tendons=base.tendons + hand.tendons,
        actuators=base.actuators + hand.actuators,
        loops=base.loops + hand.loops,
        hand=hand.hand or (hand.root if base.free_joints and _is_hand(tool) else base.hand),
        tool=hand.tool or base.tool,
    )


def _is_hand(description: Description) -> bool:
    _, branches, passed = divide(description)
    return len(branches) > 1 and passed <= 2


def subtree(description: Description, root_link: str) -> Description:
    """The part of *description* from *root_link* on, with that link as root.

    A joint that mimics one outside the part becomes fixed at the leader's home position (zero if it has none).
    """
    if root_link not in description.links:
        unknown_name("link", root_link, description.links, f"robot {description.name!r}")
    kept = {root_link}
    joints = []
    for joint in description.joints:
        if joint.parent in kept:
            kept.add(joint.child)
            joints.append(joint)
    return _restricted(description, root_link, kept, joints)


def without(description: Description, link: str) -> Description:
    """*description* without *link* and all that it carries: for instance an arm without its hand."""
    if link not in description.links:
        unknown_name("link", link, description.links, f"robot {description.name!r}")
    if link == description.root:
        raise InputError(f"{link!r} is the root of {description.name!r}: nothing would be left")
    kept = {description.root}
    joints = []
    for joint in description.joints:
        if joint.parent in kept and joint.child != link:
            kept.add(joint.child)
            joints.append(joint)
    return _restricted(description, description.root, kept, joints)


def _restricted(description: Description, root: str, kept: set[str], joints: Iterable[Joint]) -> Description:
    chosen = list(joints)
    inside = {j.name for j in chosen}
    fixed = [
        replace(j, type=JointType.FIXED, mimic=None, pose=j.pose @ motion(j, _outside_value(description, j.mimic)))
        if j.mimic is not None and j.mimic.joint not in inside
        else j
        for j in chosen
    ]
    return replace(
        description,
        root=root,
        links={n: link for n, link in description.links.items() if n in kept},
        joints=tuple(fixed),
        home={n: v for n, v in description.home.items() if n in inside},
        allowed_collisions=frozenset(p for p in description.allowed_collisions if p <= kept),
        tendons=tuple(t for t in description.tendons if t.arms.keys() <= inside),
        actuators=tuple(a for a in description.actuators if a.arms.keys() <= inside),
        loops=tuple(loop for loop in description.loops if {loop.first, loop.second} <= kept),
        hand=description.hand if description.hand in kept else "",
        tool=description.tool if description.tool in kept else "",
    )


def _outside_value(description: Description, mimic: Mimic) -> float:
    return mimic.multiplier * description.home.get(mimic.joint, 0.0) + mimic.offset
