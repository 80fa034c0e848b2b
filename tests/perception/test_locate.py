"""Locating bodies in images of the simulated world (whose renderer is not ours)."""

from __future__ import annotations

import numpy as np
import pytest

from apprehend.arrays import Array
from apprehend.bodies import Body
from apprehend.errors import InputError
from apprehend.perception import Camera, DepthImage, LocateStatus, ModelSurface, Noise, Plane, locate, look_at
from apprehend.perception.locating import surface_distance
from apprehend.sim import World, look
from tests.sim.scenes import pendulum, scene, table, translation
from tests.support import shared

SHARED = [
    "kit_water_bottle_simox", "pybullet_random_042", "ycb_banana", "ycb_cracker_box", "ycb_hammer", "ycb_large_clamp",
    "ycb_mustard_bottle", "ycb_phillips_screwdriver", "ycb_rubiks_cube", "ycb_tomato_soup_can",
]  # fmt: skip
EYE = [1.15, 0.25, 0.65]


def turned(yaw: float) -> Array:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    return T


def resting(body: Body, rng: np.random.Generator) -> Array:
    poses = body.stable_poses()
    chance = np.array([p.probability for p in poses])
    T = turned(rng.uniform(0.0, 2.0 * np.pi)) @ poses[rng.choice(len(poses), p=chance / chance.sum())].pose
    T[:2, 3] += rng.uniform([0.35, -0.2], [0.65, 0.2])
    return T


def picture(eye: list[float] | None = None, **bodies: tuple[Body, Array]) -> DepthImage:
    world = World(scene(pendulum(), boxes=(table(),), **bodies), rng=np.random.default_rng(7))
    pose = look_at(EYE if eye is None else eye, [0.5, 0.0, 0.0])
    return look(world, Camera.from_fov(), pose, noise=Noise()).image


def offset(body: Body, found: Array, true: Array) -> float:
    """Largest distance between the surfaces: poses that differ by a symmetry of the body count as equal."""
    surface = ModelSurface(body)
    return max(surface_distance(surface, found, true), surface_distance(surface, true, found))


@pytest.mark.parametrize("name", SHARED)
def test_real_objects_in_random_resting_poses(name: str) -> None:
    body = Body.load(shared(f"objects/{name}.obj"), mass=0.3)
    rng = np.random.default_rng(len(name))
    T = resting(body, rng)
    result = locate(picture(thing=(body, T)), body, rng=rng)
    assert result.status in (LocateStatus.SUCCESS, LocateStatus.AMBIGUOUS)
    error = offset(body, result.pose, T)
    assert min([error, *(offset(body, other, T) for other in result.alternatives)]) < 0.003
    if result.success:
        assert error < 0.003
        assert result.fitness > 0.95
        assert result.residual < 0.003


@pytest.mark.parametrize("name", ["mug", "bottle", "box", "banana"])
def test_generated_objects(name: str) -> None:
    body = Body.household(name)
    rng = np.random.default_rng(5)
    T = resting(body, rng)
    result = locate(picture(thing=(body, T)), body, rng=rng).require_success()
    assert offset(body, result.pose, T) < 0.003


def test_a_symmetry_is_not_an_error_but_an_open_freedom() -> None:
    can = Body.cylinder(0.035, 0.1, mass=0.3)
    T = translation(0.5, 0.05, 0.05)
    result = locate(picture(thing=(can, T)), can, rng=np.random.default_rng(0)).require_success()
    assert not result.alternatives
    assert offset(can, result.pose, T) < 0.002
    sigma = np.sqrt(np.diag(result.covariance))
    assert sigma[5] > 5.0 * sigma[3:5].max()  # the turn about the vertical is unknown, the tilt is not


def test_a_hidden_handle_is_reported() -> None:
    mug = Body.household("mug")
    standing = translation(0.0, 0.0, -mug.bounds[0, 2])
    seen, hidden = (translation(0.5, 0.0, 0.0) @ turned(yaw) @ standing for yaw in (0.5 * np.pi, np.pi))
    eye = [1.15, 0.0, 0.4]
    clear = locate(picture(eye, mug=(mug, seen)), mug, rng=np.random.default_rng(0))
    assert clear.success
    assert offset(mug, clear.pose, seen) < 0.003
    unclear = locate(picture(eye, mug=(mug, hidden)), mug, rng=np.random.default_rng(0))
    assert unclear.status is LocateStatus.AMBIGUOUS
    assert unclear.alternatives
    two = [picture(eye, mug=(mug, hidden)), picture([0.2, -0.7, 0.4], mug=(mug, hidden))]
    both = locate(two, mug, rng=np.random.default_rng(0)).require_success()
    assert offset(mug, both.pose, hidden) < 0.003


def test_the_right_one_of_two_objects() -> None:
    box, can = Body.box([0.06, 0.04, 0.12], mass=0.3), Body.cylinder(0.035, 0.1, mass=0.3)
    here, there = translation(0.45, -0.15, 0.06), translation(0.55, 0.15, 0.05)
    image = picture(box=(box, here), can=(can, there))
    for body, T in ((box, here), (can, there)):
        result = locate(image, body, rng=np.random.default_rng(1)).require_success()
        assert offset(body, result.pose, T) < 0.002
    region = [[0.3, -0.4, 0.0], [0.7, 0.0, 0.5]]
    assert not locate(image, can, rng=np.random.default_rng(1), region=region).success


def test_partly_hidden_behind_another() -> None:
    box = Body.box([0.06, 0.10, 0.12], mass=0.3)
    T = translation(0.45, 0.0, 0.06)
    image = picture(
        [1.15, 0.0, 0.5], box=(box, T), wall=(Body.box([0.02, 0.06, 0.08], mass=1.0), translation(0.62, 0.04, 0.04))
    )
    result = locate(image, box, rng=np.random.default_rng(1)).require_success()
    assert offset(box, result.pose, T) < 0.003


def test_a_guess_is_refined() -> None:
    body = Body.household("bottle")
    T = translation(0.5, 0.02, -body.bounds[0, 2])
    guess = translation(0.012, -0.009, 0.0) @ T
    result = locate(picture(thing=(body, T)), body, rng=np.random.default_rng(0), guess=guess).require_success()
    assert offset(body, result.pose, T) < 0.002


def test_a_body_in_the_air_is_found_near_a_guess() -> None:
    body = Body.box([0.05, 0.07, 0.1], mass=0.3)
    T = translation(0.5, 0.0, 0.2) @ turned(0.4)
    T[:3, :3] = T[:3, :3] @ np.array([[1, 0, 0], [0, np.cos(0.3), -np.sin(0.3)], [0, np.sin(0.3), np.cos(0.3)]])
    guess = translation(0.01, 0.01, -0.008) @ T
    result = locate(picture(thing=(body, T)), body, rng=np.random.default_rng(0), guess=guess, resting=False)
    assert result.success
    assert offset(body, result.pose, T) < 0.003


def test_a_table_at_another_height() -> None:
    body = Body.household("box")
    T = translation(0.5, 0.0, 0.3 - body.bounds[0, 2])
    world = World(scene(pendulum(), boxes=(table(0.3),), thing=(body, T)))
    image = look(world, Camera.from_fov(), look_at([1.15, 0.25, 0.95], [0.5, 0.0, 0.3]), noise=Noise()).image
    result = locate(image, body, plane=Plane(offset=0.3), rng=np.random.default_rng(0)).require_success()
    assert offset(body, result.pose, T) < 0.002


def test_the_same_seed_gives_the_same_answer() -> None:
    body = Body.household("mug")
    image = picture(thing=(body, translation(0.5, 0.0, -body.bounds[0, 2])))
    one, two = (locate(image, body, rng=np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(one.pose, two.pose)


def test_the_deviation_says_how_wrong_it_is() -> None:
    """Errors over many noisy images have about the covariance that the answers state."""
    body = Body.box([0.05, 0.08, 0.11], mass=0.3)
    T = translation(0.5, 0.0, 0.055)
    world = World(scene(pendulum(), boxes=(table(),), thing=(body, T)), rng=np.random.default_rng(3))
    errors, variances = [], []
    for k in range(12):
        image = look(world, Camera.from_fov(320, 240), look_at(EYE, [0.5, 0, 0]), noise=Noise()).image
        result = locate(image, body, rng=np.random.default_rng(k), guess=T)
        errors.append((result.pose - T)[:3, 3] + (result.pose - T)[:3, :3] @ body.com)
        variances.append(np.diag(result.covariance)[:3])
    ratio = np.mean(np.square(errors)) / np.mean(variances)
    assert 0.1 < ratio < 10.0


def test_what_is_not_there() -> None:
    body = Body.household("mug")
    empty = locate(picture(), body, rng=np.random.default_rng(0))
    assert empty.status is LocateStatus.NOT_SEEN
    assert empty.explain() == "The cameras see nothing on the table that could be the body."
    other = Body.box([0.2, 0.15, 0.02], mass=0.5)
    wrong = locate(picture(thing=(other, translation(0.5, 0.0, 0.01))), body, rng=np.random.default_rng(0))
    assert wrong.status is LocateStatus.POOR_FIT
    assert "No pose of the body explains the images well" in wrong.explain()


def test_bad_arguments() -> None:
    body, rng = Body.household("box"), np.random.default_rng(0)
    with pytest.raises(InputError, match="at least one depth image"):
        locate([], body, rng=rng)
    image = picture()
    with pytest.raises(InputError, match="lower below upper"):
        locate(image, body, rng=rng, region=[[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    with pytest.raises(InputError, match="guess"):
        locate(image, body, rng=rng, guess=2.0 * np.eye(4))
    with pytest.raises(InputError, match=r"guess has shape \(3, 4, 4\); expected one pose"):
        locate(image, body, rng=rng, guess=np.tile(np.eye(4), (3, 1, 1)))
    with pytest.raises(InputError, match="the normal must have length 1"):
        Plane((0.0, 0.0, 2.0))


def test_two_of_a_kind_are_told_apart_from_one() -> None:
    can = Body.cylinder(0.035, 0.1, mass=0.3)
    one, two = translation(0.5, -0.15, 0.05), translation(0.5, 0.15, 0.05)
    result = locate(picture(one=(can, one), two=(can, two)), can, rng=np.random.default_rng(0))
    assert result.status is LocateStatus.AMBIGUOUS
    found = [result.pose, *result.alternatives]
    assert all(min(offset(can, pose, T) for pose in found) < 0.002 for T in (one, two))
