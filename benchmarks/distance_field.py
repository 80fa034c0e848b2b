"""A signed distance field of a 50,000-triangle scan at 2 mm: how long, how exact, and how many questions a second.

    python -m benchmarks.distance_field

The scan is one of the objects beside the repository (else a household object), divided and roughened to about 50,000
triangles, once closed and once with holes. Peers: trimesh's signed distance (r-tree and NumPy) at a sample of the
points, for exactness and speed, and SciPy's linear interpolation on the same grid.
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import numpy as np

import apprehend as ap
from apprehend import parallel
from apprehend.bodies import DistanceField, MeshIndex
from apprehend.bodies.convex import point_triangle_squared

from ._harness import interleave, seconds, table

SCANS = Path(__file__).resolve().parents[2] / "shared" / "objects"
TRIANGLES = 50_000
RESOLUTION = 0.002


def scan(name: str = "ycb_mustard_bottle") -> tuple[str, np.ndarray, np.ndarray]:
    """A closed mesh of about `TRIANGLES` triangles with the roughness of a scan (0.1 mm)."""
    import fast_simplification
    import trimesh

    path = SCANS / f"{name}.obj"
    body = ap.Body.load(path) if path.exists() else ap.Body.household("bottle")
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    while len(mesh.faces) < TRIANGLES:
        mesh = mesh.subdivide()
    rng = np.random.default_rng(0)
    vertices = np.asarray(mesh.vertices) + 1e-4 * mesh.vertex_normals * rng.normal(size=(len(mesh.vertices), 1))
    size = np.ptp(vertices)
    v, f = fast_simplification.simplify(
        (vertices / size).astype(np.float32), mesh.faces.astype(np.int32), target_count=TRIANGLES
    )
    return body.name, np.asarray(v, dtype=np.float64) * size, np.asarray(f, dtype=np.int64)


def main() -> None:
    name, vertices, faces = scan()
    rng = np.random.default_rng(1)
    holes = faces[np.linalg.norm(vertices[faces].mean(axis=1) - vertices[faces[7]].mean(axis=0), axis=1) > 0.02]
    for label, triangles, scale in (
        ("closed", faces, 1),
        ("with a hole of 4 cm", holes, 1),
        ("twice the size", faces, 2),
    ):
        for threads in (1, 2):
            parallel.set_threads(threads)
            best = np.inf
            for _ in range(3):
                start = time.perf_counter()
                field = DistanceField.of(MeshIndex(scale * vertices, triangles), RESOLUTION)
                best = min(best, time.perf_counter() - start)
            print(
                f"{name}, {len(triangles)} triangles, {label}: {field.values.size / 1e6:.2f} million points at 2 mm in "
                f"{best:.2f} s on {threads} thread(s), tree included (claim: 3 s)"
            )
    index = MeshIndex(vertices, faces)
    field = DistanceField.of(index, RESOLUTION)
    grid = np.stack([rng.integers(0, n, 2000) for n in field.values.shape], axis=1)
    points = field.origin + field.spacing * grid
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = time.perf_counter()
        _, distance, _ = trimesh.proximity.closest_point_naive(mesh, points[:200])
        naive = time.perf_counter() - start
    value = np.abs(field.values[tuple(grid[:200].T)])
    exhaustive = np.sqrt([point_triangle_squared(p[None], vertices[faces]).min() for p in points[:200]])
    print(
        f"largest difference from an exhaustive search in float64: ours {np.abs(value - exhaustive).max():.1e} m, ",
        end="",
    )
    print(f"trimesh's own {np.abs(distance - exhaustive).max():.1e} m")
    sign = index.inside(points) == (field.values[tuple(grid.T)] < 0.0)
    print(f"signs that differ from the exact winding number: {np.sum(~sign)} of {len(sign)}")
    start = time.perf_counter()
    index.signed_distance(points)
    ours = (time.perf_counter() - start) / len(points)
    print(f"exact signed distance of one point: ours {seconds(ours)}, trimesh {seconds(naive / 200)} (unsigned)")

    many = rng.uniform(field.origin, field.upper, (1_000_000, 3))
    exact = index.signed_distance(many[:20_000])
    error = np.abs(field.distance(many[:20_000]) - exact)
    print(
        f"between the grid points: error median {np.median(error):.1e} m, largest {error.max():.1e} m, "
        f"stated bound {field.error:.1e} m"
    )
    from scipy.interpolate import RegularGridInterpolator

    axes = [field.origin[k] + field.spacing * np.arange(field.values.shape[k]) for k in range(3)]
    scipy = RegularGridInterpolator(axes, field.values)
    for threads in (1, 2):
        parallel.set_threads(threads)
        timings = interleave(
            {
                "ours": (lambda: field.distance(many), len(many)),
                "ours, with gradient": (lambda: field.distance_and_gradient(many), len(many)),
                "SciPy": (lambda: scipy(many[:100_000]), 100_000),
            },
            rounds=5,
        )
        table(f"questions at random points, {threads} thread(s) (claim: 5 million/s = 200 ns)", timings, "ours")
        print(f"  ours: {1e-6 / timings['ours'].median:.1f} million/s")


if __name__ == "__main__":
    main()
