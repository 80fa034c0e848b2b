"""Distance of every pair of kinds of geometry, at random poses, against closed forms, coal and a certificate.

One line for every pair of kinds. *reference*: largest difference from a closed form, or from the least distance over
the parts of clouds and unions, or from coal, where the shapes are apart. *certificate*: how far the plane across the
answered normal leaves the distance open, apart and overlapping: no other library is needed to believe it. *depth −
coal*: how much deeper than coal's depth the answer ever is (coal's is that of some separating translation where it is
right). Fields are sampled from a ball, and compared with the ball itself within the reach of the grid.
"""

from __future__ import annotations

import time

import numpy as np

from apprehend.collision import Cloud, Convex, Grid, HalfSpace, Separation, Union, signed_distance
from apprehend.kernels.gjk import BOX, CONE, CYLINDER, ELLIPSOID

COUNT = 10_000
ROUNDS = 10  # pairs of shapes of each pair of kinds
BALL, SPACING = 0.3, 0.02


def poses(rng: np.random.Generator, count: int, spread: float = 0.5) -> np.ndarray:
    q = rng.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = np.stack(
        [
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ],
        axis=-1,
    ).reshape(-1, 3, 3)
    T[:, :3, 3] = rng.normal(size=(count, 3)) * spread
    return T


def field() -> Grid:
    axes = [(np.arange(n) - 0.5 * (n - 1)) * SPACING for n in (60, 62, 64)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return Grid.of(np.linalg.norm(nodes, axis=-1) - BALL, SPACING, [axis[0] for axis in axes])


MAKE = {
    "sphere": lambda rng: Convex.sphere(rng.uniform(0.05, 0.5)),
    "capsule": lambda rng: Convex.capsule(rng.uniform(0.05, 0.3), rng.uniform(0.1, 1.0)),
    "box": lambda rng: Convex.box(rng.uniform(0.1, 1.0, 3)),
    "cylinder": lambda rng: Convex.cylinder(rng.uniform(0.05, 0.5), rng.uniform(0.1, 1.0)),
    "hull": lambda rng: Convex.hull(rng.normal(size=(40, 3)) * rng.uniform(0.1, 0.5, 3)),
    "half-space": lambda rng: HalfSpace.through(rng.normal(size=3) * 0.3, rng.normal(size=3)),
    "mesh pieces": lambda rng: Union.of(
        [Convex.hull(rng.normal(size=(12, 3)) * 0.1).at(T) for T in poses(rng, 12, 0.3)]
    ),
    "mesh surface": lambda rng: Union.surface(rng.normal(size=(60, 3)) * 0.2, rng.integers(60, size=(80, 3))),
    "cloud": lambda rng: Cloud.of(rng.normal(size=(400, 3)) * 0.2, 0.01),
    "field": lambda rng: field(),
}
CONVEX = ("sphere", "capsule", "box", "cylinder", "hull")


def support(shape: Convex, d: np.ndarray) -> np.ndarray:
    """How far a shape reaches along directions ``(N, 3)`` in its own frame."""
    d = d @ shape.pose[:3, :3]
    across = np.hypot(d[:, 0], d[:, 1])
    if shape.kind == BOX:
        far = np.abs(d) @ shape.size
    elif shape.kind == CYLINDER:
        far = across * shape.size[0] + np.abs(d[:, 2]) * shape.size[1]
    elif shape.kind == CONE:
        far = np.maximum(d[:, 2] * shape.size[1], across * shape.size[0] - d[:, 2] * shape.size[1])
    elif shape.kind == ELLIPSOID:
        far = np.linalg.norm(d * shape.size, axis=1)
    else:
        far = (d @ shape.points.T).max(axis=1)
    return far + shape.radius + d @ (shape.pose[:3, :3].T @ shape.pose[:3, 3])


def plane_gap(a: Convex, b: Convex, TA: np.ndarray, TB: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Signed distance between the two planes across *n* that just hold the shapes."""
    low = -support(a, -np.einsum("nij,ni->nj", TA[:, :3, :3], n)) + np.einsum("ni,ni->n", n, TA[:, :3, 3])
    high = support(b, np.einsum("nij,ni->nj", TB[:, :3, :3], n)) + np.einsum("ni,ni->n", n, TB[:, :3, 3])
    return low - high


def closed_form(a: Convex, b: object, TA: np.ndarray, TB: np.ndarray) -> np.ndarray | None:
    """Signed distance where there is a formula (a sphere or a half-space among the two), else None."""
    if isinstance(b, HalfSpace):
        P = TB @ b.pose
        n = P[:, :3, 2]
        local = -np.einsum("nij,ni->nj", TA[:, :3, :3], n)
        return np.einsum("ni,ni->n", n, TA[:, :3, 3] - P[:, :3, 3]) - support(a, local)
    if not (isinstance(b, Convex) and len(a.points) == 1):
        return None
    p = np.einsum("nij,ni->nj", TB[:, :3, :3], TA[:, :3, 3] - TB[:, :3, 3])  # the centre, in the other's frame
    grown = a.radius + b.radius
    if b.kind == BOX:
        q = np.abs(p) - b.size
    elif b.kind == CYLINDER:
        q = np.stack([np.hypot(p[:, 0], p[:, 1]) - b.size[0], np.abs(p[:, 2]) - b.size[1]], axis=1)
    elif len(b.points) <= 2:
        reach = np.abs(b.points[:, 2]).max()
        t = np.clip(p[:, 2], -reach, reach)
        return np.linalg.norm(p - t[:, None] * [0.0, 0.0, 1.0], axis=1) - grown
    else:
        return None
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0) - grown


def coal_of(shape: object):  # type: ignore[no-untyped-def]
    import coal

    if isinstance(shape, HalfSpace):
        return coal.Halfspace(shape.normal, shape.offset), np.eye(4)
    assert isinstance(shape, Convex)
    if shape.kind == BOX:
        return coal.Box(2.0 * shape.size), shape.pose
    if shape.kind == CYLINDER:
        return coal.Cylinder(shape.size[0], 2.0 * shape.size[1]), shape.pose
    if len(shape.points) == 1:
        return coal.Sphere(shape.radius), shape.pose
    if len(shape.points) == 2:
        return coal.Capsule(shape.radius, 2.0 * np.abs(shape.points[:, 2]).max()), shape.pose
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for p in shape.points:
        points.append(p)
    for f in shape.faces:
        faces.append(coal.Triangle(*map(int, f)))
    return coal.Convex(points, faces), shape.pose


def coal_distances(a: object, b: object, TA: np.ndarray, TB: np.ndarray) -> np.ndarray:
    import coal

    (shape_a, own_a), (shape_b, own_b) = coal_of(a), coal_of(b)
    request, result = coal.DistanceRequest(True, True), coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    out = np.zeros(len(TA))
    for i, (A, B) in enumerate(zip(TA @ own_a, TB @ own_b, strict=True)):
        result.clear()
        out[i] = coal.distance(
            shape_a, coal.Transform3s(A[:3, :3], A[:3, 3]), shape_b, coal.Transform3s(B[:3, :3], B[:3, 3]),
            request, result,
        )  # fmt: skip
    return out


def parts(shape: object) -> list[object]:
    """What a cloud or a union is made of, each as a shape of its own; a field is a ball."""
    if isinstance(shape, Union):
        return [part.at(shape.pose) for part in shape.shapes]
    if isinstance(shape, Cloud):
        places = np.tile(np.eye(4), (len(shape.points), 1, 1))
        places[:, :3, 3] = shape.points
        return [Convex.sphere(shape.radius).at(T) for T in places]
    return [Convex.sphere(BALL)] if isinstance(shape, Grid) else [shape]


def by_parts(a: object, b: object, TA: np.ndarray, TB: np.ndarray) -> np.ndarray:
    """The least distance over all pairs of parts."""
    least = np.full(len(TA), np.inf)
    for part_a in parts(a):
        for part_b in parts(b):
            least = np.minimum(least, signed_distance(part_a, part_b, TA, TB).distance)
    return least


def in_reach(a: object, b: object, TA: np.ndarray, TB: np.ndarray, found: Separation) -> np.ndarray:
    """Whether the nearest point of the first shape's core lies within the grid of the second, a field."""
    assert isinstance(b, Grid)
    core = found.points[:, 0] + getattr(a, "radius", 0.0) * found.normal
    local = np.einsum("nij,ni->nj", TB[:, :3, :3], core - TB[:, :3, 3]) - b.pose[:3, 3]
    return np.asarray((np.abs(local) <= b.half).all(axis=1))


def row(kind_a: str, kind_b: str, rng: np.random.Generator, count: int) -> str:
    """One line of the table."""
    convex = kind_a in CONVEX and kind_b in CONVEX
    simple = kind_a in CONVEX and kind_b in (*CONVEX, "half-space")
    heavy = not simple
    rounds, each = (ROUNDS, count // ROUNDS) if simple else (2, max(5, count // 500))
    reference, apart, overlap, deeper, wrong, total, used = 0.0, 0.0, 0.0, -np.inf, 0, 0, 0.0
    for _ in range(rounds):
        a, b = MAKE[kind_a](rng), MAKE[kind_b](rng)
        TA, TB = poses(rng, each), poses(rng, each)
        signed_distance(a, b, TA[:1], TB[:1])
        begin = time.perf_counter()
        found = signed_distance(a, b, TA, TB)
        used += time.perf_counter() - begin
        total += each
        d = found.distance
        wrong += int(np.isnan(d).sum() + np.isnan(found.points).sum() + np.isnan(found.normal).sum())
        if heavy:
            if "half-space" in (kind_a, kind_b) and kind_a == kind_b:
                continue
            expected = by_parts(a, b, TA, TB)
            near = np.ones(each, bool)
            if "field" in (kind_a, kind_b):
                near = (expected > -0.02) & (expected < 0.05) & in_reach(a, b, TA, TB, found)
            reference = max(reference, float(np.abs(d - expected)[near].max(initial=0.0)))
            continue
        out = d > 0.0
        exact = closed_form(a, b, TA, TB)
        theirs = coal_distances(a, b, TA, TB)
        against = theirs if exact is None else exact
        reference = max(reference, float(np.abs(d - against)[out | (exact is not None)].max(initial=0.0)))
        deeper = max(deeper, float((theirs - d)[~out].max(initial=-np.inf)))
        if convex:
            gap = d - plane_gap(a, b, TA, TB, found.normal)
            apart = max(apart, float(np.abs(gap[out]).max(initial=0.0)))
            overlap = max(overlap, float(np.abs(gap[~out]).max(initial=0.0)))
    certificate = f"{apart:9.1e} {overlap:9.1e}" if convex else " " * 19
    depth = f"{deeper:9.1e}" if simple else " " * 9
    return (
        f"{kind_a:>12} – {kind_b:<12} {total:>6} {reference:10.1e}   {certificate}   {depth}   {wrong:>3}"
        f"   {1e6 * used / total:9.2f}"
    )


def main(count: int = COUNT) -> None:
    rng = np.random.default_rng(0)
    print(f"{'kinds':>24} {'pairs':>9} {'reference':>10}   {'certificate':^19}   depth−coal   NaN   µs")
    names = list(MAKE)
    for i, kind_b in enumerate(names):
        for kind_a in names[: i + 1]:
            print(row(kind_a, kind_b, rng, count), flush=True)


if __name__ == "__main__":
    main()
