"""From a description to the arrays that kernels read: `tree_model` and `chain_model`.

Fixed joints are merged into constant transforms, links that move together into one inertia, and the frame of every
moving joint is turned so that its axis is z: a joint then costs two column mixes (revolute) or one addition
(prismatic). The layouts are documented in `apprehend.kernels.tree` and `apprehend.kernels.chain`.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..errors import DescriptionError, suggestion
from ..kernels.chain import PRISMATIC, REVOLUTE, ChainModel
from ..kernels.tree import TreeModel
from ..robots.description import Description, Inertial, Joint, JointType


def turn_z_to(axis: Array) -> Array:
    """The smallest rotation (3, 3) that turns z into the unit vector *axis* (a half turn about x for −z)."""
    x, y, z = (float(v) for v in axis)
    if x == 0.0 and y == 0.0:
        return np.eye(3) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    # Rodrigues with the cross product of z and axis; 1 / (1 + z) = (1 - z) / (x² + y²) keeps its digits near −z
    f = 1.0 / (1.0 + z) if z > -0.5 else (1.0 - z) / (x * x + y * y)
    return np.array([[1.0 - x * x * f, -x * y * f, x], [-x * y * f, 1.0 - y * y * f, y], [-x, -y, z]])


def tree_model(description: Description, base: Array) -> TreeModel:
    """Arrays of the whole tree with its root link placed at *base* ``(4, 4)``, T_world_root.

    Raises `DescriptionError` for a joint whose parent link comes later or not at all, a link with two parents, an
    axis that is no direction, and a mimic joint without a free joint to follow.
    """
    name = description.name
    coordinate = {joint.name: i for i, joint in enumerate(description.free_joints)}
    carrier: dict[str, int] = {description.root: -1}
    place: dict[str, Array] = {description.root: base}
    parent: list[int] = []
    kind: list[int] = []
    follows: list[int] = []
    gain: list[tuple[float, float]] = []
    places: list[Array] = []
    armature: list[float] = []
    for joint in description.joints:
        _check_joint(joint, description, carrier)
        T = place[joint.parent] @ joint.pose
        if joint.type is JointType.FIXED:
            carrier[joint.child] = carrier[joint.parent]
            place[joint.child] = T
            continue
        axis = np.asarray(joint.axis, dtype=np.float64)
        length = float(np.linalg.norm(axis))
        if not np.isfinite(length) or length < 1e-9:
            raise DescriptionError(f"robot {name!r}, joint {joint.name!r}: the axis {axis} is not a direction")
        turn = np.eye(4)
        turn[:3, :3] = turn_z_to(axis / length)
        parent.append(carrier[joint.parent])
        kind.append(PRISMATIC if joint.type is JointType.PRISMATIC else REVOLUTE)
        driver = joint.mimic.joint if joint.mimic else joint.name
        if driver not in coordinate:
            raise DescriptionError(
                f"robot {name!r}, joint {joint.name!r}: it mimics {driver!r}, which is not a free joint."
                f"{suggestion(driver, coordinate)}"
            )
        follows.append(coordinate[driver])
        gain.append((joint.mimic.multiplier, joint.mimic.offset) if joint.mimic else (1.0, 0.0))
        places.append(T @ turn)
        armature.append(joint.armature)
        carrier[joint.child] = len(parent) - 1
        place[joint.child] = turn.T
    for link in description.links:
        if link not in carrier:
            raise DescriptionError(f"robot {name!r}: link {link!r} hangs on no joint, and the root is another link")
    frames = frame_names(description)
    m = len(parent)
    return TreeModel(
        parent=np.array(parent, dtype=np.int64),
        kind=np.array(kind, dtype=np.int64),
        coordinate=np.array(follows, dtype=np.int64),
        gain=np.array(gain, dtype=np.float64).reshape(m, 2),
        place=np.array([_twelve(T) for T in places]).reshape(m, 12),
        frame_joint=np.array([carrier[f] for f in frames], dtype=np.int64),
        frame_place=np.array([_twelve(place[f]) for f in frames]).reshape(len(frames), 12),
        inertia=_inertias(description, carrier, place, m),
        armature=np.array(armature, dtype=np.float64),
    )


def frame_names(description: Description) -> tuple[str, ...]:
    """All links: the root, then the joints' children in tree order."""
    return (description.root, *(joint.child for joint in description.joints))


def _check_joint(joint: Joint, description: Description, carrier: dict[str, int]) -> None:
    where = f"robot {description.name!r}, joint {joint.name!r}"
    for link in (joint.parent, joint.child):
        if link not in description.links:
            raise DescriptionError(f"{where}: link {link!r} does not exist.{suggestion(link, description.links)}")
    if joint.parent not in carrier:
        raise DescriptionError(f"{where}: its parent link {joint.parent!r} must be carried by an earlier joint")
    if joint.child in carrier:
        raise DescriptionError(
            f"{where}: link {joint.child!r} is already in the tree; a second joint to it would close a loop"
        )


def _twelve(T: Array) -> Array:
    return np.concatenate([T[:3, :3].ravel(), T[:3, 3]])


def _inertias(description: Description, carrier: dict[str, int], place: dict[str, Array], m: int) -> Array:
    total = np.zeros((m + 1, 10))
    for name, link in description.links.items():
        if link.inertial is not None:
            total[carrier[name]] += ten_parameters(link.inertial, place[name])
    return total


def ten_parameters(inertial: Inertial, T: Array) -> Array:
    """Mass, mass × centre, and inertia (xx, xy, xz, yy, yz, zz) about the origin of the frame that *T* leads to.

    With centre c and the inertia I about it, I_origin = R I Rᵀ + mass (|c|² 1 − c cᵀ) (Steiner).
    """
    c = T[:3, :3] @ inertial.com + T[:3, 3]
    I = T[:3, :3] @ inertial.inertia @ T[:3, :3].T + inertial.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([inertial.mass, *(inertial.mass * c), I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]])


def chain_model(tree: TreeModel, frame: int) -> ChainModel:
    """Arrays of the chain from the root to frame number *frame*."""
    joints: list[int] = []
    i = int(tree.frame_joint[frame])
    while i >= 0:
        joints.append(i)
        i = int(tree.parent[i])
    joints.reverse()
    coordinate = tree.coordinate[joints] if joints else np.zeros(0, dtype=np.int64)
    free, column = np.unique(coordinate, return_inverse=True)
    return ChainModel(
        kind=np.ascontiguousarray(tree.kind[joints]) if joints else np.zeros(0, dtype=np.int64),
        coordinate=np.ascontiguousarray(coordinate),
        column=np.ascontiguousarray(column, dtype=np.int64),
        gain=np.ascontiguousarray(tree.gain[joints]) if joints else np.zeros((0, 2)),
        place=np.vstack([tree.place[joints], tree.frame_place[frame : frame + 1]])
        if joints
        else tree.frame_place[frame : frame + 1].copy(),
        free=np.ascontiguousarray(free, dtype=np.int64),
    )
