"""From the running physics to contact mechanics: what holds a body, as a grasp."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..arrays import Array
from ..errors import InputError, unknown_name
from ..grasp import Contact, ContactModel, Grasp

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True, eq=False)
class Held:
    """The contacts of one body at one instant.

    *grasp*: in the frame of the body, wrenches about its centre of mass. *touching*: for each contact the name of what
    touches, for `hand_jacobian`. *forces* ``(m,)``: what the contacts transmit, in the grasp's components; *depth*
    ``(k,)``: how deep they penetrate, in m. *pose* T_world_body ``(4, 4)``.
    """

    grasp: Grasp
    touching: tuple[str, ...]
    forces: Array
    depth: Array
    pose: Array

    @property
    def wrench(self) -> Array:
        """The wrench ``(6,)`` that the contacts exert on the body, about its centre of mass, in its axes."""
        return self.grasp.object_wrench(self.forces)


def held(model: Any, data: Any, body: str, by: Iterable[str] | None = None) -> Held:
    """The grasp of *body* in an engine's ``MjModel`` and ``MjData``, as the last solved step has it.

    *by*: names of the bodies whose contacts count (default: all that touch). Contacts without friction, with sliding
    and with torsional friction (``condim`` 1, 3, 4; rolling friction of 6 is left out) become frictionless, Coulomb
    and soft fingers with the elliptic cone; of two sliding coefficients the smaller counts. Raises `UnknownNameError`
    for names that the model lacks, and `InputError` if nothing touches.
    """
    names = [model.body(i).name or "world" for i in range(model.nbody)]
    return _held(model, data, names, _index(names, body), body, None if by is None else {_index(names, b) for b in by})


def held_in(world: World, body: str, by: str | Iterable[str] | None = None) -> Held:
    """As `held`, in a `World` at the present instant: *body* and *by* (links of the robot, other bodies, boxes) as the
    scene names them."""
    chosen = world.engine_bodies(by)
    wanted = None if chosen is None else set(chosen)
    index = world.plant.bodies.get(body)
    if index is None:
        unknown_name("movable body", body, world.plant.bodies, "the scene")
    now = copy.copy(world.data)  # the world stands between two steps; its copy may be solved
    mujoco.mj_forward(world.model, now)
    return _held(world.model, now, list(world.plant.owners), index, body, wanted)


def simulated(path: str | Path, body: str, time: float = 0.0, by: Iterable[str] | None = None) -> Held:
    """Load an MJCF file, start at its first keyframe if it has one, run *time* seconds, and read `held`."""
    file = Path(path)
    if not (np.isfinite(time) and time >= 0.0):
        raise InputError(f"time is {time} s; expected 0 or more")
    if not file.is_file():
        raise InputError(f"{file} cannot be read: there is no such file")
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise InputError(f"{file} is not a model that the engine takes: {error}") from error
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    for _ in range(round(time / model.opt.timestep)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    if not np.isfinite(data.qpos).all():
        raise InputError(f"{file}: the simulation diverged within {time} s; use a smaller timestep")
    return held(model, data, body, by)


def _index(names: list[str], name: str) -> int:
    if name not in names:
        unknown_name("body", name, [n for n in names if n != "world"], "the model")
    return names.index(name)


def _held(model: Any, data: Any, names: list[str], index: int, body: str, by: set[int] | None) -> Held:
    R, origin = data.xmat[index].reshape(3, 3), data.xpos[index]
    contacts: list[Contact] = []
    touching, forces, depth = [], [], []
    local = np.empty(6)
    for i in range(data.ncon):
        row = data.contact[i]
        pair = [int(model.geom_bodyid[g]) for g in row.geom]
        if index not in pair or pair[0] == pair[1] or row.efc_address < 0:
            continue
        second = pair[1] == index
        other = pair[0] if second else pair[1]
        if by is not None and other not in by:
            continue
        sign = 1.0 if second else -1.0  # the engine's normal points into the second
        normal, tangent = sign * row.frame[:3] @ R, row.frame[3:6] @ R
        size = min(int(row.dim), 4)
        kind = {1: ContactModel.FRICTIONLESS, 3: ContactModel.COULOMB, 4: ContactModel.SOFT}[size]
        mu = float(min(row.friction[:2])) if size > 1 else 0.0
        gamma = float(row.friction[2]) if size == 4 else 0.0
        normal /= np.linalg.norm(normal)
        tangent = tangent - (tangent @ normal) * normal
        contacts.append(
            Contact((row.pos - origin) @ R, normal, mu, kind, gamma, tangent / np.linalg.norm(tangent))
        )  # fmt: skip
        mujoco.mj_contactForce(model, data, i, local)
        # on the first body every force turns round: along t₁ the sign stays, t₂ = n × t₁ turns with the normal
        parts = [sign * local[1], local[2], local[0], local[3]]
        forces += parts[2:3] if size == 1 else parts[:size]
        touching.append(names[other])
        depth.append(-float(row.dist))
    if not contacts:
        who = "nothing" if by is None else "none of " + ", ".join(repr(names[b]) for b in sorted(by))
        raise InputError(f"{who} touches {body!r} at {data.time:.3f} s; step the simulation until something does")
    radius = max(
        float(np.linalg.norm(model.geom_pos[g] - model.body_ipos[index]) + model.geom_rbound[g])
        for g in np.flatnonzero(model.geom_bodyid == index)
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, origin
    grasp = Grasp(contacts, reference=model.body_ipos[index].copy(), length=radius or 1.0)
    return Held(grasp, tuple(touching), np.array(forces), np.array(depth), pose)
