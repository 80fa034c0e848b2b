"""Which pairs of links may touch: found from the tree and by sampling, read from SRDF, written to SRDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ..arrays import Array, BoolArray
from ..errors import DescriptionError, InputError, suggestion
from ..files import replace_file
from ..kernels import collide
from ..kinematics import Robot
from ..robots import Semantics, parse_srdf, read_srdf
from .compiled import Alone
from .nodes import Node, Pair, link_nodes, linkages, neighbours, pair
from .shapes import Convex

SAMPLES = 500
"""Random configurations in which a pair of links is tried when a model is made."""

ALWAYS = 0.95
"""Share of the samples from which on a pair counts as always touching."""

OFTEN = 0.5
"""Share from which on a pair counts as connected, if a joint may connect it."""

DESCRIBED = "allowed by the description"
COUPLED = "parts of one coupled mechanism"
ADJACENT = "connected by a joint"
TOUCHING = "touch in nearly every configuration"
DEFAULT = "touch in the home configuration"
NEVER = "touch in none of the sampled configurations"

WORDS = {COUPLED: "Adjacent", ADJACENT: "Adjacent", TOUCHING: "Always", DEFAULT: "Default", NEVER: "Never"}
"""What SRDF files call the reasons; any other is "User"."""


@dataclass(frozen=True, eq=False)
class AllowedPairs:
    """The allowed-collision matrix of a robot, and why each pair is in it."""

    robot: str
    links: tuple[str, ...]
    """Links with collision geometry."""
    reasons: Mapping[Pair, str]
    rates: Mapping[Pair, float]
    """Share of the sampled configurations in which a pair touches, for the pairs that were sampled."""
    samples: int

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs, for `CollisionModel.allow`."""
        return tuple((a, b) for a, b in sorted(sorted(p) for p in self.reasons if len(p) == 2))

    @property
    def matrix(self) -> BoolArray:
        """``(links, links)``: whether two links may touch; the diagonal is true."""
        number = {name: i for i, name in enumerate(self.links)}
        out = np.eye(len(self.links), dtype=bool)
        for a, b in self.pairs:
            if a in number and b in number:
                out[number[a], number[b]] = out[number[b], number[a]] = True
        return out

    def to_srdf(self) -> str:
        """The matrix as SRDF text, with the reasons as setup assistants write them."""
        lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(self.robot)}>"]
        for a, b in self.pairs:
            why = WORDS.get(self.reasons[pair(a, b)], "User")
            lines.append(f"  <disable_collisions link1={quoteattr(a)} link2={quoteattr(b)} reason={quoteattr(why)}/>")
        return "\n".join([*lines, "</robot>", ""])

    def save(self, path: str | Path) -> Path:
        """Write `to_srdf` to *path*."""
        path = Path(path)
        with replace_file(path) as work:
            work.write_text(self.to_srdf(), encoding="utf-8")
        return path


def find_allowed_pairs(
    robot: Robot,
    *,
    rng: np.random.Generator,
    samples: int = 10_000,
    never: bool = True,
    clearance: float = 0.0,
    geometry: Mapping[str, Sequence[Convex]] | None = None,
) -> AllowedPairs:
    """The pairs of links that need no check, as setup assistants find them.

    A pair is allowed where the description says so, where one joint connects it, where it belongs to one coupled
    mechanism, where it touches (is nearer than *clearance*) in nearly all of *samples* random configurations or at
    home, and with *never* where it touched in none of them. The last is no proof: among N independent configurations
    without a touch the chance of one is below 3/N with 95 % confidence. `CollisionModel` leaves *never* out.
    """
    if samples < 1:
        raise InputError(f"samples is {samples}; expected 1 or more")
    links = link_nodes(robot, geometry)
    reasons, rates = by_sampling(robot, links, clearance, samples, rng)
    q = robot.home[None]
    untried = [p for p in rates if p not in reasons]
    hits = _touching(robot, links, untried, q, clearance)
    reasons |= {p: DEFAULT for p, count in zip(untried, hits, strict=True) if count}
    if never:
        reasons |= {p: NEVER for p, rate in rates.items() if rate == 0.0 and p not in reasons}
    return AllowedPairs(robot.name, tuple(node.name for node in links), reasons, rates, samples)


def by_tree(robot: Robot, links: Sequence[Node]) -> dict[Pair, str]:
    """Pairs that the description allows or that the tree connects."""
    description = robot.description
    reasons = dict.fromkeys(description.allowed_collisions, DESCRIBED)
    reasons |= dict.fromkeys(linkages(robot.model, links), COUPLED)
    reasons |= dict.fromkeys(neighbours(description, {node.name for node in links})[0], ADJACENT)
    return reasons


def by_sampling(
    robot: Robot, links: Sequence[Node], clearance: float, samples: int, rng: np.random.Generator
) -> tuple[dict[Pair, str], dict[Pair, float]]:
    """Pairs of `by_tree`, those that nearly always touch, and those that a joint may connect and that often do.

    And how often each of the sampled pairs touches.
    """
    reasons = by_tree(robot, links)
    tried = [
        pair(a.name, b.name)
        for i, a in enumerate(links)
        for b in links[:i]
        if a.carrier != b.carrier and pair(a.name, b.name) not in reasons
    ]
    q = rng.uniform(*sampled(robot), (samples, robot.n))
    hits = _touching(robot, links, tried, q, clearance)
    rates = {p: float(count) / samples for p, count in zip(tried, hits, strict=True)}
    reasons |= {p: TOUCHING for p, rate in rates.items() if rate >= ALWAYS}
    indirect = neighbours(robot.description, {node.name for node in links})[1]
    reasons |= {p: ADJACENT for p in indirect if rates.get(p, 0.0) >= OFTEN}
    return reasons, rates


def sampled(robot: Robot) -> tuple[Array, Array]:
    """Between which values joints are sampled: their limits; of what turns, one turn; of what slides on, 2π m."""
    lower, upper = robot.limits.lower, robot.limits.upper
    low, high = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    slides = np.zeros(robot.n, dtype=bool)
    slides[robot.model.coordinate[robot.model.kind != 0]] = True
    whole = np.isfinite(lower) & np.isfinite(upper) & (slides | (low >= high))
    return np.where(whole, lower, low), np.where(whole, upper, high)


def _touching(robot: Robot, links: Sequence[Node], pairs: Sequence[Pair], q: Array, clearance: float) -> Array:
    """In how many of the configurations ``q (N, n)`` each pair touches."""
    if not pairs:
        return np.zeros(0)
    others = {pair(a.name, b.name) for i, a in enumerate(links) for b in links[:i]} - set(pairs)
    model = Alone(robot.model, tuple(links), others).with_others((), ())
    hits = np.zeros(len(model.blocks), np.int64)
    collide.count_hits(model, q, clearance, 0, len(q), hits)
    found = {pair(links[a].name, links[b].name): n for (a, b), n in zip(model.blocks[:, :2], hits, strict=True)}
    return np.array([found[p] for p in pairs], dtype=np.float64)


def srdf_pairs(source: str | Path | Semantics, robot: Robot) -> dict[Pair, str]:
    """The pairs that an SRDF (file, text, or read already) allows; unknown links are an error that names them."""
    if isinstance(source, Semantics):
        semantics = source
    elif isinstance(source, str) and source.lstrip().startswith("<"):
        semantics = parse_srdf(source, "the SRDF text")
    else:
        semantics = read_srdf(source)
    names = set(robot.frame_names)
    for name in sorted({name for p in semantics.allowed for name in p} - names):
        hint = suggestion(name, names) or f" Its links are {', '.join(robot.frame_names[:8])}, …"
        raise DescriptionError(
            f"{semantics.source}: disable_collisions names {name!r}, which is no link of robot {robot.name!r}.{hint}"
        )
    return dict.fromkeys(semantics.allowed, f"allowed by {semantics.source.name}")
