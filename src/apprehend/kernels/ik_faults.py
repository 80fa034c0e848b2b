"""What is wrong with the numbers that a step is asked for: looked at here, since NumPy takes longer than the step.

Only whether something is wrong is found; what it is, is said in Python.
"""

from __future__ import annotations

import math

from ._jit import kernel
from .ik_tasks import COM, DIRECTION, JOINTS, LOOK_AT

ROTATION_TOLERANCE = 1e-6  # as in `arrays`
OUTSIDE = 1e-9  # a joint may be this far outside its limits


@kernel(fast=False)  # a sum minus itself must stay what it is where it is not finite
def bad_target(kind, pick, data, goal):
    """Whether a target ``data (16)``, ``goal (n)`` is no finite pose, direction, or point."""
    total = 0.0
    if kind >= JOINTS:
        for c in pick:
            total += goal[c]
        return not math.isfinite(total)
    for i in range(16):
        total += data[i]
    if not math.isfinite(total):
        return True
    if kind == DIRECTION:
        return data[0] * data[0] + data[1] * data[1] + data[2] * data[2] < 1e-24
    if kind in (LOOK_AT, COM):
        return False
    if data[12] != 0.0 or data[13] != 0.0 or data[14] != 0.0 or data[15] != 1.0:
        return True
    for a in range(3):
        for b in range(a + 1):
            dot = data[a] * data[b] + data[4 + a] * data[4 + b] + data[8 + a] * data[8 + b]
            if abs(dot - (1.0 if a == b else 0.0)) > ROTATION_TOLERANCE:
                return True
    x = data[5] * data[10] - data[6] * data[9]
    y = data[6] * data[8] - data[4] * data[10]
    z = data[4] * data[9] - data[5] * data[8]
    return data[0] * x + data[1] * y + data[2] * z < 0.0


@kernel(fast=False, borrow=True)
def first_fault(tasks, data, goal, q, lower, upper, first, last):
    """What is wrong in the rows first … last: 0 nothing, −1 a joint value that is not finite or outside its limits,
    t + 1 the target of task t."""
    for i in range(first, last):
        for k in range(q.shape[1]):
            v = q[i, k]
            if not (v >= lower[k] - OUTSIDE and v <= upper[k] + OUTSIDE and math.isfinite(v)):
                return -1
    for t in range(tasks.kind.shape[0]):
        pick = tasks.pick[tasks.row[t] : tasks.row[t + 1]]
        for i in range(first, last):
            if i > 0 and data.shape[0] == 1:
                break
            if bad_target(tasks.kind[t], pick, data[i, t], goal[i, t]):
                return t + 1
    return 0
