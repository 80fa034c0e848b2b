"""Shapes of links, bodies and boxes as geoms of the physics engine.

Contacts see primitives and the convex pieces of meshes, the same ones that the collision checks use, so that what is
planned free is free; the simulated cameras see a link's collision meshes with their own faces, and a body's mesh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..arrays import Array, IntArray
from ..collision.shapes import mesh_hulls
from ..robots import load_shape_mesh
from ..robots.description import Shape, ShapeKind
from .primitives import as_round

if TYPE_CHECKING:
    from ..bodies import Body
    from ..collision.scene import Box
    from .physics import Physics

STATIC, ROBOT, BODY = 1, 2, 4  # contact bits: what stands still, links, bodies
FIXED_GROUP, SEEN_GROUP, ROBOT_GROUP, HIDDEN_GROUP = 0, 1, 2, 3  # geom groups; cameras see all but the last
THICKNESS = 1e-4  # m given to a flat collision mesh, which has no hull with a volume
MOST_CORNERS = 2000  # of an exact hull in contact
LINK_COLOUR = (0.75, 0.76, 0.78, 1.0)


def place(element: Any, T: Array) -> None:
    """Set position and orientation of a specification's element."""
    element.pos = T[:3, 3]
    element.quat = quaternion(T[:3, :3])


def quaternion(R: Array) -> Array:
    """The unit quaternion (w, x, y, z) of a rotation (3, 3)."""
    q = np.empty(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
    return q


def add_mesh(spec: Any, name: str, vertices: Array, faces: IntArray | None = None) -> str:
    """Add a mesh asset; without *faces* its convex hull stands for it."""
    mesh = spec.add_mesh(name=name, uservert=np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    if faces is not None:
        mesh.userface = np.ascontiguousarray(faces, dtype=np.int32).ravel()
    return name


def is_flat(vertices: Array) -> bool:
    """Whether all vertices lie in one plane (or line, or point), so that there is no convex hull with a volume."""
    centred = vertices - vertices.mean(axis=0)
    extent = np.abs(centred).max(initial=0.0)
    return len(vertices) < 4 or float(np.linalg.svd(centred, compute_uv=False)[-1]) < 1e-6 * max(extent, 1e-12)


def add_shape(spec: Any, body: Any, shape: Shape, name: str) -> str | None:
    """Add one collision *shape* of a link to *body*; returns a sentence where the shape had to be changed."""
    options: dict[str, Any] = {
        "contype": ROBOT,
        "conaffinity": STATIC | ROBOT,
        "group": ROBOT_GROUP,
        "rgba": shape.rgba or LINK_COLOUR,
        "mass": 0.0,
    }
    size = shape.size
    assumption = None
    T = shape.pose
    if shape.kind is ShapeKind.MESH:
        vertices, faces = load_shape_mesh(shape)
        if is_flat(vertices):
            lower, upper = vertices.min(axis=0), vertices.max(axis=0)
            T = T.copy()
            T[:3, 3] += T[:3, :3] @ (0.5 * (lower + upper))
            half = np.maximum(0.5 * (upper - lower), 0.5 * THICKNESS)
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, **options)
            assumption = f"the collision mesh {name} is flat; a box {THICKNESS * 1e3:g} mm thick stands for it"
        else:
            for i, piece in enumerate(mesh_hulls(vertices, faces)):
                add_mesh(spec, f"{name}:{i}", piece.points)
                hull = body.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{name}:{i}", **{**options, "group": HIDDEN_GROUP}
                )
                place(hull, T @ piece.pose)
            add_mesh(spec, name, vertices, faces)
            seen = {**options, "contype": 0, "conaffinity": 0}
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **seen)
    elif shape.kind is ShapeKind.BOX:
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * np.asarray(size), **options)
    elif shape.kind is ShapeKind.SPHERE:
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[size[0], 0.0, 0.0], **options)
    else:
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER if shape.kind is ShapeKind.CYLINDER else mujoco.mjtGeom.mjGEOM_CAPSULE
        geom = body.add_geom(type=kind, size=[size[0], 0.5 * size[1], 0.0], **options)
    place(geom, T)
    return assumption


def add_box(spec: Any, box: Box, physics: Physics) -> None:
    """Add a fixed box to the world."""
    holder = spec.worldbody.add_body(name=f"box:{box.name}")
    place(holder, box.pose)
    holder.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=0.5 * box.size,
        contype=STATIC,
        conaffinity=0,
        group=FIXED_GROUP,
        rgba=box.rgba,
        friction=[box.friction, 0.0, 0.0],
        solref=physics.solref,
        solimp=physics.solimp,
    )


def add_body(spec: Any, name: str, body: Body, pose: Array, physics: Physics, *, movable: bool) -> None:
    """Add a body with its own mass properties; its convex pieces touch, its mesh is seen.

    In a contact with a link or a box the body's friction rules (the engine's *priority*); between two bodies the
    larger coefficient does. The torsional coefficient is that of the elliptic soft-finger cone (G 2.1.1).
    """
    holder = spec.worldbody.add_body(name=f"body:{name}")
    place(holder, pose)
    if movable:
        holder.add_freejoint(name=f"body:{name}")
        holder.explicitinertial = True
        holder.mass = body.mass
        holder.ipos = body.com
        holder.fullinertia = full_inertia(body.inertia)
    contact: dict[str, Any] = {
        "contype": BODY if movable else STATIC,
        "conaffinity": (STATIC | ROBOT | BODY) if movable else 0,
        "group": HIDDEN_GROUP,
        "condim": 6 if physics.rolling > 0.0 else 4,
        "friction": [body.friction, body.torsional_friction, physics.rolling],
        "priority": 1,
        "solref": physics.solref,
        "solimp": physics.solimp,
        "mass": 0.0,
    }
    for i, (vertices, faces) in enumerate(_pieces(body)):
        shape = as_round(vertices, _volume(vertices, faces))
        if shape is None:
            mesh = add_mesh(spec, f"body:{name}:{i}", vertices)
            holder.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, **contact)
            continue
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER if shape.height else mujoco.mjtGeom.mjGEOM_SPHERE
        place(holder.add_geom(type=kind, size=[shape.radius, 0.5 * shape.height, 0.0], **contact), shape.pose)
    mesh = add_mesh(spec, f"body:{name}", body.vertices, body.faces)
    holder.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, contype=0, conaffinity=0, group=SEEN_GROUP, mass=0.0
    )


def _pieces(body: Body) -> list[tuple[Array, IntArray]]:
    """Convex pieces that touch: the body's, or the exact hull where one piece stands for the whole."""
    pieces = list(body.convex_pieces)
    if len(pieces) > 1:
        return pieces
    from scipy.spatial import ConvexHull

    hull = ConvexHull(body.vertices)
    if len(hull.vertices) > MOST_CORNERS:
        return pieces
    corners = body.vertices[hull.vertices]
    number = np.full(len(body.vertices), -1, dtype=np.int64)
    number[hull.vertices] = np.arange(len(hull.vertices))
    faces = number[hull.simplices]
    # Qhull does not orient its triangles; turn each so that its normal points out
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return [(corners, faces)]


def _volume(vertices: Array, faces: IntArray) -> float:
    """Volume that closed *faces* enclose, in m³."""
    a, b, c = (vertices[faces[:, k]] - vertices[0] for k in range(3))
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0


def full_inertia(inertia: Array) -> list[float]:
    """The engine's order (xx, yy, zz, xy, xz, yz) of a symmetric (3, 3) inertia."""
    return [float(inertia[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
