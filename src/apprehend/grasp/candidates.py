"""What grasp planning answers with: candidates, best first, and why samples were rejected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..result import Result, Status
from .contact import Contact

if TYPE_CHECKING:
    from ..bodies import Body
    from .grasp import Grasp


class PlanStatus(Status):
    """Outcomes of `plan`."""

    SUCCESS = "grasps were found"
    TOO_WIDE = "the body is wider than the jaw opens wherever two sides face each other"
    TOO_THIN = "the body is thinner than the jaw closes wherever two sides face each other"
    NO_OPPOSITE_SIDES = "no two sides of the body face each other within the friction cones"
    NO_APPROACH = "no closing line can be approached from the directions that are asked for"
    NO_ROOM = "the open hand has no room: it would hit the body, or the table, wherever it could close"
    NO_CONTACT = "the pads would not meet opposite surfaces firmly enough wherever the open hand has room"
    NO_CLOSURE = "wherever the fingers touch, the contacts do not resist every wrench"
    OUT_OF_REACH = "no set of contacts that closes is within the reach of the fingers"
    TOO_FEW = "too few links touch the body where the fingers close"
    TOO_WEAK = "the hand is too weak to hold the body with the friction given"


@dataclass(frozen=True, eq=False)
class Candidate:
    """One grasp of a body, in the frame of the body; here by a parallel jaw."""

    pose: Array
    """T_body_hand ``(4, 4)``: where the hand's root link is when the pads touch."""
    tcp: Array
    """T_body_tcp ``(4, 4)``: midway between the pads; x from pad 1 to pad 0, z the approach direction."""
    width: float
    """Distance between the pads at contact, in m."""
    opening: float
    """Distance between the pads while approaching, in m."""
    contacts: tuple[Contact, ...]
    """Soft fingers where pad 0 and pad 1 touch."""
    quality: float
    """Between 0 and 1; see `plan`."""
    margins: Mapping[str, float]
    """The facts behind the quality; see `plan`."""
    required_force: float
    """Normal force at each pad, in N, that holds the body against its weight and the accelerations asked for,
    the safety factor included."""

    @property
    def approach(self) -> Array:
        """Unit vector ``(3,)`` along which the hand comes, in the frame of the body."""
        direction: Array = self.tcp[:3, 2].copy()
        return direction

    def retreated(self, distance: float) -> Array:
        """T_body_hand ``(4, 4)`` moved back by *distance* against the approach direction."""
        T = self.pose.copy()
        T[:3, 3] -= distance * self.approach
        return T


@dataclass(frozen=True, eq=False)
class HandCandidate(Candidate):
    """A grasp by a hand with several fingers. ``width`` is the largest distance between two contacts."""

    q: Array
    """Joints of the hand ``(n,)`` when it touches."""
    pregrasp: Array
    """Joints ``(n,)`` from which the fingers close."""
    links: tuple[str, ...]
    """The link that makes each contact."""
    method: str
    """``"inverse"`` (hand kinematics to chosen contacts) or ``"closing"`` (contact-based)."""
    internal_force: Array
    """The strict internal force that proves force closure; see `Closure`."""

    def grasp(self, body: Body) -> Grasp:
        """The grasp of *body* with these contacts."""
        from .grasp import Grasp

        return Grasp(self.contacts, body)


@dataclass(frozen=True, eq=False)
class GraspPlan(Result):
    """Candidates, best first; iterable and indexable. ``status`` says why there are none."""

    status: PlanStatus
    candidates: tuple[Candidate, ...]
    body: str
    hand: str
    rejected: Mapping[str, int]
    """How many samples fell at each check, in the order of the checks."""
    sampled: int
    """Number of antipodal pairs that were found on the surface."""
    facts: Mapping[str, float]
    """Numbers that the explanation uses, in SI units."""

    def __len__(self) -> int:
        return len(self.candidates)

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self.candidates)

    def __getitem__(self, index: int) -> Candidate:
        return self.candidates[index]

    @property
    def poses(self) -> Array:
        """T_body_hand of all candidates ``(N, 4, 4)``."""
        return np.array([c.pose for c in self.candidates]).reshape(-1, 4, 4)

    def explain(self) -> str:
        """One or two sentences: the outcome with its numbers, and the remedy."""
        f = {k: 1e3 * v for k, v in self.facts.items()}
        who = f"{self.hand!r} on {self.body!r}"
        if self.status is PlanStatus.SUCCESS:
            ways = [k.removeprefix("found_") for k in self.facts if k.startswith("found_")]
            by = ", ".join(
                f"{self.facts['found_' + w]:.0f} of {self.facts['tried_' + w]:.0f} tries by {w}" for w in ways
            )
            return f"{who}: {len(self.candidates)} grasps, best quality {self.candidates[0].quality:.2f}" + (
                f" ({by})" if by else ""
            )
        counts = ", ".join(f"{n} {why}" for why, n in self.rejected.items() if n)
        if self.status is PlanStatus.TOO_WIDE:
            return (
                f"{who}: {self.status.value}: smallest graspable width {f['smallest_width']:.0f} mm > "
                f"{f['widest_grasp']:.0f} mm (the jaw opens {f['max_width']:.0f} mm, less clearance on both sides); "
                "use a wider hand, or less clearance"
            )
        if self.status is PlanStatus.TOO_THIN:
            return (
                f"{who}: {self.status.value}: largest graspable width {f['largest_width']:.1f} mm < "
                f"{f['min_width']:.1f} mm; use a hand that closes further"
            )
        if self.status is PlanStatus.NO_OPPOSITE_SIDES:
            return f"{who}: {self.status.value} (µ = {self.facts['friction']:g}); is the mesh closed, and µ right?"
        if self.status is PlanStatus.TOO_WEAK and "least_force" in self.facts:
            return (
                f"{who}: {self.status.value}: the easiest grasp needs {self.facts['least_force']:.1f} N at each pad, "
                f"{self.facts['max_force']:.1f} N are allowed ({counts})"
            )
        return f"{who}: {self.status.value} ({counts})"
