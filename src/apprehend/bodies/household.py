"""Household objects made by the package itself, so that nothing has to be fetched.

Each is a closed surface in metres that stands or lies on the plane z = 0, with a plausible mass and friction. They are
built from surfaces of revolution, sweeps and boxes, united exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import unknown_name
from .body import Body
from .repair import union
from .shapes import Mesh, box, circle, revolve, sphere, sweep

X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class _Recipe:
    build: Callable[[], Mesh]
    mass: float  # kg
    friction: float
    about: str


def household(name: str) -> Body:
    """The object *name* of `HOUSEHOLD`."""
    recipe = _RECIPES.get(name) or unknown_name("household object", name, _RECIPES)
    vertices, faces = _mesh(name)
    return Body.from_mesh(vertices, faces, mass=recipe.mass, friction=recipe.friction, name=name)


@cache
def _mesh(name: str) -> Mesh:
    vertices, faces = _RECIPES[name].build()
    return vertices - [0.0, 0.0, vertices[:, 2].min()], faces


def _joined(*parts: Mesh) -> Mesh:
    whole = union(list(parts))
    assert whole is not None, "the parts are closed by construction"
    return whole


def _moved(mesh: Mesh, *shift: float) -> Mesh:
    return mesh[0] + np.asarray(shift), mesh[1]


def _along_x(mesh: Mesh) -> Mesh:
    """The same solid with its z axis laid along x."""
    return mesh[0][:, [2, 0, 1]], mesh[1]


def _arc(centre: tuple[float, float], radius: float, start: float, stop: float, n: int) -> list[tuple[float, float]]:
    angle = np.radians(np.linspace(start, stop, n))
    return list(zip(centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)))


def _smooth(knots: list[tuple[float, float]], n: int) -> list[tuple[float, float]]:
    """*n* points of a shape-preserving curve through the (radius, z) *knots*, which rise in z."""
    from scipy.interpolate import PchipInterpolator

    r, z = np.array(knots).T
    heights = np.linspace(z[0], z[-1], n)
    return list(zip(PchipInterpolator(z, r)(heights), heights))


def _cup(radius: float, height: float, wall: float, floor: float) -> list[tuple[float, float]]:
    """Profile of an open cylinder with rounded foot and rim."""
    foot = _arc((radius - 0.006, 0.006), 0.006, -90.0, 0.0, 5)
    rim = _arc((radius - wall / 2, height - wall / 2), wall / 2, 0.0, 180.0, 7)
    inside = _arc((radius - wall - 0.005, floor + 0.005), 0.005, 0.0, -90.0, 5)
    return [(0.0, 0.0), *foot, *rim, *inside, (0.0, floor)]


def _mug() -> Mesh:
    radius, height = 0.040, 0.096
    angle = np.linspace(-1.25, 1.25, 20)
    curve = np.stack([radius - 0.006 + 0.034 * np.cos(angle), 0 * angle, 0.050 + 0.031 * np.sin(angle)], axis=1)
    curve[:, 0] -= 0.034 * np.cos(1.25) - 0.004
    handle = sweep(curve, circle(1.0, 16), np.column_stack([np.full(20, 0.0042), np.full(20, 0.0065)]), X)
    # the handle's ends stay inside the wall
    return _joined(revolve(_cup(radius, height, 0.0045, 0.006)), handle)


def _bowl() -> Mesh:
    outer = _arc((0.0, 0.082), 0.080, -66.0, -8.0, 18)
    inner = _arc((0.0, 0.082), 0.0765, -8.0, -89.0, 20)
    return revolve([(0.0, 0.0), (0.031, 0.0), *outer, *inner[:-1], (0.0, inner[-1][1])])


def _plate() -> Mesh:
    top = [(0.105, 0.0215), (0.104, 0.0205), (0.072, 0.0085), (0.062, 0.0065)]
    return revolve([(0.0, 0.0), (0.060, 0.0), (0.074, 0.0045), (0.1045, 0.0165), (0.106, 0.019), *top, (0.0, 0.006)])


def _bottle() -> Mesh:
    body = _smooth(
        [
            (0.0335, 0.012),
            (0.034, 0.05),
            (0.0325, 0.085),
            (0.034, 0.12),
            (0.033, 0.145),
            (0.026, 0.172),
            (0.0145, 0.193),
            (0.0135, 0.203),
        ],
        28,
    )
    foot = _arc((0.0285, 0.007), 0.005, -90.0, 0.0, 5)
    cap = [(0.0135, 0.203), (0.0155, 0.2035), (0.0155, 0.2185), (0.0145, 0.2195)]
    return revolve([(0.0, 0.002), *foot, *body[:-1], *cap, (0.0, 0.2195)])


def _wine_glass() -> Mesh:
    foot = [
        (0.0, 0.0),
        (0.0335, 0.0),
        (0.034, 0.0015),
        (0.020, 0.004),
        (0.0075, 0.0085),
        (0.0045, 0.016),
        (0.004, 0.050),
        (0.0045, 0.078),
    ]
    outer = _smooth(
        [(0.0045, 0.079), (0.020, 0.090), (0.0345, 0.112), (0.0375, 0.132), (0.0345, 0.158), (0.0305, 0.180)], 18
    )
    inner = [
        (r - 0.0018, z)
        for r, z in reversed(
            _smooth(
                [(0.004, 0.083), (0.0202, 0.0928), (0.0345, 0.113), (0.0375, 0.132), (0.0345, 0.158), (0.0305, 0.180)],
                18,
            )
        )
    ]
    return revolve([*foot, *outer[1:], (0.0296, 0.181), *inner[:-1], (0.0, 0.0815)])


def _can() -> Mesh:
    bottom = [(0.0, 0.0015), (0.028, 0.0015), (0.029, 0.0), (0.031, 0.0), (0.033, 0.003)]
    top = [(0.033, 0.110), (0.0305, 0.1145), (0.029, 0.115), (0.028, 0.1135), (0.0, 0.1135)]
    return revolve([*bottom, *top])


def _carton() -> Mesh:
    return _moved(box([0.062, 0.155, 0.210]), 0.0, 0.0, 0.105)


def _spray_bottle() -> Mesh:
    tank = _smooth([(0.036, 0.004), (0.037, 0.03), (0.036, 0.10), (0.030, 0.135), (0.019, 0.160), (0.0145, 0.175)], 22)
    body = revolve([(0.0, 0.0), (0.034, 0.0), *tank, (0.0145, 0.19), (0.0, 0.19)])
    head = _moved(box([0.078, 0.026, 0.030]), 0.012, 0.0, 0.203)
    nozzle = _moved(_along_x(revolve([(0.0, 0.0), (0.008, 0.0), (0.008, 0.018), (0.0, 0.018)], 24)), 0.046, 0.0, 0.206)
    t = np.linspace(0.0, 1.0, 12)
    curve = np.stack([0.031 + 0.012 * np.sin(1.7 * t), 0 * t, 0.196 - 0.048 * t], axis=1)
    trigger = sweep(curve, circle(1.0, 16), np.column_stack([np.full(12, 0.0045), np.full(12, 0.007)]), X)
    return _joined(body, head, nozzle, trigger)


def _screwdriver() -> Mesh:
    grip = [
        (0.0, 0.0),
        (0.010, 0.001),
        (0.0145, 0.006),
        (0.0155, 0.020),
        (0.0150, 0.070),
        (0.0115, 0.082),
        (0.0125, 0.092),
        (0.0085, 0.102),
    ]
    handle = revolve([*grip, (0.0, 0.103)], 32)
    shaft = revolve([(0.0, 0.09), (0.0032, 0.09), (0.0032, 0.195), (0.0026, 0.198), (0.0, 0.207)], 20)
    ribs = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False):
        rib = revolve([(0.0, 0.014), (0.0028, 0.020), (0.0028, 0.064), (0.0, 0.070)], 10)
        ribs.append(_moved(rib, 0.0148 * np.cos(angle), 0.0148 * np.sin(angle), 0.0))
    return _along_x(_joined(handle, shaft, *ribs))


def _hammer() -> Mesh:
    t = np.linspace(0.0, 0.27, 16)
    width = np.interp(t, [0.0, 0.02, 0.10, 0.17, 0.27], [0.013, 0.017, 0.0155, 0.0115, 0.012])
    handle = sweep(np.stack([t, 0 * t, 0 * t], axis=1), circle(1.0, 20), np.column_stack([width, 0.72 * width]), Y)
    poll = [
        (0.0, -0.052),
        (0.0125, -0.052),
        (0.0135, -0.050),
        (0.0135, -0.036),
        (0.0105, -0.030),
        (0.0105, 0.012),
        (0.0, 0.012),
    ]
    head = revolve(poll, 28)
    head = (head[0][:, [0, 2, 1]] * [1.0, 1.0, -1.0], head[1])  # along y
    s = np.linspace(0.0, 1.0, 12)
    spine = np.stack([-0.022 * s**2, 0.002 + 0.062 * s, 0 * s], axis=1)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    claw = sweep(spine, square, np.column_stack([0.0095 * (1 - 0.82 * s), 0.0100 * (1 - 0.15 * s)]), X)
    return _joined(handle, _moved(head, 0.262, 0.0, 0.0), _moved(claw, 0.262, 0.0, 0.0))


def _banana() -> Mesh:
    angle = np.radians(np.linspace(-52.0, 52.0, 30))
    curve = 0.105 * np.stack([np.sin(angle), -np.cos(angle), 0 * angle], axis=1)
    s = np.linspace(0.0, 1.0, 30)
    size = np.interp(
        s,
        [0.0, 0.03, 0.12, 0.3, 0.55, 0.8, 0.9, 0.96, 1.0],
        [0.004, 0.0065, 0.0125, 0.0168, 0.0178, 0.0145, 0.0085, 0.0052, 0.0055],
    )
    corner = np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False)
    section = (1.0 + 0.04 * np.cos(5 * corner))[:, None] * np.stack([np.cos(corner), np.sin(corner)], axis=1)
    return sweep(curve, section, size, Z)


def _apple() -> Mesh:
    polar = np.linspace(0.0, np.pi, 30)
    r = 0.0375 * (
        1.0
        + 0.08 * np.cos(polar)
        - 0.30 * np.exp(-((polar / 0.38) ** 2))
        - 0.16 * np.exp(-(((np.pi - polar) / 0.35) ** 2))
    )
    profile = np.stack([r * np.sin(polar), r * np.cos(polar)], axis=1)[::-1]
    profile[0, 0] = profile[-1, 0] = 0.0
    stem = _moved(revolve([(0.0, 0.0), (0.0014, 0.0), (0.0018, 0.020), (0.0, 0.020)], 12), 0.0, 0.0, 0.024)
    return _joined(revolve(profile), stem)


def _marker() -> Mesh:
    pen = [
        (0.0, 0.0),
        (0.0075, 0.0),
        (0.0085, 0.002),
        (0.0085, 0.088),
        (0.0092, 0.089),
        (0.0092, 0.136),
        (0.008, 0.140),
        (0.0, 0.140),
    ]
    return _along_x(revolve(pen, 32))


def _spoon() -> Mesh:
    t = np.linspace(0.0, 1.0, 24)
    curve = np.stack([0.20 * t - 0.10, 0 * t, 0.010 * np.sin(np.pi * t) + 0.012 * t**3], axis=1)
    knots = [0.0, 0.05, 0.17, 0.28, 0.36, 0.7, 1.0]
    broad = np.interp(t, knots, [0.006, 0.014, 0.0205, 0.014, 0.0045, 0.0045, 0.009])
    thick = np.interp(t, knots, [0.0012, 0.0016, 0.0018, 0.0018, 0.0022, 0.0016, 0.0013])
    section = circle(1.0, 20)
    mesh = sweep(curve, section, np.column_stack([broad, thick]), Y)
    vertices = mesh[0].copy()
    near = np.clip(1.0 - ((vertices[:, 0] + 0.066) / 0.030) ** 2, 0.0, None)
    vertices[:, 2] -= 0.007 * near * np.clip(1.0 - (vertices[:, 1] / 0.021) ** 2, 0.0, None)  # the hollow of the bowl
    return vertices, mesh[1]


def _ball() -> Mesh:
    return sphere(0.033)


def _cube() -> Mesh:
    return box([0.05, 0.05, 0.05])


_RECIPES: dict[str, _Recipe] = {
    "apple": _Recipe(_apple, 0.17, 0.55, "an apple with its stem"),
    "ball": _Recipe(_ball, 0.058, 0.8, "a ball of the size of a tennis ball"),
    "banana": _Recipe(_banana, 0.12, 0.55, "a banana, lying"),
    "bottle": _Recipe(_bottle, 0.52, 0.5, "a filled half-litre bottle"),
    "bowl": _Recipe(_bowl, 0.28, 0.5, "a cereal bowl"),
    "box": _Recipe(_carton, 0.40, 0.5, "a carton, 62 × 155 × 210 mm"),
    "can": _Recipe(_can, 0.35, 0.45, "a drinks can, filled"),
    "cube": _Recipe(_cube, 0.09, 0.6, "a wooden cube, 50 mm"),
    "hammer": _Recipe(_hammer, 0.62, 0.6, "a claw hammer, lying"),
    "marker": _Recipe(_marker, 0.02, 0.5, "a felt pen, lying"),
    "mug": _Recipe(_mug, 0.33, 0.55, "a mug with a handle"),
    "plate": _Recipe(_plate, 0.40, 0.5, "a dessert plate"),
    "screwdriver": _Recipe(_screwdriver, 0.10, 0.6, "a screwdriver with a ribbed grip, lying"),
    "spoon": _Recipe(_spoon, 0.04, 0.4, "a spoon, lying"),
    "spray_bottle": _Recipe(_spray_bottle, 0.45, 0.5, "a spray bottle with trigger"),
    "wine_glass": _Recipe(_wine_glass, 0.16, 0.45, "a wine glass"),
}

HOUSEHOLD: dict[str, str] = {name: recipe.about for name, recipe in _RECIPES.items()}
"""The generated objects: name, and what it is."""
