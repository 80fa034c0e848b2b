"""Second-order sticking: an object that is carried along a curve does not drift out of the hand.

The engine makes the velocities of two bodies at a sticking contact equal with the geometry of the step's beginning, and
leaves out how that geometry changes during the step (the term J̇q̇ of the contact's acceleration). A hand on an arc
then leaves the object, which moves along the tangent, by ½ J̇q̇ Δt² in every step: at 1 m/s a millimetre per second.
Asking the friction rows for half of that acceleration in the step cancels the error to the next order. What friction
can do is still bounded by its cone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..kernels import stick as kernels
from .shapes import BODY, ROBOT

if TYPE_CHECKING:
    from .model import Plant

SLOW = 0.02  # m/s of relative velocity below which a contact sticks
STILL = 0.02  # rad/s or m/s of the fastest joint below which nothing is to be corrected


def carry_along(plant: Plant, data: Any) -> None:
    """Correct the friction rows of contacts between links and movable bodies; between the two halves of a step."""
    contact = data.contact
    if not len(contact.dist) or np.abs(data.qvel[plant.joint_v]).max(initial=0.0) < STILL:
        return
    model = plant.model
    bodies = model.geom_bodyid[contact.geom]
    kinds = plant.kinds[bodies]
    rows = np.flatnonzero(
        (contact.efc_address >= 0) & (kinds.sum(axis=1) == ROBOT + BODY) & (kinds[:, 0] != kinds[:, 1])
    )
    if not rows.size:
        return
    data.qacc[:] = 0.0
    mujoco.mj_rnePostConstraint(model, data)  # accelerations of all bodies while no joint accelerates
    involved, place = np.unique(bodies[rows], return_inverse=True)
    place = place.reshape(-1, 2).astype(np.int64)
    velocity, acceleration = np.empty((len(involved), 6)), np.empty((len(involved), 6))
    kind = mujoco.mjtObj.mjOBJ_XBODY
    for i, body in enumerate(involved):
        mujoco.mj_objectVelocity(model, data, kind, body, velocity[i], 0)
        mujoco.mj_objectAcceleration(model, data, kind, body, acceleration[i], 0)
    start = contact.efc_address[rows].astype(np.int64) + 1
    reference = data.efc_aref.copy()
    kernels.correct(
        contact.pos[rows], contact.frame[rows], place[:, 0].copy(), place[:, 1].copy(), data.xpos[involved],
        velocity, acceleration, start, SLOW, reference,
    )  # fmt: skip
    data.efc_aref[:] = reference
