"""Where a tree divides: what moves below each link, and the first link from which several parts move."""

from __future__ import annotations

from .description import Description, Joint, JointType


def moving_children(description: Description) -> dict[str, list[Joint]]:
    """For every link, the joints to children below which something moves (the joint itself included)."""
    moves: set[str] = set()
    children: dict[str, list[Joint]] = {name: [] for name in description.links}
    for joint in reversed(description.joints):
        if joint.type is not JointType.FIXED or joint.child in moves:
            moves.add(joint.parent)
            children[joint.parent].insert(0, joint)
    return children


def divide(description: Description) -> tuple[str, list[Joint], int]:
    """The first link with two or more moving branches, the joints that start them, and the moving joints passed.

    In a serial chain: the last link that carries a moving one, and that one joint.
    """
    children = moving_children(description)
    link, passed = description.root, 0
    last = link
    while len(children[link]) == 1:
        joint = children[link][0]
        last = link
        passed += joint.type is not JointType.FIXED
        link = joint.child
    if not children[link]:
        return last, children[last], passed
    return link, children[link], passed
