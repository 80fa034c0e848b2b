"""How well and how fast are known bodies located in one noisy depth image?

    python -m benchmarks.locate_objects [--poses 5]

Every scanned object beside the repository (or every household object) in random resting poses, seen by one camera of
640 × 480 pixels at 0.9 m with the noise of a structured-light sensor. The peer registers the same points with
small_gicp from the same hypotheses' start (the body at the middle of the points, in its likeliest resting pose, 20
turns, the best by its own error). Errors are distances between surfaces, so that symmetries do not count.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import apprehend as ap
from apprehend.perception import Camera, ModelSurface, Noise, Plane, locate, look_at
from apprehend.perception.hypotheses import resting_hypotheses
from apprehend.perception.locating import surface_distance
from apprehend.perception.segment import groups_above
from apprehend.sim import World, look

SCANS = Path(__file__).resolve().parents[2] / "shared" / "objects"


def gicp(points: np.ndarray, body: ap.Body, surface: ModelSurface, eye: np.ndarray) -> np.ndarray:
    """The best of twenty runs of generalised ICP."""
    import small_gicp

    model = body.sample_surface(4000, np.random.default_rng(0))[0]
    target, tree = small_gicp.preprocess_points(model, downsampling_resolution=0.002)
    source, _ = small_gicp.preprocess_points(points, downsampling_resolution=0.002)
    best, error = np.eye(4), np.inf
    for pose in resting_hypotheses(surface, points, [eye], Plane())[:20]:
        found = small_gicp.align(
            target, source, tree, init_T_target_source=np.linalg.inv(pose), max_correspondence_distance=0.03
        )
        score = found.error / max(found.num_inliers, 1) ** 2
        if score < error:
            best, error = np.linalg.inv(found.T_target_source), score
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=3)
    poses = parser.parse_known_args()[0].poses
    if SCANS.is_dir():
        bodies = [ap.Body.load(path) for path in sorted(SCANS.glob("*.obj"))]
    else:
        bodies = [ap.Body.household(name) for name in ap.bodies.HOUSEHOLD]
    names = ("ours", "small_gicp")
    errors: dict[str, list[float]] = {name: [] for name in names}
    times: dict[str, list[float]] = {name: [] for name in names}
    for body in bodies:
        surface = ModelSurface(body)
        for seed in range(poses):
            rng = np.random.default_rng(seed)
            scene = ap.Scene.tabletop("ur5e", body=body)
            rest = body.stable_poses()
            chance = np.array([p.probability for p in rest])
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            T = np.eye(4)
            T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
            T = T @ rest[rng.choice(len(rest), p=chance / chance.sum())].pose
            T[:2, 3] += [0.6, rng.uniform(-0.2, 0.2)]
            world = World(scene.moved(body.name, T), rng=rng)
            eye = np.array([1.25, 0.25, 0.65])
            image = look(world, Camera.from_fov(), look_at(eye, [0.6, 0.0, 0.0]), noise=Noise()).image
            start = time.perf_counter()
            found = locate(image, body, rng=rng)
            times["ours"].append(time.perf_counter() - start)
            options = [found.pose, *found.alternatives]
            errors["ours"].append(min(surface_distance(surface, pose, T) for pose in options))
            start = time.perf_counter()
            groups = groups_above([image], Plane(), 0.004, None)
            pose = gicp(groups[0].points, body, surface, eye)
            times["small_gicp"].append(time.perf_counter() - start)
            errors["small_gicp"].append(surface_distance(surface, pose, T))
    print(f"{'':12} {'within 3 mm':>12} {'median error':>14} {'median time':>12} {'longest':>9}")
    for name in names:
        e, t = np.array(errors[name]), np.array(times[name])
        print(
            f"{name:12} {(e < 0.003).mean():12.0%} {np.median(e) * 1e3:11.2f} mm "
            f"{np.median(t):10.2f} s {t.max():7.2f} s"
        )


if __name__ == "__main__":
    main()
