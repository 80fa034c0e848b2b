"""Distance of every pair of kinds of geometry, at random poses, against closed forms, coal and certificates.

One line for every pair of kinds:

- *apart*: the two-sided bound of the distance where the shapes are apart. The answered points are checked to lie in the
  shapes, so that their distance is an upper bound; the plane across the answered normal is a lower one.
- *reference*: largest difference from a closed form; where there is none, from coal where the shapes are apart. *off*
  counts the pairs in which coal differs by more than 1e-9, and *proof* is the largest difference from a cone program
  (Clarabel) for the worst of those.
- *overlap*: how far the translation by the answered depth along the answered normal is from just separating. *deeper*:
  how much deeper the answer is than the best of a search over directions (negative, or rounding: no translation is
  shorter), and than coal's depth.

Clouds and unions: the least distance over all pairs of their parts that can matter by their bounding balls (parts are
the convex shapes of the rows above); two clouds by SciPy's k-d tree. Fields are sampled from a ball, and compared with
the ball itself within the reach of the grid: 60 to 64 nodes, 20 mm apart (*of*: how many pairs were compared). Run with
``--count``, and with ``--only KIND`` for the rows of one kind.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from apprehend.collision import Cloud, Convex, Grid, HalfSpace, Separation, Union, signed_distance
from apprehend.kernels.gjk import BOX, CYLINDER, HULL

COUNT = 10_000
ROUNDS = 10  # pairs of shapes of each pair of kinds
HEAVY = 2  # the same where parts are many
CHUNK = 20_000_000  # entries of a table of distances between balls
PROVE = 5  # pairs per pair of shapes that the cone program decides, at most
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
    "cloud": lambda rng: Cloud.of(rng.normal(size=(150, 3)) * 0.2, 0.01),
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


def excess(shape: Convex, T: np.ndarray, p: np.ndarray) -> np.ndarray:
    """How far points ``(N, 3)`` lie outside the shape at ``T (N, 4, 4)``, at least; 0 inside."""
    P = T @ shape.pose
    x = np.einsum("nji,nj->ni", P[:, :3, :3], p - P[:, :3, 3])
    if shape.kind == BOX:
        out = (np.abs(x) - shape.size).max(axis=1)
    elif shape.kind == CYLINDER:
        out = np.maximum(np.hypot(x[:, 0], x[:, 1]) - shape.size[0], np.abs(x[:, 2]) - shape.size[1])
    elif len(shape.points) <= 2:
        reach = np.abs(shape.points[:, 2]).max()
        axis = np.clip(x[:, 2], -reach, reach)[:, None] * [0.0, 0.0, 1.0]
        out = np.linalg.norm(x - axis, axis=1) - shape.radius
    else:
        corner = shape.points[shape.faces]
        n = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        n /= np.linalg.norm(n, axis=1)[:, None]
        out = (x @ n.T - np.einsum("fi,fi->f", n, corner[:, 0])).max(axis=1)
    return np.maximum(out, 0.0)


def directions(count: int) -> np.ndarray:
    """Unit vectors spread over the sphere."""
    i = np.arange(count) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * i / count), np.pi * (1.0 + 5.0**0.5) * i
    return np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)


def shallowest(a: Convex, b: Convex, TA: np.ndarray, TB: np.ndarray, starts: int = 2) -> np.ndarray:
    """Signed distance of shapes that overlap, by a search over directions: the shortest translation that it finds."""
    count = len(TA)
    if not count:
        return np.zeros(0)
    spread = directions(400)
    gaps = np.stack([plane_gap(a, b, TA, TB, np.tile(n, (count, 1))) for n in spread], axis=1)
    best = np.full(count, -np.inf)
    for k in np.argsort(-gaps, axis=1)[:, :starts].T:
        n, value, step = spread[k], gaps[np.arange(count), k], np.full(count, 0.05)
        for _ in range(90):
            u = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
            u /= np.linalg.norm(u, axis=1)[:, None]
            v = np.cross(n, u)
            moved = np.zeros(count, bool)
            for turn in np.arange(6) * np.pi / 3.0:
                trial = n + step[:, None] * (np.cos(turn) * u + np.sin(turn) * v)
                trial /= np.linalg.norm(trial, axis=1)[:, None]
                found = plane_gap(a, b, TA, TB, trial)
                better = found > value
                n, value = np.where(better[:, None], trial, n), np.where(better, found, value)
                moved |= better
            step = np.where(moved, step, 0.5 * step)
        best = np.maximum(best, value)
    return best


def cone_program(a: Convex, b: Convex, TA: np.ndarray, TB: np.ndarray) -> float:
    """Distance of one pair by an interior point method for cone programs, to about 1e-13."""
    import clarabel
    from scipy import sparse

    shapes = [(a, TA @ a.pose, 1), (b, TB @ b.pose, 4)]
    weights = [len(s.points) if s.kind == HULL else 0 for s in (a, b)]
    width = 7 + sum(weights)
    column = 7
    rows, right = [np.zeros((4, width))], [np.zeros(4)]
    rows[0][0, 0] = -1.0
    rows[0][1:, 1:4], rows[0][1:, 4:7] = -np.eye(3), np.eye(3)
    cones = [clarabel.SecondOrderConeT(4)]

    def add(block: np.ndarray, values: np.ndarray, cone: object) -> None:
        rows.append(block)
        right.append(values)
        cones.append(cone)

    for shape, P, first in shapes:
        turn, shift = P[:3, :3].T, -P[:3, :3].T @ P[:3, 3]
        if shape.kind == HULL:
            w = len(shape.points)
            block, total = np.zeros((3, width)), np.zeros((1, width))
            block[:, first : first + 3], block[:, column : column + w] = turn, -shape.points.T
            total[0, column : column + w] = 1.0
            add(np.vstack([block, total]), np.append(-shift, 1.0), clarabel.ZeroConeT(4))
            positive = np.zeros((w, width))
            positive[:, column : column + w] = -np.eye(w)
            add(positive, np.zeros(w), clarabel.NonnegativeConeT(w))
            column += w
            continue
        flat = [0, 1, 2] if shape.kind == BOX else [2]
        size = shape.size if shape.kind == BOX else shape.size[1:2]
        block = np.zeros((2 * len(flat), width))
        block[:, first : first + 3] = np.vstack([turn[flat], -turn[flat]])
        add(block, np.concatenate([size - shift[flat], size + shift[flat]]), clarabel.NonnegativeConeT(len(block)))
        if shape.kind == CYLINDER:
            block = np.zeros((3, width))
            block[1:, first : first + 3] = -turn[:2]
            add(block, np.array([shape.size[0], *shift[:2]]), clarabel.SecondOrderConeT(3))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-14
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((width, width)), np.eye(width)[0], sparse.csc_matrix(np.vstack(rows)), np.concatenate(right),
        cones, settings,
    )  # fmt: skip
    return float(solver.solve().obj_val) - a.radius - b.radius


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
    request.gjk_tolerance = request.epa_tolerance = 1e-10  # below, more pairs go wrong than get better
    request.gjk_max_iterations, request.epa_max_iterations = 1000, 256
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
    """The least distance over all pairs of parts; pairs whose bounding balls are farther than that are left out."""
    if isinstance(a, Cloud) and isinstance(b, Cloud):
        return np.array([clouds(a, b, A, B) for A, B in zip(TA, TB, strict=True)])
    first, second = parts(a), parts(b)
    if isinstance(b, HalfSpace):
        return np.min([signed_distance(part, b, TA, TB).distance for part in first], axis=0)
    if isinstance(a, HalfSpace):
        return np.min([signed_distance(a, part, TA, TB).distance for part in second], axis=0)
    (pa, ra), (pb, rb) = balls(first), balls(second)
    chunk = max(1, CHUNK // (len(first) * len(second)))
    return np.concatenate(
        [chunk_by_parts(first, second, pa, pb, ra, rb, TA[k : k + chunk], TB[k : k + chunk])
         for k in range(0, len(TA), chunk)]
    )  # fmt: skip


def balls(shapes: list[object]) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of balls that hold the shapes."""
    return np.array([s.ball[0] for s in shapes]), np.array([s.ball[1] for s in shapes])  # type: ignore[attr-defined]


def clouds(a: Cloud, b: Cloud, A: np.ndarray, B: np.ndarray) -> float:
    """Distance of two clouds by SciPy's k-d tree."""
    from scipy.spatial import cKDTree

    A, B = A @ a.pose, B @ b.pose
    tree = cKDTree(a.points @ A[:3, :3].T + A[:3, 3])
    return float(tree.query(b.points @ B[:3, :3].T + B[:3, 3])[0].min()) - a.radius - b.radius


def chunk_by_parts(first, second, pa, pb, ra, rb, TA, TB):  # type: ignore[no-untyped-def]
    world = [np.einsum("nij,kj->nki", T[:, :3, :3], p) + T[:, None, :3, 3] for T, p in ((TA, pa), (TB, pb))]
    squared = (world[0] ** 2).sum(-1)[:, :, None] + (world[1] ** 2).sum(-1)[:, None]
    squared -= 2.0 * world[0] @ world[1].swapaxes(1, 2)
    low = np.sqrt(np.maximum(squared, 0.0)) - ra[:, None] - rb - 1e-6
    low = low.reshape(len(TA), -1)
    least = np.full(len(TA), np.inf)
    likely = np.argmin(low, axis=1)
    for turn in range(2):
        if turn:
            pose, pair = np.nonzero(low < least[:, None])
        else:
            pose, pair = np.arange(len(TA)), likely
        order = np.argsort(pair, kind="stable")
        pose, pair = pose[order], pair[order]
        names, starts = np.unique(pair, return_index=True)
        for k, rows in zip(names, np.split(pose, starts[1:]), strict=True):
            i, j = divmod(int(k), len(second))
            found = signed_distance(first[i], second[j], TA[rows], TB[rows]).distance
            least[rows] = np.minimum(least[rows], found)
    return least


def in_reach(a: object, b: object, TA: np.ndarray, TB: np.ndarray, found: Separation) -> np.ndarray:
    """Whether the nearest point of the first shape's core lies within the grid of the second, a field."""
    assert isinstance(b, Grid)
    core = found.points[:, 0] + getattr(a, "radius", 0.0) * found.normal
    local = np.einsum("nij,ni->nj", TB[:, :3, :3], core - TB[:, :3, 3]) - b.pose[:3, 3]
    return np.asarray((np.abs(local) <= b.half).all(axis=1))


def simple_row(kind_a: str, kind_b: str, rng: np.random.Generator, count: int) -> str:
    """One line of the table for two convex shapes, or one and a half-space."""
    convex = kind_b in CONVEX
    apart, overlap, reference, proof = 0.0, 0.0, 0.0, 0.0
    deeper, than_coal = -np.inf, -np.inf
    off, wrong, total, used = 0, 0, 0, 0.0
    for _ in range(ROUNDS):
        a, b = MAKE[kind_a](rng), MAKE[kind_b](rng)
        TA, TB = poses(rng, count // ROUNDS), poses(rng, count // ROUNDS)
        found, seconds = timed(a, b, TA, TB)
        used, total, wrong = used + seconds, total + len(TA), wrong + invalid(found)
        d = found.distance
        out = d > 0.0
        exact, theirs = closed_form(a, b, TA, TB), coal_distances(a, b, TA, TB)
        than_coal = max(than_coal, float((theirs - d)[~out].max(initial=-np.inf)))
        if exact is not None:
            reference = max(reference, float(np.abs(d - exact).max()))
        else:
            error = np.where(out, np.abs(d - theirs), 0.0)
            doubted = np.flatnonzero(error > 1e-9)
            off += len(doubted)
            reference = max(reference, float(error[error <= 1e-9].max(initial=0.0)))
            for i in doubted[np.argsort(-error[doubted])][:PROVE]:
                proof = max(proof, abs(float(d[i]) - cone_program(a, b, TA[i], TB[i])))
        if convex:
            plane = plane_gap(a, b, TA, TB, found.normal)
            upper = np.linalg.norm(found.points[:, 0] - found.points[:, 1], axis=1)
            upper += excess(a, TA, found.points[:, 0]) + excess(b, TB, found.points[:, 1])
            bounds = np.maximum(np.abs(upper - plane), np.maximum(np.abs(d - plane), np.abs(upper - d)))
            apart = max(apart, float(bounds[out].max(initial=0.0)))
            overlap = max(overlap, float(np.abs(d - plane)[~out].max(initial=0.0)))
            searched = shallowest(a, b, TA[~out], TB[~out])
            deeper = max(deeper, float((searched - d[~out]).max(initial=-np.inf)))
    bounds_text = f"{apart:9.1e}" if convex else " " * 9
    proof_text = f"{off:>5} {proof:9.1e}" if off else " " * 15
    depth_text = f"{overlap:9.1e} {deeper:9.1e}" if convex else " " * 19
    return (
        f"{kind_a:>12} – {kind_b:<12} {total:>6} {bounds_text} {reference:10.1e} {proof_text} {depth_text} "
        f"{than_coal:9.1e} {wrong:>4} {1e6 * used / total:8.2f}"
    )


def heavy_row(kind_a: str, kind_b: str, rng: np.random.Generator, count: int) -> str:
    """One line of the table where one is a cloud, a union or a field."""
    reference, wrong, total, compared, used = 0.0, 0, 0, 0, 0.0
    for _ in range(HEAVY):
        a, b = MAKE[kind_a](rng), MAKE[kind_b](rng)
        TA, TB = poses(rng, count // HEAVY), poses(rng, count // HEAVY)
        if kind_b == "field":
            TA = beside(a, TA, TB, rng)
        found, seconds = timed(a, b, TA, TB)
        used, total, wrong = used + seconds, total + len(TA), wrong + invalid(found)
        if kind_a == kind_b == "half-space":
            continue
        expected = by_parts(a, b, TA, TB)
        near = np.ones(len(TA), bool)
        if "field" in (kind_a, kind_b):
            near = (expected > -0.02) & (expected < 0.05) & in_reach(a, b, TA, TB, found)
        compared += int(near.sum())
        reference = max(reference, float(np.abs(found.distance - expected)[near].max(initial=0.0)))
    return (
        f"{kind_a:>12} – {kind_b:<12} {total:>6} {'':9} {reference:10.1e} {f'of {compared}':<15} {'':29} "
        f"{wrong:>4} {1e6 * used / total:8.2f}"
    )


def beside(a: object, TA: np.ndarray, TB: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """*TA* moved so that the shape is between −0.02 m and 0.05 m from the ball of the field."""
    ball = Convex.sphere(BALL)
    before = signed_distance(ball if isinstance(a, Grid) else a, ball, TA, TB)
    moved = TA.copy()
    moved[:, :3, 3] += (rng.uniform(-0.02, 0.05, len(TA)) - before.distance)[:, None] * before.normal
    return moved


def timed(a: object, b: object, TA: np.ndarray, TB: np.ndarray) -> tuple[Separation, float]:
    """The answers, and the seconds that they took."""
    signed_distance(a, b, TA[:1], TB[:1])
    begin = time.perf_counter()
    found = signed_distance(a, b, TA, TB)
    return found, time.perf_counter() - begin


def invalid(found: Separation) -> int:
    """How many numbers of the answers are NaN."""
    return int(sum(np.isnan(x).sum() for x in (found.distance, found.points, found.normal)))


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--count", type=int, default=COUNT, help="poses of each pair of kinds")
    reader.add_argument("--only", choices=list(MAKE), action="append", help="rows of this kind; may be repeated")
    chosen = reader.parse_args()
    rng, begin = np.random.default_rng(0), time.perf_counter()
    print(
        f"{'kinds':>24} {'pairs':>9} {'apart':>9} {'reference':>10} {'off':>5} {'proof':>9} {'overlap':>9} "
        f"{'deeper':>9} {'than coal':>9} {'NaN':>4} {'µs':>8}"
    )
    names = list(MAKE)
    for i, kind_b in enumerate(names):
        for kind_a in names[: i + 1]:
            if chosen.only and not {kind_a, kind_b} & set(chosen.only):
                continue
            simple = kind_a in CONVEX and kind_b in (*CONVEX, "half-space")
            line = (simple_row if simple else heavy_row)(kind_a, kind_b, rng, chosen.count)
            print(line, flush=True)
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
