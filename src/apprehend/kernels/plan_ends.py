"""A first look at a start and goals: limits, collisions, and straight motions between them."""

from __future__ import annotations

import math

from ._jit import kernel
from .collide import first_hit
from .lane_edges import edge_blocked, edge_space
from .lanes import LANES
from .sphere import WHOLE_TURNS, hit_lanes

GOOD = 0
BEYOND = 1  # a joint limit
BLOCKED = 2  # by a collision


@kernel
def into_limits(ends, moving, lower, upper, slack, state):
    """Joints that may not move stay as in the start, endless ones take the short way, the others into their limits.

    ``state``: `GOOD`, or `BEYOND` where that moves a joint by more than *slack*.
    """
    for i in range(ends.shape[0]):
        state[i] = GOOD
        for j in range(ends.shape[1]):
            q = ends[i, j]
            if not moving[j]:
                q = ends[0, j]
            elif lower[j] == -math.inf and upper[j] == math.inf:
                q = ends[0, j] + (q - ends[0, j] + math.pi) % (2.0 * math.pi) - math.pi if i > 0 else q
            else:
                q = min(max(q, lower[j]), upper[j])
                if abs(q - ends[i, j]) > slack:
                    state[i] = BEYOND
            ends[i, j] = q


@kernel(borrow=True)
def mark_blocked(exact, lanes, ends, margin, space, state):
    """``state`` becomes `BLOCKED` where things touch in a row of *ends* that is `GOOD`."""
    own, decides = space.lanes, lanes.decides[0] == 1
    for first in range(0, ends.shape[0], LANES):
        used = min(LANES, ends.shape[0] - first)
        for lane in range(LANES):
            for j in range(ends.shape[1]):
                own.q[j * LANES + lane] = ends[first + min(lane, used - 1), j]
        hit_lanes(lanes, own, space.rates, margin, 0.0, LANES)
        for lane in range(used):
            i = first + lane
            if state[i] != GOOD:
                continue
            hit, far = own.flags[lane] > 0.0, False
            for j in range(ends.shape[1]):
                far |= abs(ends[i, j]) > WHOLE_TURNS
            if far or (hit and not decides):
                hit = first_hit(exact, ends[i], margin, space.exact) >= 0
            if hit:
                state[i] = BLOCKED


@kernel(borrow=True)
def sample_box(ends, moving, lower, upper, state, box):
    """Where configurations are drawn from: within the limits, half a turn around all good ends where there are none."""
    for j in range(ends.shape[1]):
        low, high = ends[0, j], ends[0, j]
        for i in range(ends.shape[0]):
            if state[i] == GOOD:
                low, high = min(low, ends[i, j]), max(high, ends[i, j])
        if moving[j]:
            low = lower[j] if lower[j] > -math.inf else low - math.pi
            high = upper[j] if upper[j] < math.inf else high + math.pi
        box[0, j], box[1, j] = low, high


@kernel
def look(exact, lanes, ends, moving, lower, upper, slack, margin, resolution, straight, state, box):
    """What is wrong with each of ``ends (1 + k, n)``, a start and k goals, which are put into their limits in place.

    ``state (1 + k,)``: `GOOD`, `BEYOND` or `BLOCKED`. ``box (2, n)``: the bounds for random configurations. Returns the
    number of the nearest good goal that a *straight* motion from the start reaches, −1 if none does.
    """
    into_limits(ends, moving, lower, upper, slack, state)
    space = edge_space(exact, lanes, ends.shape[1])  # its rates are zero: nothing moves yet
    mark_blocked(exact, lanes, ends, margin, space, state)
    sample_box(ends, moving, lower, upper, state, box)
    if not straight or state[0] != GOOD:
        return -1
    last, tried = -1.0, -1
    while True:
        best, goal = math.inf, -1
        for i in range(1, ends.shape[0]):
            if state[i] == GOOD:
                d = 0.0
                for j in range(ends.shape[1]):
                    d += (ends[i, j] - ends[0, j]) ** 2
                if d < best and (d > last or (d == last and i > tried)):
                    best, goal = d, i
        if goal < 0:
            return -1
        if not edge_blocked(exact, lanes, ends[0], ends[goal], margin, resolution, space):
            return goal - 1
        last, tried = best, goal
