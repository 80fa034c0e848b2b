"""Grasp planning on the mesh itself, for parallel jaws and for hands with several fingers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import choice
from ..bodies import Body
from ..errors import expect
from ..kinematics import Hand
from .candidates import GraspPlan
from .hand_settings import HandSettings, checked_hand
from .jaw_search import Search
from .jaw_settings import Settings, checked, directions, half_spaces


def plan(
    hand: Hand,
    body: Body,
    n: int = 50,
    *,
    rng: np.random.Generator,
    friction: float | None = None,
    table: ArrayLike | None = None,
    approach: ArrayLike | None = None,
    approach_tolerance: float = np.pi / 3,
    max_force: float | None = None,
    clearance: float = 0.005,
    table_clearance: float = 0.003,
    standoff: float = 0.1,
    samples: int | None = None,
    angles: int = 24,
    cone_margin: float = np.radians(3.0),
    compliance: float = 1e-3,
    safety: float = 2.0,
    acceleration: float = 2.0,
    apart: tuple[float, float] = (0.01, np.radians(20.0)),
    method: str = "both",
) -> GraspPlan:
    """Plan up to *n* grasps of *body* by *hand*, best first (G 2; G 4: plan for object and scene).

    **Hands with several fingers** are planned by both ways of G 4's table, or by one: *method* ``"inverse"`` chooses
    sets of surface points that close (`force_closures`), finds palm pose and joints that bring the pads there
    (`ik.solve_frames` on a floating palm), draws the pads back, and closes; ``"closing"`` puts the place that the pads
    of a pre-grasp posture face into the body, comes from outside as far as there is room, and closes until contact.
    Closing stops by exact distances of the links' convex shapes from the mesh, at most 0.3 mm off it: no link
    penetrates. The open hand (`HandCandidate.pregrasp`, as wide as leaves room, *clearance* where it can be had) comes
    from *standoff* back along the approach and meets neither body nor table. Candidates are `HandCandidate`: joints,
    pre-grasp, one contact per link that touches, the internal force that proves force closure; ``quality`` is the
    certified lower bound of ε (L1, exact cones, torques over the body's radius), and ``margins`` hold it with
    ``closure``, ``contacts``, ``position`` (m that every contact may be off), ``force`` (N), ``com_distance``,
    ``distance`` (of the nearest link, in m). The contact forces must hold weight and acceleration within the efforts of
    the joints where they are known. *samples* are tries per way (480 if None); *approach*, *table*, *table_clearance*,
    *friction*, *max_force*, *safety*, *acceleration* and *apart* mean the same for all hands, the other options concern
    jaws.

    **Parallel jaws**: antipodal pairs of surface points (*samples*, 2000 if None) are found by ray casting on the mesh;
    each closing line is tried at *angles* approach directions around it and at several depths. A pose counts if the
    open hand (convex pieces of all links, at least *clearance* wider than the body on each side) meets neither the body
    nor the table, also while it comes from *standoff* back along the approach; if the pads, resting on what stands out
    most (*compliance* deep), touch two patches whose normals lie within the friction cones of their connecting line by
    *cone_margin*; if the closed hand has room; and if the hand can hold the weight and accelerations of *acceleration*
    m/s² in every direction with *safety*, pressing with at most *max_force* (default: what the hand can).

    *friction* µ (default: the body's). *table*: the body's pose T_table_body ``(4, 4)`` on a table whose top is z = 0,
    or half-spaces ``(K, 4)`` in the frame of the body: rows (n, d) keep ``n·x ≥ d`` free for the hand; gravity acts
    against the first n (without a table: in the worst of 14 directions). *approach*: directions ``(K, 3)`` in the
    body's frame; the hand comes within *approach_tolerance* of one of them. *apart*: distance in m and angle in rad
    below which a worse grasp counts as a copy of a better one (a turn by π about the approach is the same grasp).

    The quality is the product of four parts, each in [0, 1], with exponents `jaw_search.WEIGHTS`: *cone*, the
    cone margin over arctan µ; *force*, ``1 − required / max_force``; *centre*, ``1 / (1 + (2 d / r)²)`` with d the
    distance of the centre of mass from the closing line and r the body's radius; *coverage*, the square root of the
    share of the smaller patch in its pad. ``margins`` holds ``epsilon`` (certified lower bound, L1, exact cones,
    torques over the body's radius), ``cone`` (rad), ``force`` (N), ``com_distance`` (m), ``coverage``, ``torsion``
    (γ in m) and the quality's four parts.

    γ of a contact is µ times the mean distance of its patch from the patch's middle (even pressure), at least the
    body's `torsional_friction`. The answer is the same for the same state of *rng*. Raises `InputError` for arguments
    without meaning and `DescriptionError` if the hand has neither a jaw nor two fingers with geometry.
    """
    for value, kind, name in ((hand, "Hand", "hand"), (body, "Body", "body"), (rng, "Generator", "rng")):
        expect(value, kind, name)
    choice(method, "method", ("both", "inverse", "closing"))
    if not hand.is_jaw:
        given = HandSettings(
            body.friction if friction is None else float(friction),
            ("inverse", "closing") if method == "both" else (method,), 480 if samples is None else samples,
            half_spaces(table), acceleration, safety, apart, np.inf if max_force is None else float(max_force),
            directions(approach), approach_tolerance, clearance, table_clearance,
            standoff,
        )  # fmt: skip
        from .hand_plan import HandSearch

        return HandSearch(hand, body, checked_hand(given, n), rng, n).run()
    jaw = hand.jaw
    mu = body.friction if friction is None else float(friction)
    settings = checked(
        Settings(
            mu, jaw.max_force if max_force is None else float(max_force), clearance, standoff,
            2000 if samples is None else samples, angles, cone_margin, compliance, safety, acceleration,
            table_clearance, directions(approach), approach_tolerance, half_spaces(table), apart,
        ),
        n,
    )  # fmt: skip
    return Search(hand, jaw, body, settings, rng, n).run()
