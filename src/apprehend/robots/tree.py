"""From links and joints in any order to a checked tree: one root, no loops, mimic chains resolved."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from ..errors import DescriptionError, suggestion
from .description import Joint, JointLimits, JointType, Link, Mimic, Repair

Where = Callable[[str], str]
"""Gives the place (``file:line``) of the joint of that name, for messages."""


def ordered(links: Mapping[str, Link], joints: Iterable[Joint], where: Where) -> tuple[str, tuple[Joint, ...]]:
    """The root link and the joints in depth-first order, siblings as in the file.

    Raises `DescriptionError` for unknown links, links with two parents (closed chains), cycles and several roots.
    """
    carried: dict[str, Joint] = {}
    children: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise DescriptionError(f"{where(joint.name)}: joint {joint.name!r}: its {role} link {link!r} does not "
                                       f"exist.{suggestion(link, links)}")  # fmt: skip
        if joint.parent == joint.child:
            raise DescriptionError(f"{where(joint.name)}: joint {joint.name!r} connects link {joint.child!r} to itself")
        if joint.child in carried:
            first = carried[joint.child]
            raise DescriptionError(
                f"{where(joint.name)}: closed chain: link {joint.child!r} is the child of joint {first.name!r} (from "
                f"{first.parent!r}) and of joint {joint.name!r} (from {joint.parent!r}); a tree gives every link one "
                "parent. Pass loops='cut' to read the tree without the second joint, or remove one of the two"
            )
        carried[joint.child] = joint
        children[joint.parent].append(joint)
    roots = [name for name in links if name not in carried]
    result: list[Joint] = []
    if roots:
        stack = list(reversed(children[roots[0]]))
        while stack:
            joint = stack.pop()
            result.append(joint)
            stack.extend(reversed(children[joint.child]))
    if len(result) == len(carried) and len(roots) == 1:
        return roots[0], tuple(result)
    cycle = _cycle(carried)
    if cycle:
        raise DescriptionError(f"{where(carried[cycle[0]].name)}: the links form a cycle: "
                               f"{_circle(cycle)}; one link must be the root")  # fmt: skip
    if not roots:
        raise DescriptionError(f"{where('')}: there is no link; a description needs at least one")
    shown = ", ".join(map(repr, roots[:6])) + (", …" if len(roots) > 6 else "")
    raise DescriptionError(f"{where('')}: {len(roots)} links have no parent joint ({shown}); "
                           "a tree has one root: connect the others with joints")  # fmt: skip


def _cycle(carried: Mapping[str, Joint]) -> list[str]:
    """The links of one cycle in order, or an empty list."""
    done: set[str] = set()
    for start in carried:
        path: dict[str, int] = {}
        link = start
        while link in carried and link not in done and link not in path:
            path[link] = len(path)
            link = carried[link].parent
        if link in path:
            return list(reversed(list(path)[path[link] :]))
        done.update(path)
    return []


def _circle(names: list[str]) -> str:
    """The names in a circle, shortened where there are many."""
    shown = names if len(names) <= 12 else [*names[:6], f"… ({len(names)} in all) …", *names[-3:]]
    return " → ".join([*shown, names[0]])


def resolved_mimics(joints: tuple[Joint, ...], where: Where, repairs: list[Repair]) -> tuple[Joint, ...]:
    """*joints* with every mimic referring to a free joint: chains are multiplied out, limits carried to the leader.

    A follower of a fixed joint is fixed at its offset. Raises `DescriptionError` for a dangling mimic or a circle.
    """
    by_name = {j.name: j for j in joints}
    resolved: dict[str, Mimic] = {}
    for joint in joints:
        chain: dict[str, Joint] = {}  # followers from here to the first that is resolved, or to the leader
        follower = joint
        while follower.mimic is not None and follower.name not in resolved:
            chain[follower.name] = follower
            leader = follower.mimic.joint
            place = f"{where(follower.name)}: joint {follower.name!r}"
            if leader not in by_name:
                raise DescriptionError(f"{place} mimics {leader!r}, which does not exist.{suggestion(leader, by_name)}")
            if leader in chain:
                circle = list(chain)[list(chain).index(leader) :]
                raise DescriptionError(f"{place} mimics itself through {_circle(circle)}; one of them must be free")
            if by_name[leader].type is JointType.FIXED:
                raise DescriptionError(f"{place} mimics {leader!r}, which is fixed; a mimic needs a joint that moves")
            follower = by_name[leader]
        for name, member in reversed(chain.items()):
            own = member.mimic
            assert own is not None
            further = resolved.get(own.joint, Mimic(own.joint))
            resolved[name] = Mimic(
                further.joint, own.multiplier * further.multiplier, own.offset + own.multiplier * further.offset
            )
    out = [replace(j, mimic=resolved[j.name]) if j.mimic is not None else j for j in joints]
    return _leader_limits(tuple(out), where, repairs)


def _leader_limits(joints: tuple[Joint, ...], where: Where, repairs: list[Repair]) -> tuple[Joint, ...]:
    """A follower's position limits bind its leader; where they are tighter, the leader's are narrowed and reported."""
    limits = {j.name: j.limits for j in joints}
    for joint in joints:
        if joint.mimic is None or abs(joint.mimic.multiplier) < 1e-12:
            continue
        own, lead = joint.limits, limits[joint.mimic.joint]
        if not own.upper > own.lower:
            continue
        ends = sorted((end - joint.mimic.offset) / joint.mimic.multiplier for end in (own.lower, own.upper))
        lower, upper = max(lead.lower, ends[0]), min(lead.upper, ends[1])
        slack = 1e-6 * max(1.0, abs(lead.upper) if abs(lead.upper) < 1e9 else 1.0)
        if lower <= lead.lower + slack and upper >= lead.upper - slack:
            continue
        problem = (f"the limits of joint {joint.name!r} allow its leader {joint.mimic.joint!r} only "
                   f"[{ends[0]:.6g}, {ends[1]:.6g}]")  # fmt: skip
        if lower < upper:
            remedy = f"narrowed the leader's from [{lead.lower:.6g}, {lead.upper:.6g}] to [{lower:.6g}, {upper:.6g}]"
            limits[joint.mimic.joint] = replace(lead, lower=lower, upper=upper)
        else:
            remedy = "which contradicts the leader's own limits: ignored the follower's"
        repairs.append(Repair(where(joint.name), problem, remedy))
    return tuple(replace(j, limits=limits[j.name]) if j.mimic is None else j for j in joints)


def check_limits(limits: JointLimits, joint: str, where: str) -> None:
    """Raise `DescriptionError` if *limits* are reversed or negative."""
    if limits.lower > limits.upper:
        raise DescriptionError(f"{where}: joint {joint!r}: limits reversed: lower={limits.lower:g} is above "
                               f"upper={limits.upper:g}")  # fmt: skip
    for kind in ("velocity", "acceleration", "effort"):
        value = getattr(limits, kind)
        if value < 0.0:
            raise DescriptionError(f"{where}: joint {joint!r}: {kind} limit is {value:g}; expected a positive number")
