"""Manipulability against its definition, polytopes against linear programs and sampling, pictures that draw."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from scipy.optimize import linprog

from apprehend.errors import InputError, MissingDependencyError
from apprehend.kinematics import Robot, draw, force_polytope, manipulability, velocity_polytope
from apprehend.robots.description import JointLimits

from .test_dh import chain_of
from .trees import random_pose, random_tree


def arm(seed: int = 3, joints: int = 14) -> tuple[Robot, str]:
    robot = Robot(random_tree(seed, joints, serial=True), base=random_pose(np.random.default_rng(seed)))
    joints_ = tuple(
        dataclasses.replace(j, limits=JointLimits(-3, 3, velocity=1.0 + i % 3, effort=5.0 + 3 * i))
        for i, j in enumerate(robot.description.joints)
    )
    robot = Robot(dataclasses.replace(robot.description, joints=joints_), base=robot.base)
    return robot, robot.frame_names[-1]


def planar() -> Robot:
    z = [0.0, 0, 1]
    return chain_of([("revolute", [0, 0, 0], z), ("revolute", [0.6, 0, 0], z)], [1.0, 0, 0])


def test_measures_are_those_of_the_script() -> None:
    robot, frame = arm()
    q = np.random.default_rng(0).normal(size=(4, 5, robot.n))
    m = manipulability(robot, q, frame)
    A = np.einsum("...ik,...jk->...ij", robot.jacobian(q, frame), robot.jacobian(q, frame))
    eigenvalues = np.linalg.eigvalsh(A)
    np.testing.assert_allclose(m.mu1, eigenvalues[..., 0], rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(m.mu2, eigenvalues[..., 0] / eigenvalues[..., -1], rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(m.mu3, np.linalg.det(A), rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(m.yoshikawa**2, m.mu3, rtol=1e-12)
    assert m.singular.shape == (4, 5)
    assert not m.singular.any()


def test_planar_arm_loses_its_radial_direction_when_stretched() -> None:
    """K's example: θ = (π/4, 0)."""
    robot = planar()
    m = manipulability(robot, [np.pi / 4, 0.0], "tool", "xy")
    assert m.rank == 1
    assert m.singular
    np.testing.assert_allclose(np.abs(m.lost()[0]), np.sqrt([0.5, 0.5]), atol=1e-12)
    assert m.mu1 < 1e-30
    assert np.isinf(m.force_semi_axes[1])
    bent = manipulability(robot, [0.3, 1.2], "tool", "xy")
    assert bent.rank == 2
    assert bent.lost().shape == (0, 2)
    assert np.isclose(bent.yoshikawa, 0.6 * 0.4 * np.sin(1.2))  # l1 l2 |sin θ2|
    both = manipulability(robot, [0.3, 1.2], "tool")
    assert both.rank == 2
    assert both.lost().shape == (4, 6)
    assert both.mu1 == 0.0


def test_weights_and_length_scale_the_jacobian() -> None:
    robot, frame = arm()
    q = np.random.default_rng(1).normal(size=robot.n)
    w = np.random.default_rng(2).uniform(0.5, 2, robot.n)
    J = robot.jacobian(q, frame)
    J[3:] *= 0.3
    m = manipulability(robot, q, frame, length=0.3, weights=w)
    np.testing.assert_allclose(m.sigma, np.linalg.svd(J * w, compute_uv=False), rtol=1e-12)
    angular = manipulability(robot, q, frame, "angular")
    np.testing.assert_allclose(angular.sigma, np.linalg.svd(robot.jacobian(q, frame)[3:], compute_uv=False), rtol=1e-12)


@pytest.mark.parametrize("part", ["linear", "angular", "xy", "both"])
def test_velocity_polytope_is_what_the_limits_allow(part: str) -> None:
    robot, frame = arm()
    rng = np.random.default_rng(0)
    q = rng.normal(size=robot.n)
    P = velocity_polytope(robot, q, frame, part)
    rows = {"linear": [0, 1, 2], "angular": [3, 4, 5], "xy": [0, 1], "both": list(range(6))}[part]
    J, limit = robot.jacobian(q, frame)[rows], robot.limits.velocity
    inside = (rng.uniform(-1, 1, (300, robot.n)) * limit) @ J.T
    assert P.contains(inside).all()
    assert P.contains(P.vertices, 1e-7).all()
    for _ in range(10):
        d = rng.normal(size=len(rows))
        d /= np.linalg.norm(d)
        # support of the vertices: every joint at the limit that helps
        assert np.isclose((P.vertices @ d).max(), (np.abs(d @ J) * limit).sum())
        # largest multiple of d that some q̇ within the limits reaches
        answer = linprog(
            [*np.zeros(robot.n), -1.0],
            A_eq=np.column_stack([J, -d]),
            b_eq=np.zeros(len(rows)),
            bounds=[*zip(-limit, limit), (0, None)],
        )
        assert np.isclose(P.reach(d), answer.x[-1], rtol=1e-7)


@pytest.mark.parametrize("gravity", [False, True])
def test_force_polytope_is_what_the_efforts_allow(gravity: bool) -> None:
    robot, frame = arm()
    strong = tuple(
        dataclasses.replace(j, limits=dataclasses.replace(j.limits, effort=200.0 + 10 * i))
        for i, j in enumerate(robot.description.joints)
    )
    robot = Robot(dataclasses.replace(robot.description, joints=strong), base=robot.base)
    rng = np.random.default_rng(0)
    q = rng.normal(size=robot.n)
    P = force_polytope(robot, q, frame, gravity=gravity)
    J = robot.jacobian(q, frame)[:3]
    F = rng.normal(size=(2000, 3)) * 200
    held = robot.gravity(q) if gravity else 0.0
    torques = F @ J + held
    load = np.abs(J).max(axis=0) > 1e-12
    allowed = (np.abs(torques[:, load]) <= robot.limits.effort[load]).all(axis=1)
    np.testing.assert_array_equal(P.contains(F), allowed)
    assert allowed.any()
    assert P.contains(P.vertices, 1e-6).all()
    d = np.array([0.0, 0.0, 1.0])
    assert (P.vertices @ d).max() >= P.reach(d) - 1e-9


def test_what_has_no_polytope_is_told() -> None:
    robot, frame = arm()
    q = np.zeros(robot.n)
    free = tuple(dataclasses.replace(j, limits=JointLimits(-3, 3)) for j in robot.description.joints)
    unlimited = Robot(dataclasses.replace(robot.description, joints=free))
    with pytest.raises(InputError, match="states no velocity limit"):
        velocity_polytope(unlimited, q, frame)
    with pytest.raises(InputError, match="states no effort limit"):
        force_polytope(unlimited, q, frame)
    with pytest.raises(InputError, match="a polytope belongs to one configuration"):
        velocity_polytope(robot, np.zeros((2, robot.n)), frame)
    with pytest.raises(InputError, match="a polytope belongs to one configuration"):
        force_polytope(robot, np.zeros((2, robot.n)), frame)
    weak = tuple(dataclasses.replace(j, limits=JointLimits(-3, 3, 1.0, 1.0, 1e-6)) for j in robot.description.joints)
    tired = Robot(dataclasses.replace(robot.description, joints=weak))
    with pytest.raises(InputError, match="cannot hold the robot: gravity asks for"):
        force_polytope(tired, q + 0.3, frame, gravity=True)
    flat = planar()
    limited = tuple(dataclasses.replace(j, limits=JointLimits(-3, 3, 1.0, 1.0, 1.0)) for j in flat.description.joints)
    flat = Robot(dataclasses.replace(flat.description, joints=limited))
    with pytest.raises(InputError, match="the velocity polytope of 'tool' is flat here"):
        velocity_polytope(flat, [0.3, 1.0], "tool")
    with pytest.raises(InputError, match="is unbounded here: some direction loads no joint"):
        force_polytope(flat, [0.3, 1.0], "tool")
    assert len(velocity_polytope(flat, [0.3, 1.0], "tool", "xy").vertices) == 4
    with pytest.raises(InputError, match="is not a direction in 2 dimensions"):
        velocity_polytope(flat, [0.3, 1.0], "tool", "xy").reach([0, 0])
    with pytest.raises(InputError, match="part is 'up'; expected one of 'linear'"):
        manipulability(robot, q, frame, "up")
    with pytest.raises(InputError, match="length is -1"):
        manipulability(robot, q, frame, length=-1.0)
    with pytest.raises(InputError, match="weights has the negative entry -1"):
        manipulability(robot, q, frame, weights=-np.ones(robot.n))
    with pytest.raises(InputError, match="lost directions differ in number over a batch"):
        manipulability(robot, np.zeros((2, robot.n)), frame).lost()


@pytest.mark.parametrize("part", ["linear", "angular", "xz"])
def test_pictures(part: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("matplotlib")
    robot, frame = arm()
    q = np.random.default_rng(0).normal(size=robot.n)
    kinds = ("velocity ellipsoid", "force ellipsoid", "velocity polytope", "force polytope")
    axes = draw(robot, q, frame, kinds, part)
    axes.figure.savefig(tmp_path / "shapes.png")
    assert (tmp_path / "shapes.png").stat().st_size > 5000
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert [label.split(", to ")[0] for label in labels] == list(kinds)
    sigma = manipulability(robot, q, frame, part).sigma[0]
    unit = "rad/s" if part == "angular" else "m/s"
    assert labels[0].endswith(f"to {sigma:.3g} {unit}")
    with pytest.raises(InputError, match="kinds is 'sphere'"):
        draw(robot, q, frame, ("sphere",))
    with pytest.raises(InputError, match="a picture shows one configuration"):
        draw(robot, np.zeros((2, robot.n)), frame)
    with pytest.raises(InputError, match="unbounded here: 1 lost direction"):
        draw(planar(), [0.0, 0.0], "tool", ("force ellipsoid",), "xy", axes=axes)


def test_pictures_without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    robot, frame = arm()
    with pytest.raises(MissingDependencyError, match=r"pip install 'apprehend\[plot\]'"):
        draw(robot, np.zeros(robot.n), frame)
