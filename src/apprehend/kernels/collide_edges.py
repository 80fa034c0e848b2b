"""Many straight motions in joint space: which are free, and what the others hit."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from .collide import block_rates, covered, forget, make_space, place
from .lane_edges import edge_blocked, edge_space

QUEUE = 4096


@kernel(borrow=True)
def scan_pieces(model, qa, qb, margin, resolution, space, rate, queue, count):
    """The pair that is hit on the first *count* pieces in ``queue``, −1 for none, and where: ``(pair, s)``.

    Pieces are checked in their middle; each check covers the part around it in which no pair can lose more than its
    distance to *margin*, or *resolution* if that is more. What is left of the piece comes back into the queue.
    """
    n = qa.shape[0]
    block_rates(model, qa, qb, rate)
    q = queue[QUEUE, :n]
    head = 0
    while count > 0:
        if count < QUEUE - 128:
            k = head
            head = (head + 1) % QUEUE
        else:
            k = (head + count - 1) % QUEUE
        count -= 1
        low, high = queue[k, 0], queue[k, 1]
        middle = 0.5 * (low + high)
        for j in range(n):
            q[j] = qa[j] + middle * (qb[j] - qa[j])
        place(model, q, space)
        radius = covered(model, space, rate, margin, resolution, 0.5 * (high - low) + 1e-12)
        if radius < 0.0:
            return int(-1.0 - radius), middle
        if middle - radius > low:
            k = (head + count) % QUEUE
            queue[k, 0], queue[k, 1] = low, middle - radius
            count += 1
        if middle + radius < high:
            k = (head + count) % QUEUE
            queue[k, 0], queue[k, 1] = middle + radius, high
            count += 1
    return -1, 0.0


@kernel
def edges(exact, lanes, qa, qb, margin, resolution, every, start, stop, blocked):
    """``blocked[i]``: 1 if the motion ``qa[i] → qb[i]`` hits anything, else 0.

    What is remembered of pairs of shapes serves *every* so many motions.
    """
    space = edge_space(exact, lanes, qa.shape[1])
    for i in range(start, stop):
        if i % every == 0:
            forget(space.exact)
        blocked[i] = 1 if edge_blocked(exact, lanes, qa[i], qb[i], margin, resolution, space) else 0


@kernel
def edge_hits(model, qa, qb, margin, resolution, start, stop, out, where):
    """``out[i]`` = pair hit on the straight motion ``qa[i] → qb[i]``, at ``where[i]`` in 0 … 1; −1: free."""
    space, rate, queue = make_space(model), np.empty(model.blocks.shape[0]), np.empty((QUEUE + 1, max(qa.shape[1], 2)))
    for i in range(start, stop):
        forget(space)
        for end in range(2):  # the ends first, as pieces of no length
            queue[end, 0], queue[end, 1] = float(end), float(end)
        queue[2, 0], queue[2, 1] = 0.0, 1.0
        out[i], where[i] = scan_pieces(model, qa[i], qb[i], margin, resolution, space, rate, queue, 3)
