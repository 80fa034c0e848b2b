"""Validity of Panda configurations: spheres on lanes and convex pieces, beside coal through Pinocchio from Python.

Self-collision and twenty obstacles. The exact model is the convex hulls of the links' collision meshes; coal checks the
same hulls. Then a million configurations: is what the spheres call free free in the exact model, too? The same with a
depth camera's cloud of points and a half-space as obstacles. One thread, and two.
"""

from __future__ import annotations

import numpy as np

from apprehend.collision import Cloud, CollisionModel, Convex, HalfSpace
from apprehend.kernels import sphere
from apprehend.kinematics import Robot
from apprehend.parallel import set_threads
from benchmarks._harness import interleave, table

MANY = 1_000_000
COUNT = 20_000
COUNT_COAL = 60


def scene_of(robot: Robot, rng: np.random.Generator, model: CollisionModel, obstacles: int = 20) -> CollisionModel:
    """Boxes around the robot at 0.35 to 1 m."""
    for k in range(obstacles):
        angle, r = rng.uniform(-np.pi, np.pi), rng.uniform(0.45, 1.0)
        T = np.eye(4)
        T[:3, 3] = r * np.cos(angle), r * np.sin(angle), rng.uniform(0.0, 1.1)
        model = model.add(f"box{k}", [Convex.box(rng.uniform(0.03, 0.2, 3))], T)
    return model


class Coal:
    """The same shapes and pairs in Pinocchio's geometry model."""

    def __init__(self, model: CollisionModel):
        import coal
        import pinocchio as pin

        robot = model.robot
        assert robot.description.source is not None
        full = pin.buildModelFromUrdf(str(robot.description.source))
        self.pin, self.model = pin, full
        self.geometry = pin.GeometryModel()
        numbers: list[list[int]] = []
        for node in model.nodes:
            numbers.append([])
            for k, shape in enumerate(node.shapes):
                if len(shape.faces):
                    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
                    for p in shape.points:
                        points.append(p)
                    for f in shape.faces:
                        faces.append(coal.Triangle(*map(int, f)))
                    geometry = coal.Convex(points, faces)
                else:
                    geometry = coal.Box(2.0 * shape.size)
                joint, local = 0, shape.pose
                if node.carrier >= 0:
                    frame = full.frames[full.getFrameId(node.name)]
                    joint = frame.parentJoint
                    place = np.eye(4)
                    f = robot.frame_names.index(node.name)
                    place[:3, :3], place[:3, 3] = (
                        robot.model.frame_place[f][:9].reshape(3, 3),
                        robot.model.frame_place[f][9:],
                    )
                    local = frame.placement.homogeneous @ np.linalg.inv(place) @ shape.pose
                placed = pin.SE3(local[:3, :3], local[:3, 3])
                thing = pin.GeometryObject(f"{node.name}_{k}", joint, 0, placed, geometry)
                numbers[-1].append(self.geometry.addGeometryObject(thing))
        for a, b in model.compiled.blocks[:, :2]:
            for g in numbers[a]:
                for h in numbers[b]:
                    self.geometry.addCollisionPair(pin.CollisionPair(g, h))
        self.data, self.geometry_data = full.createData(), pin.GeometryData(self.geometry)
        names = [full.names[j] for j in range(1, full.njoints)]
        self.coordinates = [
            robot.index(n) if n in robot.joint_names else robot.index("panda_finger_joint1") for n in names
        ]

    def collides(self, q: np.ndarray) -> bool:
        return bool(
            self.pin.computeCollisions(
                self.model, self.data, self.geometry, self.geometry_data, q[self.coordinates], True
            )
        )


def spheres_alone(model: CollisionModel, q: np.ndarray) -> np.ndarray:
    """What the spheres call free."""
    blocked = np.zeros(len(q), np.int64)
    sphere.check_lanes(model.lanes, q, model.clearance, 0, len(q), blocked)
    return blocked == 0


def false_free(model: CollisionModel, rng: np.random.Generator, count: int = MANY) -> tuple[int, int]:
    """Among *count* random configurations: how many spheres call free, and how many of these the exact model hits."""
    lower, upper = model.robot.limits.lower, model.robot.limits.upper
    free = wrong = 0
    for _ in range(-(-count // COUNT)):
        q = rng.uniform(lower, upper, (COUNT, model.robot.n))
        q = q[spheres_alone(model, q)]
        free += len(q)
        wrong += int((model.hits(q) >= 0).sum())
    return free, wrong


def cloud_of(model: CollisionModel, rng: np.random.Generator) -> Cloud:
    """100,000 points on the boxes' surfaces, with 1 mm of noise: what depth cameras would see of them."""
    points = []
    for node in model.nodes:
        if node.carrier < 0 and node.name.startswith("box"):
            shape = node.shapes[0]
            p = rng.uniform(-1.0, 1.0, (5000, 3))
            axis = rng.integers(3, size=len(p))
            p[np.arange(len(p)), axis] = np.sign(p[np.arange(len(p)), axis])
            points.append((p * shape.size) @ shape.pose[:3, :3].T + shape.pose[:3, 3])
    seen = np.concatenate(points)
    return Cloud.of(seen + rng.normal(size=seen.shape) * 1e-3, 0.002)


def main() -> None:
    rng = np.random.default_rng(0)
    robot = Robot.load("panda")
    alone = CollisionModel(robot)
    model = scene_of(robot, rng, alone)
    floor = HalfSpace.through([0.0, 0.0, -0.01])
    touching = [("floor", "panda_link0")]
    cloudy = alone.add("cloud", cloud_of(model, rng)).add("floor", floor).allow(touching)
    models = {"20 boxes": model, "100,000 points and a floor": cloudy}
    q = rng.uniform(robot.limits.lower, robot.limits.upper, (COUNT, robot.n))
    peer = Coal(model)
    some = q[:COUNT_COAL]
    ours, theirs = model.hits(some) >= 0, np.array([peer.collides(x) for x in some])
    print(f"free: {model.free(q).mean():.2f}; same answer as coal: {(ours == theirs).mean():.4f}")
    for name, each in models.items():
        free, wrong = false_free(each, rng)
        print(f"{name}: spheres call {free} of {MANY} free ({free / MANY:.2f}); {wrong} of these the exact model hits")
    for threads in (1, 2):
        set_threads(threads)
        contenders = {
            "spheres, then exact pieces": (lambda: model.free(q), COUNT),
            "exact pieces": (lambda: model.hits(q[:4000]), 4000),
            "coal through Pinocchio": (lambda: [peer.collides(x) for x in some], COUNT_COAL),
            "spheres, then exact: points and floor": (lambda: cloudy.free(q), COUNT),
        }
        if threads == 1:
            contenders["spheres alone"] = (lambda: spheres_alone(model, q), COUNT)
            contenders["spheres alone: points and floor"] = (lambda: spheres_alone(cloudy, q), COUNT)
        timings = interleave(contenders, rounds=5)
        table(f"one configuration, {threads} thread{'s' * (threads > 1)}", timings, "spheres, then exact pieces")


if __name__ == "__main__":
    main()
