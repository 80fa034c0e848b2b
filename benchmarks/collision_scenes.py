"""How long until a collision model answers: one obstacle more, a body taken into the hand, a robot loaded.

Each time a new model is made and asked whether one configuration is free. Beside it coal through Pinocchio: an object
is added to the geometry model with its pairs, and the collisions of the configuration are computed; of the robot, the
geometry model is read from the URDF (it keeps whole meshes, which cost less to set up and more to check). Coal changes
its model in place, and the object is taken out again, untimed; ours are values, and the models before stay what they
were.
"""

from __future__ import annotations

import time

import numpy as np

from apprehend.bodies import Body
from apprehend.collision import Cloud, CollisionModel, Convex, HalfSpace
from apprehend.errors import ApprehendError
from apprehend.kinematics import Robot
from apprehend.parallel import set_threads
from benchmarks._harness import interleave, table
from benchmarks.collision_validity import Coal, cloud_of, scene_of

COUNTS = (5, 20, 100)
ROBOTS = ("panda", "ur5e", "baxter", "talos", "g1")


class Scenes(Coal):
    """Coal's scene, and one box more."""

    def __init__(self, model: CollisionModel, size: np.ndarray, T: np.ndarray, q: np.ndarray):
        super().__init__(model)
        self.size, self.T, self.q = size, T, q
        self.moving = sum(len(node.shapes) for node in model.nodes if node.carrier >= 0)

    def one_more(self) -> bool:
        """Add the box, ask, and take the box away."""
        import coal

        pin = self.pin
        placed = pin.SE3(self.T[:3, :3], self.T[:3, 3])
        box = self.geometry.addGeometryObject(pin.GeometryObject("new", 0, 0, placed, coal.Box(*self.size)))
        for g, thing in enumerate(self.geometry.geometryObjects):
            if thing.parentJoint > 0:
                self.geometry.addCollisionPair(pin.CollisionPair(g, box))
        self.geometry_data = pin.GeometryData(self.geometry)
        hit = self.collides(self.q)
        self.geometry.removeGeometryObject("new")
        return hit


def changes(robot: Robot) -> None:
    """One obstacle more in a scene of few and of many, of boxes, clouds and bodies."""
    alone, size, T = CollisionModel(robot), np.array([0.1, 0.1, 0.1]), np.eye(4)
    T[:3, 3] = 0.5, 0.1, 0.4
    mug, q = Body.household("mug"), robot.home
    for count in COUNTS:
        model = scene_of(robot, np.random.default_rng(0), alone, count)
        peer = Scenes(model, size, T, q)
        assert peer.one_more() == (not model.add("new", [Convex.box(size)], T).free(q))
        first = model.names[-1]
        contenders = {
            "a box more": (lambda m=model: m.add("new", [Convex.box(size)], T).free(q), 1),
            "a box less": (lambda m=model, name=first: m.remove(name).free(q), 1),
            "a mug more": (lambda m=model: m.add("mug", mug, T).free(q), 1),
            "a mug in the hand": (lambda m=model: m.attach(mug, robot.frame_names[-1], np.eye(4)).free(q), 1),
            "coal: a box more, a box less": (peer.one_more, 1),
        }
        table(f"Panda and {count} boxes: change and first answer", interleave(contenders, rounds=25), "a box more")
    rng = np.random.default_rng(1)
    full = scene_of(robot, rng, alone)
    full = full.add("cloud", cloud_of(full, rng)).add("floor", HalfSpace.through([0.0, 0.0, -0.01]))
    full = full.add("field", mug.distance_field(0.004), T)
    points = rng.normal(size=(100_000, 3)) * 0.3
    contenders = {
        "a box more": (lambda: full.add("new", [Convex.box(size)], T).free(q), 1),
        "a new cloud of 100,000 points": (lambda: alone.add("seen", Cloud.of(points, 0.002)).free(q), 1),
        "the same, on a grid of 10 mm": (lambda: alone.add("seen", Cloud.of(points, 0.002, spacing=0.01)).free(q), 1),
    }
    table("Panda, 20 boxes, a cloud, a floor and a field", interleave(contenders, rounds=7), "a box more")


def construction() -> None:
    """A robot that was just read: the first model of it, the second, and Pinocchio's geometry model."""
    import pinocchio as pin

    print(
        "\nmodel of a robot: first (pieces of meshes kept on disk) / next models of it / Pinocchio reads its geometry"
    )
    for name in ROBOTS:
        try:
            robot = Robot.load(name)
        except ApprehendError as error:
            print(f"  {name:<8} {error}")
            continue
        times = []
        for _ in range(2):
            start = time.perf_counter()
            CollisionModel(robot).free(robot.home)
            times.append(time.perf_counter() - start)
        source, theirs = robot.description.source, "its file is no URDF"
        if source is not None and source.suffix == ".urdf":
            model = pin.buildModelFromUrdf(str(source))
            start = time.perf_counter()
            folders = [str(folder) for folder in source.parents[:5]]  # where packages may lie
            try:
                pin.buildGeomFromUrdf(model, str(source), pin.GeometryType.COLLISION, package_dirs=folders)
                theirs = f"{1e3 * (time.perf_counter() - start):.0f} ms"
            except Exception as error:  # anything, from C++
                theirs = f"does not read it: {str(error).splitlines()[0][:60]}"
        print(f"  {name:<8} {1e3 * times[0]:8.1f} ms {1e3 * times[1]:8.3f} ms   {theirs}")


def main() -> None:
    some = Robot.load("ur3e")  # kernels are loaded, and SciPy
    CollisionModel(some).add("box", [Convex.box([0.1, 0.1, 0.1])]).free(some.home)
    construction()
    panda = Robot.load("panda")
    for threads in (1, 2):
        set_threads(threads)
        print(f"\n== {threads} thread{'s' * (threads > 1)}")
        changes(panda)


if __name__ == "__main__":
    main()
