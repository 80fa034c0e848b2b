"""Kernels on the whole kinematic tree: poses of all frames, centre of mass. On lanes, blocks spread over threads.

`TreeModel` is what a kernel sees of a robot. Fixed joints are merged away, the placement of the base is merged into
whatever hangs on the root, and every moving joint has its own frame, turned so that the joint's axis is z. With m
moving joints (mimicking ones included), F frames (links), and joints ordered so that a parent comes first:

===============  =============  ====================================================================================
field            shape          meaning
===============  =============  ====================================================================================
``parent``       (m,) int64     index of the joint that carries this one, −1: the root
``kind``         (m,) int64     0 revolute (or continuous), 1 prismatic
``coordinate``   (m,) int64     index into the robot's joint vector q (n,)
``gain``         (m, 2)         multiplier, offset: the joint's value is ``multiplier * q[coordinate] + offset``
``place``        (m, 12)        rotation (row-major, 9) and translation (3) of the joint's frame, at value 0, in the
                                moved frame of the parent joint (parent −1: in the world)
``frame_joint``  (F,) int64     the joint whose moved frame carries the link, −1: the root
``frame_place``  (F, 12)        the link's frame in that moved frame (−1: in the world)
``inertia``      (m + 1, 10)    of everything fixed to the moved frame, in its axes and about its origin: mass, mass ×
                                centre (3), then xx, xy, xz, yy, yz, zz of the inertia; row m (so also −1): what is
                                fixed to the root, in the world
``armature``     (m,)           rotor inertia that adds to the joint's own, kg m² or kg
===============  =============  ====================================================================================

Lane buffers are flat as in `chain`: component c of lane l is at ``c * LANES + l``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ._jit import kernel
from .chain import (
    PRISMATIC,
    REVOLUTE,
    at,
    lane_buffer,
    load_block,
    numbers,
    pose_buffer,
    pose_places,
    put_row,
    row_through,
    store_block,
    within_sincos,
    wrap_angles,
)
from .lanes import LANES, sincos


class TreeModel(NamedTuple):
    """Arrays of one robot; see the head of this module."""

    parent: np.ndarray
    kind: np.ndarray
    coordinate: np.ndarray
    gain: np.ndarray
    place: np.ndarray
    frame_joint: np.ndarray
    frame_place: np.ndarray
    inertia: np.ndarray
    armature: np.ndarray


@kernel(borrow=True)
def place_of(place, i, poses, parent, pose):
    """``pose = poses[parent] · place[i]`` on lanes, 12 components each; parent −1 is the world."""
    e = numbers(place, i)
    if parent < 0:
        for k in range(12):
            value = place[i, k]
            for lane in range(LANES):
                pose[k * LANES + lane] = value
        return
    start = at(parent, 12)
    for lane in range(LANES):
        for k in range(3):
            b0, b1, b2, p = row_through(poses, start, k, lane, e)
            put_row(pose, 0, k, lane, b0, b1, b2, p)


@kernel(inline=True)
def revolve_through(place, i, q, coordinate, multiplier, offset, pose, poses):
    """Move ``pose (12)`` through ``place[i]`` and a rotation about z by ``multiplier * q[coordinate] + offset``.

    The result is also ``poses[i]``.
    """
    e = numbers(place, i)
    t = at(i, 12)
    d = at(coordinate, 1)
    for lane in range(LANES):
        s, c = sincos(multiplier * q[d + lane] + offset)
        for k in range(3):
            b0, b1, b2, p = row_through(pose, 0, k, lane, e)
            a0 = b0 * c + b1 * s
            a1 = b1 * c - b0 * s
            put_row(pose, 0, k, lane, a0, a1, b2, p)
            put_row(poses, t, k, lane, a0, a1, b2, p)


@kernel(inline=True)
def slide_through(place, i, q, coordinate, multiplier, offset, pose, poses):
    """As `revolve_through`, for a translation along z."""
    e = numbers(place, i)
    t = at(i, 12)
    d = at(coordinate, 1)
    for lane in range(LANES):
        h = multiplier * q[d + lane] + offset
        for k in range(3):
            b0, b1, b2, p = row_through(pose, 0, k, lane, e)
            put_row(pose, 0, k, lane, b0, b1, b2, p + b2 * h)
            put_row(poses, t, k, lane, b0, b1, b2, p + b2 * h)


@kernel(borrow=True)
def begin_at(parent, poses, pose):
    """``pose (12)`` becomes the parent joint's moved frame, or the world (−1)."""
    L = LANES
    if parent < 0:
        for k in range(12):
            one = 1.0 if k == 0 or k == 4 or k == 8 else 0.0
            for lane in range(L):
                pose[k * L + lane] = one
    else:
        s = at(parent, 12)
        for c in range(12 * L):
            pose[c] = poses[s + c]


@kernel
def tree_block(model, q, value, poses):
    """`tree_through` with a scratch of its own."""
    tree_through(model, q, value, lane_buffer(12), poses)


@kernel(borrow=True)
def tree_through(model, q, value, scratch, poses):
    """Moved frames of all joints, ``poses (12 * m * LANES)``, of ``q (n * LANES)``.

    *value* ``(LANES)`` and *scratch* ``(12 * LANES)`` are written over.
    """
    gain = model.gain
    coordinate = model.coordinate
    near = within_sincos(q, model)
    parents = model.parent
    kind = model.kind
    place = model.place
    for i in range(kind.shape[0]):
        parent = parents[i]
        if parent < 0 or parent != i - 1:
            begin_at(parent, poses, scratch)
        if kind[i] == PRISMATIC:
            slide_through(place, i, q, coordinate[i], gain[i, 0], gain[i, 1], scratch, poses)
        elif near:
            revolve_through(place, i, q, coordinate[i], gain[i, 0], gain[i, 1], scratch, poses)
        else:
            wrap_angles(q, coordinate[i], gain[i, 0], gain[i, 1], value)
            revolve_through(place, i, value, 0, 1.0, 0.0, scratch, poses)


@kernel
def tree_poses(model, q, start, stop, out):
    """Poses of all frames, ``out (N, 16 F)``, of rows start … stop of ``q (N, n)``.

    Returns the first row that is not finite, or −1.
    """
    m = model.kind.shape[0]
    buffer = lane_buffer(q.shape[1])
    value = lane_buffer(1)
    poses = lane_buffer(12 * m)
    pose = pose_buffer()
    where = pose_places()
    bad = -1
    for first in range(start, stop, LANES):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        tree_through(model, buffer, value, pose, poses)
        _store_frames(model, poses, pose, where, first, stop, out)
    return bad


@kernel(borrow=True)
def _store_frames(model, poses, pose, where, first, count, out):
    """Poses of all frames of one block into rows of *out*."""
    for f in range(model.frame_joint.shape[0]):
        place_of(model.frame_place, f, poses, model.frame_joint[f], pose)
        store_block(pose, where, first, count, out, 16 * f)


@kernel
def tree_single(model, q, poses):
    """Moved frames of all joints, ``poses (m, 12)``, of one ``q (n,)``; returns 1 if q is not finite."""
    bad = 0
    for j in range(q.shape[0]):
        if not math.isfinite(q[j]):
            bad = 1
    for i in range(model.kind.shape[0]):
        _compose(poses, model.parent[i], model.place, i, poses[i])
        value = model.gain[i, 0] * q[model.coordinate[i]] + model.gain[i, 1]
        T = poses[i]
        if model.kind[i] == REVOLUTE:
            s = math.sin(value)
            c = math.cos(value)
            for k in range(3):
                b0 = T[3 * k]
                b1 = T[3 * k + 1]
                T[3 * k] = b0 * c + b1 * s
                T[3 * k + 1] = b1 * c - b0 * s
        else:
            for k in range(3):
                T[9 + k] += value * T[3 * k + 2]
    return bad


@kernel
def _compose(poses, parent, place, i, out):
    """``out = poses[parent] · place[i]``, each as 12 numbers; parent −1 is the world."""
    if parent < 0:
        for k in range(12):
            out[k] = place[i, k]
        return
    for k in range(3):
        a0 = poses[parent, 3 * k]
        a1 = poses[parent, 3 * k + 1]
        a2 = poses[parent, 3 * k + 2]
        for j in range(3):
            out[3 * k + j] = a0 * place[i, j] + a1 * place[i, 3 + j] + a2 * place[i, 6 + j]
        out[9 + k] = poses[parent, 9 + k] + a0 * place[i, 9] + a1 * place[i, 10] + a2 * place[i, 11]


@kernel
def frames_single(model, q, out):
    """Poses of all frames, ``out (F, 4, 4)``, of one ``q (n,)``; returns 1 if q is not finite."""
    poses = np.empty((model.kind.shape[0], 12))
    bad = tree_single(model, q, poses)
    T = np.empty(12)
    for f in range(model.frame_joint.shape[0]):
        _compose(poses, model.frame_joint[f], model.frame_place, f, T)
        for k in range(3):
            for j in range(3):
                out[f, k, j] = T[3 * k + j]
            out[f, k, 3] = T[9 + k]
            out[f, 3, k] = 0.0
        out[f, 3, 3] = 1.0
    return bad


@kernel
def centers_of_mass(model, q, start, stop, out):
    """Centres of mass ``out (N, 3)`` in the world of rows start … stop of ``q (N, n)``; the first bad row, or −1."""
    L = LANES
    m = model.kind.shape[0]
    buffer = lane_buffer(q.shape[1])
    value = lane_buffer(1)
    scratch = lane_buffer(12)
    poses = lane_buffer(12 * m)
    total = lane_buffer(3)
    inertia = model.inertia
    where = np.arange(3) * L
    bad = -1
    for first in range(start, stop, L):
        row = load_block(q, first, stop, buffer)
        if row >= 0 and bad < 0:
            bad = row
        tree_through(model, buffer, value, scratch, poses)
        _moments_of_mass(inertia, poses, total)
        store_block(total, where, first, stop, out, 0)
    return bad


@kernel(borrow=True)
def _moments_of_mass(inertia, poses, total):
    """Centre of mass in the world of one block, ``total (3)``."""
    L = LANES
    m = inertia.shape[0] - 1
    mass = inertia[m, 0]
    for k in range(3):
        for lane in range(L):
            total[k * L + lane] = inertia[m, 1 + k]
    for i in range(m):
        t = at(i, 12)
        w, x, y, z = inertia[i, 0], inertia[i, 1], inertia[i, 2], inertia[i, 3]
        mass += w
        for lane in range(L):
            for k in range(3):
                total[k * L + lane] += (
                    w * poses[t + (9 + k) * L + lane]
                    + x * poses[t + 3 * k * L + lane]
                    + y * poses[t + (3 * k + 1) * L + lane]
                    + z * poses[t + (3 * k + 2) * L + lane]
                )
    for c in range(3 * L):
        total[c] /= mass
