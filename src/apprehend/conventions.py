"""The conventions that every room shares, as values that code and tests refer to (prose: docs/conventions.md).

SI units and radians. Frames are right-handed. ``T_ab`` maps coordinates of b into a, so names cancel when read:
``T_ac = T_ab @ T_bc``. Twists are ``(v, w)`` and wrenches ``(f, tau)``, linear part first (G 1.3, 1.9).
Quaternions are ``(w, x, y, z)``. The z axis of a contact frame is the inward normal (G 2.1.1).
Batch dimensions lead and broadcast.
"""

from __future__ import annotations

import math

GRAVITY = 9.81
"""Magnitude of the standard gravity used in the scenes, in m/s²; it acts along −z of the world."""

LINEAR = slice(0, 3)
"""Rows of the linear part of a twist or a wrench."""

ANGULAR = slice(3, 6)
"""Rows of the angular part of a twist or a wrench."""

DEGREE = math.pi / 180.0
"""One degree in radians: the only place where degrees appear is a person's input or output."""
