"""Contact-based closing: fingers move until they touch, never through what they touch (G 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..robots.description import JointType
from .contact import Contact, ContactModel
from .fingers import Fingers
from .surface import Surface

NEAREST = 1e-4
"""A finger stops when something of it is this near to the surface, in m."""
TOUCH = 3e-4
"""What is nearer than this touches, in m; the hand as planned stands off by that much and penetrates nothing."""
STRIDE = 0.15
"""Largest change of a joint in one step, in rad or units of 0.1 m."""
STEPS = 60
WITHIN = 0.04
"""Distances beyond this are not measured, in m."""


@dataclass(frozen=True, eq=False)
class Touching:
    """N hands that have closed: joints ``q (N, n)``, distances ``(N, S)`` of the shapes of their links from the surface
    (at most `WITHIN`), and nearest points ``(N, S, 2, 3)`` on shape and surface in the frame of the body."""

    q: Array
    distance: Array
    near: Array


def levers(fingers: Fingers) -> Array:
    """``(S, n)``: how far any point of a shape moves at most, in m per unit of a coordinate, in any configuration.

    The sum of the lengths from the joint to the far side of the shape, times the gear of a mimicking joint.
    """
    robot = fingers.robot
    joints = {joint.child: joint for joint in robot.description.joints}
    free = {name: i for i, name in enumerate(robot.joint_names)}
    out = np.zeros((len(fingers.shapes), robot.n))
    for s, (owner, shape) in enumerate(zip(fingers.owner, fingers.shapes, strict=True)):
        centre, radius = shape.ball
        length = float(np.linalg.norm(centre)) + radius
        link = robot.frame_names[owner]
        while link in joints:
            joint = joints[link]
            driver, gear = (joint.mimic.joint, joint.mimic.multiplier) if joint.mimic else (joint.name, 1.0)
            if joint.type is JointType.PRISMATIC:
                out[s, free[driver]] += abs(gear)
                length += max(abs(joint.limits.lower), abs(joint.limits.upper)) * abs(gear)
            elif joint.type is not JointType.FIXED:
                out[s, free[driver]] += abs(gear) * length
            length += float(np.linalg.norm(joint.pose[:3, 3]))
            link = joint.parent
    return out


def _slopes(fingers: Fingers, q: Array) -> tuple[Array, list[Array]]:
    """Pad places ``(N, k, 3)`` and for each finger ``(N, 3, n_i)``: how its own coordinates move its pad."""
    robot = fingers.robot
    places = fingers.pad_places(q)[0]
    slopes = []
    for i, tip in enumerate(fingers.tips):
        J = robot.jacobian(q, tip)[..., fingers.coordinates[i]]
        arm = places[:, i] - robot.fk(q, tip)[:, :3, 3]
        slopes.append(J[:, :3] + np.cross(J[:, 3:], arm[:, :, None], axisa=1, axisb=1, axisc=1))
    return places, slopes


def _towards(fingers: Fingers, q: Array, targets: Array, free: BoolArray) -> Array:
    """The steepest step ``(N, n)`` of the *free* coordinates ``(N, n)`` that brings pads nearer to ``(N, k, 3)``."""
    robot = fingers.robot
    places, slopes = _slopes(fingers, q)
    step = np.zeros_like(q)
    for i, own in enumerate(fingers.coordinates):
        gap = targets[:, i] - places[:, i]
        descent = np.einsum("nij,ni->nj", slopes[i], gap)
        blocked = ((descent > 0.0) & (q[:, own] >= robot.limits.upper[own] - 1e-9)) | (
            (descent < 0.0) & (q[:, own] <= robot.limits.lower[own] + 1e-9)
        )
        descent = np.where(free[:, own] & ~blocked, descent, 0.0)
        moved = np.einsum("nij,nj->ni", slopes[i], descent)
        best = (descent**2).sum(axis=1) / np.maximum((moved**2).sum(axis=1), 1e-18)
        one = best[:, None] * descent
        one *= np.minimum(1.0, STRIDE / np.maximum(np.abs(one).max(axis=1), 1e-12))[:, None]
        step[:, own] = one
    wished: Array = np.clip(q + step, robot.limits.lower, robot.limits.upper) - q
    return wished


def retract(fingers: Fingers, q: Array, distance: float) -> Array:
    """Joints with the pads drawn back by *distance* from the way they face, as far as the limits allow."""
    places, normals = fingers.pad_places(q)
    targets = places - distance * normals
    free = np.ones(q.shape, np.bool_)
    for _ in range(8):
        q = q + _towards(fingers, q, targets, free)
    return q


def close(fingers: Fingers, surface: Surface, q: Array, T_body_hand: Array, targets: Array) -> Touching:
    """Close N hands at poses ``T_body_hand (N, 4, 4)`` from joints ``q (N, n)`` until each finger touches or is done.

    Every pad goes down the distance to its target ``(N, k, 3)`` in the hand frame. A step is never longer than the
    distance that remains, by a bound that holds for all configurations (conservative advancement), so nothing is
    passed through. When a link touches, the joints that carry it stop; those beyond it go on (an enveloping grasp). A
    finger that would meet another one stops before it.
    """
    lever, moves = levers(fingers), fingers.moves
    q = q.copy()
    running = np.arange(len(q))
    distance, _ = fingers.distances(surface, q, T_body_hand, WITHIN)
    barred = np.zeros(q.shape, np.bool_)
    groups = [moves[:, own].any(axis=1) for own in fingers.coordinates]
    for _ in range(STEPS):
        d, at = distance[running], q[running]
        stopped: BoolArray = np.asarray(((d <= TOUCH)[:, :, None] & moves).any(axis=1))
        step = _towards(fingers, at, targets[running], ~(stopped | barred[running]))
        speed = np.abs(step) @ lever.T
        room = np.maximum(d - NEAREST, 0.0) / np.maximum(speed, 1e-12)
        for own, group in zip(fingers.coordinates, groups, strict=True):
            step[:, own] *= np.minimum(1.0, room[:, group].min(axis=1, initial=1.0))[:, None]
        step = _apart(fingers, at, step, barred, running)
        q[running] = at + step
        moving = np.abs(step) @ lever.T > 1e-6
        wanted = moving & ((np.abs(step) > 0.0)[:, None, :] & moves).any(axis=2)
        fresh, _ = fingers.distances(surface, q[running], T_body_hand[running], WITHIN, wanted)
        distance[running] = np.where(wanted, fresh, distance[running])
        running = running[moving.any(axis=1)]
        if not len(running):
            break
    distance, near = fingers.distances(surface, q, T_body_hand, WITHIN)
    return Touching(q, distance, near)


def _apart(fingers: Fingers, q: Array, step: Array, barred: BoolArray, running: IntArray) -> Array:
    """The *step* without what would make fingers meet; the coordinates of such a finger are barred from then on."""
    bad = np.flatnonzero(~fingers.own.free(q + step))
    if not len(bad):
        return step
    kept = np.zeros((len(bad), q.shape[1]))
    for own in fingers.coordinates:
        trial = kept.copy()
        trial[:, own] = step[bad][:, own]
        free = fingers.own.free(q[bad] + trial)
        kept[free] = trial[free]
        barred[np.ix_(running[bad[~free]], own)] = True
    out = step.copy()
    out[bad] = kept
    return out


def contacts_of(
    fingers: Fingers, touching: Touching, i: int, friction: float, torsion: float
) -> tuple[tuple[Contact, ...], tuple[str, ...]]:
    """The contacts of hand *i*, one per link that touches, and the links; soft fingers if *torsion* is positive.

    A contact is the nearest point of the surface, its normal the line from the link to it: right on faces, edges and
    corners alike.
    """
    d, near = touching.distance[i], touching.near[i]
    made, links = [], []
    for owner in np.unique(fingers.owner):
        mine = np.flatnonzero(fingers.owner == owner)
        s = mine[int(np.argmin(d[mine]))]
        gap = near[s, 1] - near[s, 0]
        length = float(np.linalg.norm(gap))
        if d[s] > TOUCH or length < 1e-7:
            continue
        model = ContactModel.SOFT if torsion > 0.0 else ContactModel.COULOMB
        made.append(Contact(near[s, 1].copy(), gap / length, friction, model, torsion))
        links.append(fingers.robot.frame_names[owner])
    return tuple(made), tuple(links)
