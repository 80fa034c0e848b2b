"""The scene and the recording as plain data for ``episode.json``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from ..collision import Scene
from .context import Context


def scene_data(scene: Scene) -> tuple[dict[str, Any], dict[str, tuple[np.ndarray, np.ndarray]]]:
    """What stands where, with one mesh file for each body; and the meshes by file name."""
    source = scene.robot_source
    meshes = {f"meshes/{name}.obj": (placed.body.vertices, placed.body.faces) for name, placed in scene.bodies.items()}
    data = {
        "robot": {
            "arm": source.arm, "hand": source.hand, "at": source.at, "mount": source.mount, "base": source.base,
            "prefix": source.prefix,
        },
        "bodies": [
            {"name": name, "mesh": f"meshes/{name}.obj", "pose": placed.pose} for name, placed in scene.bodies.items()
        ],
        "boxes": [{"name": b.name, "size": b.size, "pose": b.pose, "rgba": b.rgba} for b in scene.boxes],
        "goal": {"body": scene.pick, "pose": scene.goals[scene.pick]} if scene.pick else None,
    }  # fmt: skip
    return data, meshes


def recording_data(context: Context, marks: Sequence[float]) -> dict[str, Any]:
    """The recorded motion; *marks* are the times at which the steps ended."""
    recording, robot = context.world.recording(), context.robot
    limits = robot.limits
    force = recording.robot_force[context.name]
    return {
        "joint_names": robot.joint_names,
        "arm": context.joints,
        "limits": {name: getattr(limits, name) for name in ("lower", "upper", "velocity", "acceleration", "effort")},
        "t": recording.time,
        "q": recording.q.round(5),
        "qd": recording.qd.round(4),
        "tau": recording.tau.round(3),
        "bodies": {name: pose_rows(poses) for name, poses in recording.poses.items()},
        "contact_force": np.linalg.norm(force[:, :3], axis=1).round(3),
        "step_index": np.searchsorted(np.asarray(marks), recording.time, side="left"),
    }


def pose_rows(poses: Array) -> Array:
    """Poses (k, 4, 4) as rows (x, y, z, qw, qx, qy, qz)."""
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
    return np.concatenate([poses[:, :3, 3], quaternion], axis=1).round(6)
