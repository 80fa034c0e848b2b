"""How often does the main job succeed? Every mesh of a directory, in random resting poses, with each robot.

    python -m benchmarks.pick_objects [--objects DIR|household] [--poses 5] [--robots ur5e panda] [--hand allegro_right]

Without a directory the scanned objects beside the repository are taken, or the household objects of the package. A
pose whose goal cannot be met physically counts like any other: nothing is left out. Every failure is printed with the
step and the reason. There is no peer that does the whole job without ROS or a GPU; the claim is the rate itself.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np

import apprehend as ap
from apprehend.process import pick_and_place, shuffled

SCANS = Path(__file__).resolve().parents[2] / "shared" / "objects"


def bodies(directory: Path | None) -> list[ap.Body]:
    """The meshes of *directory*, or the household objects."""
    if directory == Path("household"):
        return [ap.Body.household(name) for name in ap.bodies.HOUSEHOLD]
    if directory is None and SCANS.is_dir():
        directory = SCANS
    if directory is None:
        return [ap.Body.household(name) for name in ap.bodies.HOUSEHOLD]
    return [ap.Body.load(path) for path in sorted(directory.glob("*.obj"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=Path)
    parser.add_argument("--poses", type=int, default=5)
    parser.add_argument("--robots", nargs="+", default=["ur5e", "panda"])
    parser.add_argument("--hand", default="auto", help="in the place of the robot's own")
    parser.add_argument("--only", nargs="+", default=[""], help="names, or parts of them")
    args = parser.parse_args()
    for robot in args.robots:
        good, total, walls, slips = 0, 0, [], []
        failures: Counter[str] = Counter()
        for body in bodies(args.objects):
            if not any(part in body.name for part in args.only):
                continue
            wins = 0
            for seed in range(1, args.poses + 1):
                start = time.perf_counter()
                scene = shuffled(ap.Scene.tabletop(robot, args.hand, body=body), seed)
                episode = pick_and_place(scene, seed=seed)
                walls.append(time.perf_counter() - start)
                wins += episode.success
                if episode.success:
                    slips.append(episode.verdict.slip * 1e3)
                else:
                    failures[episode.steps[-1].name if not episode.steps[-1].success else "judge"] += 1
                    print(f"    {robot} {body.name} seed {seed}: {episode.verdict.reason}", flush=True)
            good, total = good + wins, total + args.poses
            print(f"  {robot:8} {body.name:28} {wins} of {args.poses}", flush=True)
        rate, typical = 100 * good / max(total, 1), np.median(walls)
        print(
            f"{robot}: {good} of {total} ({rate:.0f} %), median wall time {typical:.1f} s, "
            f"longest {np.max(walls):.1f} s, median slip {np.median(slips or [np.nan]):.2f} mm"
            + (f"; failed at {dict(failures)}" if failures else "")
        )


if __name__ == "__main__":
    main()
