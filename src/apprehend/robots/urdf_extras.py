"""What URDF files carry beside links and joints: transmissions, and groups of links that may touch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from typing import Any

from ..errors import suggestion
from .description import Actuator, Joint, JointType, Link
from .markup import Document, local, plain_children, prefixed

Pair = tuple[float, float]


def _differential(n_j: Pair, n_a: Pair) -> tuple[Pair, Pair]:
    return (n_a[0] * n_j[0], n_a[0] * n_j[1]), (n_a[1] * n_j[0], -n_a[1] * n_j[1])


def _four_bar(n_j: Pair, n_a: Pair) -> tuple[Pair, Pair]:
    return (n_a[0] * n_j[0], 0.0), (n_a[1], n_a[1] * n_j[1])


COUPLED: Mapping[str, Callable[[Pair, Pair], tuple[Pair, Pair]]] = {
    "DifferentialTransmission": _differential,
    "FourBarLinkageTransmission": _four_bar,
}
"""Arms of two motors on two joints, from the reductions of joints and motors as ros_control has them.

A row is a motor's speed from those of the joints, and so, power being the same on both sides, its arms. (For the
four-bar linkage, ros_control's own map of torques does not fit its map of speeds; the speeds are followed.)
"""


def actuators(doc: Document, joints: Mapping[str, Joint]) -> tuple[Actuator, ...]:
    """The motors of ``<transmission>`` elements: one on one joint by its mechanical reduction, or two on two joints."""
    found: list[Actuator] = []
    for element in plain_children(doc.root, "transmission"):
        what = f"transmission {element.get('name')!r}"
        driven, motors = (_by_role(plain_children(element, tag)) for tag in ("joint", "actuator"))
        names = [doc.attribute(e, "name", what) for e in driven]
        if not names and not motors:
            continue
        type_at = next(plain_children(element, "type"), None)
        kind = "" if type_at is None else (type_at.text or "").strip().rsplit("/", 1)[-1]
        size = 2 if kind in COUPLED else 1
        if len(names) != size or len(motors) != size:
            said = f"{what} has {len(names)} joints and {len(motors)} actuators"
            doc.repair(element, said, "left it out")
            continue
        wrong = next((n for n in names if n not in joints or joints[n].type is JointType.FIXED), None)
        if wrong is not None:
            why = "is fixed" if wrong in joints else f"does not exist.{suggestion(wrong, joints)}"
            doc.repair(element, f"{what} drives the joint {wrong!r}, which {why}", "left it out")
            continue
        if size == 1:
            rows = [{names[0]: _reduction(doc, what, element, motors[0])}]
        else:
            n_j, n_a = ((_reduction(doc, what, e[0]), _reduction(doc, what, e[1])) for e in (driven, motors))
            rows = [
                {name: arm for name, arm in zip(names, arms, strict=True) if arm} for arms in COUPLED[kind](n_j, n_a)
            ]
        for motor, arms in zip(motors, rows, strict=True):
            name = str(motor.get("name") or element.get("name"))
            if any(name == other.name for other in found):
                doc.repair(element, f"a second actuator is named {name!r}", f"called it {name}_{names[0]}")
                name = f"{name}_{names[0]}"
            found.append(Actuator(name, arms))
    return tuple(found)


def _by_role(elements: Iterable[Any]) -> list[Any]:
    """Joints or actuators in the order of their roles (``joint1``, ``joint2``); those without one as in the file."""
    return sorted(elements, key=lambda e: next(((at.text or "").strip() for at in plain_children(e, "role")), ""))


def _reduction(doc: Document, what: str, *holders: Any) -> float:
    """The last ``<mechanicalReduction>`` in *holders*, or 1."""
    ratio = 1.0
    for holder in holders:
        for at in plain_children(holder, "mechanicalReduction"):
            try:
                ratio = float(at.text or "")
            except ValueError:
                doc.fail(at, f"{what}: mechanicalReduction is {at.text!r}; expected a number")
            if ratio == 0.0 or not isfinite(ratio):
                doc.fail(at, f"{what}: mechanicalReduction is {ratio:g}; expected the ratio of motor to joint turns")
    return ratio


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
