"""What URDF files carry beside links and joints: transmissions, and groups of links that may touch."""

from __future__ import annotations

from collections.abc import Mapping

from ..errors import suggestion
from .description import Actuator, Joint, JointType, Link
from .markup import Document, local, plain_children, prefixed


def actuators(doc: Document, joints: Mapping[str, Joint]) -> tuple[Actuator, ...]:
    """One motor for each actuator of a ``<transmission>``: its arm is the mechanical reduction."""
    found: list[Actuator] = []
    for element in plain_children(doc.root, "transmission"):
        what = f"transmission {element.get('name')!r}"
        names = [doc.attribute(e, "name", what) for e in plain_children(element, "joint")]
        motors = list(plain_children(element, "actuator"))
        if len(names) != 1 or len(motors) != 1:
            if names or motors:
                doc.repair(element, f"{what} has {len(names)} joints and {len(motors)} actuators", "left it out")
            continue
        if names[0] not in joints or joints[names[0]].type is JointType.FIXED:
            why = "is fixed" if names[0] in joints else f"does not exist.{suggestion(names[0], joints)}"
            doc.repair(element, f"{what} drives the joint {names[0]!r}, which {why}", "left it out")
            continue
        ratio = 1.0
        for holder in (element, motors[0]):
            for at in plain_children(holder, "mechanicalReduction"):
                try:
                    ratio = float(at.text or "")
                except ValueError:
                    doc.fail(at, f"{what}: mechanicalReduction is {at.text!r}; expected a number")
        if ratio == 0.0:
            doc.fail(element, f"{what}: mechanicalReduction is 0; expected the ratio of motor to joint turns")
        name = str(motors[0].get("name") or element.get("name"))
        if any(name == other.name for other in found):
            doc.repair(element, f"a second actuator is named {name!r}", f"called it {name}_{names[0]}")
            name = f"{name}_{names[0]}"
        found.append(Actuator(name, {names[0]: ratio}))
    return tuple(found)


def filter_groups(doc: Document, links: Mapping[str, Link]) -> frozenset[frozenset[str]]:
    """Pairs of links that may touch, from ``drake:collision_filter_group``."""
    groups: dict[str, tuple[set[str], set[str]]] = {}
    for element in doc.root:
        if local(element) != "collision_filter_group" or not prefixed(element):
            continue
        members = {str(e.get("link")) for e in element if local(e) == "member"} & links.keys()
        ignored = {str(e.get("name")) for e in element if local(e) == "ignored_collision_filter_group"}
        groups[str(element.get("name"))] = (members, ignored)
    pairs = {
        frozenset((a, b))
        for members, ignored in groups.values()
        for other in ignored & groups.keys()
        for a in members
        for b in groups[other][0]
        if a != b
    }
    return frozenset(pairs)
