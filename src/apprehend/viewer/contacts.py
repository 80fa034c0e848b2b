"""A page with the contacts of a grasp, their friction cones and forces, and its wrench space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, as_array
from ..errors import InputError
from .live import Page, Serving, serve
from .looks import RGBA
from .marks import Mesh, arrow, ball, friction_cone
from .picture import Camera, corners_of
from .replay import switch
from .stage import BODY_COLOURS, Stage, Thing

if TYPE_CHECKING:
    from ..grasp import Grasp

CONE: RGBA = (0.16, 0.45, 0.80, 0.35)
FORCE: RGBA = (0.80, 0.20, 0.16, 1.0)
SPACES: dict[str, RGBA] = {"force": (0.16, 0.60, 0.35, 0.30), "torque": (0.60, 0.35, 0.70, 0.30)}
BALL: RGBA = (0.85, 0.35, 0.20, 0.60)


def show_contacts(
    grasp: Grasp,
    forces: ArrayLike | None = None,
    **serving: Unpack[Serving],
) -> Page:
    """A page with the contacts of *grasp* in space, its body if it has one, and contact *forces* ``(m,)`` as arrows.

    Beside it stand the projections of the L1 wrench space onto forces and onto torques (over the grasp's length), one
    unit drawn as that length, each with its largest ball.
    """
    if grasp.dimension != 3:
        raise InputError("pages show grasps in space; save_picture draws those of the plane")
    f = None if forces is None else as_array(forces, "forces")
    if f is not None and f.shape != (grasp.matrix.shape[1],):
        raise InputError(f"forces has shape {f.shape}; expected ({grasp.matrix.shape[1]},)")
    title = "contacts of a grasp" if grasp.body is None else f"contacts on {grasp.body.name}"
    return serve(title, lambda page: _draw(page, grasp, f), **serving)


def wrench_space(grasp: Grasp, part: str, at: Array) -> tuple[Mesh, Mesh]:
    """The hull of the wrench space projected onto ``"force"`` or ``"torque"``, and its largest ball, as meshes in m."""
    from scipy.spatial import ConvexHull

    rows = slice(0, 3) if part == "force" else slice(3, 6)
    points = np.concatenate([grasp.edges(24)[:, rows], np.zeros((1, 3))])
    hull = ConvexHull(points, qhull_options="QJ")
    faces = hull.simplices.astype(np.int64)
    turned = np.einsum("fi,fi->f", np.cross(*(points[faces[:, i]] - points[faces[:, 0]] for i in (1, 2))),
                       hull.equations[:, :3]) < 0.0  # fmt: skip
    faces[turned] = faces[turned][:, ::-1]
    radius = grasp.quality(subspace=part).value * grasp.length
    return (points * grasp.length + at, faces), ball(at, max(radius, 1e-3 * grasp.length))


def _draw(page: Page, grasp: Grasp, forces: Array | None) -> None:
    points = np.array([c.position for c in grasp.contacts])
    size = 0.4 * grasp.length
    if grasp.body is not None:
        body = grasp.body
        page.add(Stage(bodies=(Thing(body.name, body.vertices, body.faces, np.eye(4), BODY_COLOURS[0]),)))
    low, high = np.min([*points, grasp.reference], axis=0) - size, np.max([*points, grasp.reference], axis=0) + size
    spots = {
        part: grasp.reference + [0.0, s * 3.0 * grasp.length, 0.0] for part, s in (("force", 1.0), ("torque", -1.0))
    }
    page.look(Camera.around(corners_of(low - [0.0, 2.5 * grasp.length, 0.0], high + [0.0, 2.5 * grasp.length, 0.0])))
    cones = [
        page.mesh(
            f"/contacts/cone{i}", *friction_cone(c.position, c.normal, c.friction if c.size > 1 else 0.0, size), CONE
        )
        for i, c in enumerate(grasp.contacts)
    ]
    gui = page.server.gui
    closure, epsilon = grasp.force_closure(), grasp.quality()
    bounds = f"{epsilon.lower:.4g} … {epsilon.upper:.4g}"
    gui.add_markdown(f"**{len(grasp)} contacts**: {closure.explain()}\n\nε (L1, exact cones): {bounds}")
    with gui.add_folder("Show"):
        switch(gui, "friction cones", cones, shown=True)
        if forces is not None:
            pushes = [c.directions[:3] @ forces[s] for c, s in zip(grasp.contacts, grasp.slices, strict=True)]
            largest = max(float(np.linalg.norm(p)) for p in pushes)
            arrows = [
                page.mesh(
                    f"/contacts/force{i}",
                    *arrow(p - 1.5 * size * f / largest, 1.5 * size * f / largest, 0.03 * size),
                    FORCE,
                )
                for i, (p, f) in enumerate(zip(points, pushes, strict=True))
                if np.linalg.norm(f) > 0.02 * largest
            ]
            switch(gui, f"contact forces, up to {largest:.3g} N", arrows, shown=True)
        for part, colour in SPACES.items():
            hull, inner = wrench_space(grasp, part, spots[part])
            marks = [page.mesh(f"/wrenches/{part}", *hull, colour), page.mesh(f"/wrenches/{part}_ball", *inner, BALL)]
            switch(gui, f"{part}s of the wrench space", marks, shown=True)
