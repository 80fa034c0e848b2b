"""DH tables and twists: against published values, against forward kinematics, and their derivation from any chain."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apprehend.errors import DescriptionError, InputError
from apprehend.kinematics import Robot, dh_table
from apprehend.robots import (
    DHChain,
    JointType,
    catalogue,
    load_description,
    read_dh,
    read_table,
)
from apprehend.robots.poses import from_rpy
from tests.robots.build import write
from tests.support import reference

RNG = np.random.default_rng(3)


def table_of(case: Any) -> DHChain:
    links = case["links"]
    types = tuple(JointType.PRISMATIC if row["sigma"] else JointType.REVOLUTE for row in links)
    column = {key: np.array([row[key] for row in links]) for key in ("theta", "d", "a", "alpha", "offset")}
    slides = np.array([t is JointType.PRISMATIC for t in types])
    return DHChain(
        case["dh"], tuple(f"q{i}" for i in range(len(links))), types,
        column["theta"] + np.where(slides, 0.0, column["offset"]),
        column["d"] + np.where(slides, column["offset"], 0.0),
        column["a"], column["alpha"], np.array(case["base"]), np.array(case["tool"]), tuple(r["flip"] for r in links),
    )  # fmt: skip


def test_published_tables() -> None:
    for case in reference("kin_rtb_dh_robots.json")["cases"]:
        table, q = table_of(case["inputs"]), np.array(case["inputs"]["q"])
        expected = case["expected"]
        assert np.abs(table.fk(q) - expected["fkine"]).max() < 1e-12
        robot_ = Robot(table.description())
        tool = robot_.description.tool
        assert np.abs(robot_.fk(q, tool) - expected["fkine"]).max() < 1e-12
        assert np.abs(robot_.jacobian(q, tool) - expected["jacob0"]).max() < 1e-12
        assert np.abs(robot_.jacobian(q, tool, "body") - expected["jacobe"]).max() < 1e-12
        for i, T in enumerate(expected["fkine_all"][1:]):
            assert np.abs(robot_.fk(q, f"link{i + 1}") - T).max() < 1e-12


def test_armar1() -> None:
    data = reference("kin_armar1.json")
    armar = Robot.load("armar1")
    for case in data["cases"]:
        q, expected = np.array(case["inputs"]["q"]), case["expected"]
        assert np.abs(armar.fk(q, "link7") - expected["T"]).max() < 1e-12


def test_planar_arm_is_the_closed_form() -> None:
    arm = Robot.load("planar_3r")
    q = RNG.uniform(-3, 3, (20, 3))
    s = np.cumsum(q, axis=1)
    T = arm.fk(q, "link3")
    lengths = np.array([0.4, 0.3, 0.2])
    assert np.allclose(T[:, 0, 3], np.cos(s) @ lengths, atol=1e-14)
    assert np.allclose(T[:, 1, 3], np.sin(s) @ lengths, atol=1e-14)
    assert np.allclose(T[:, 0, 0], np.cos(s[:, 2]), atol=1e-14)


def test_second_example_of_script_k() -> None:
    arm = Robot.load("spatial_rrp")
    for q1, q2, d3 in RNG.uniform(-2, 2, (10, 3)):
        c1, s1, c2, s2, d2 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2), 0.2
        expected = [
            [c1 * c2, -s1, c1 * s2, c1 * s2 * d3 - s1 * d2],
            [s1 * c2, c1, s1 * s2, s1 * s2 * d3 + c1 * d2],
            [-s2, 0, c2, c2 * d3],
            [0, 0, 0, 1],
        ]
        assert np.allclose(arm.fk([q1, q2, d3], "link3"), expected, atol=1e-14)


def test_scara_is_the_closed_form_of_script_g() -> None:
    arm = Robot.load("scara")
    l0, l1, l2 = 0.4, 0.35, 0.3
    for q in RNG.uniform(-2, 2, (10, 4)):
        a, ab, abc = q[0], q[0] + q[1], q[0] + q[1] + q[2]
        p = [-l1 * math.sin(a) - l2 * math.sin(ab), l1 * math.cos(a) + l2 * math.cos(ab), l0 + q[3]]
        T = arm.fk(q, "tool")
        assert np.allclose(T[:3, 3], p, atol=1e-14)
        assert np.allclose(T[:2, 0], [math.cos(abc), math.sin(abc)], atol=1e-14)


def test_panda_by_its_published_table_is_the_panda_by_urdf() -> None:
    if not catalogue.entry("panda").installed:
        pytest.skip("the extra [robots] is not installed")
    urdf, table = Robot.load("panda_arm"), Robot.load("panda_dh")
    q = RNG.uniform(-2, 2, (20, 7))
    assert np.abs(urdf.fk(q, "panda_link8") - table.fk(q, "tool")).max() < 1e-12
    assert np.array_equal(urdf.limits.acceleration, table.limits.acceleration)


# ---- the table of a chain, written as a chain of its own


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("name", [e.name for e in catalogue.entries().values() if e.installed and e.kind != "legged"])
def test_every_chain_of_the_catalogue(name: str, convention: str) -> None:
    robot = Robot.load(name)
    description = robot.description
    leaves = sorted(description.links.keys() - {j.parent for j in description.joints})
    q = RNG.uniform(-1.5, 1.5, (3, robot.n))
    full = {n: q[:, i] for i, n in enumerate(robot.joint_names)}
    for j in description.joints:
        if j.mimic:
            full[j.name] = j.mimic.multiplier * full[j.mimic.joint] + j.mimic.offset
    for leaf in leaves[:6]:
        if not robot.chain(leaf):
            continue
        table = dh_table(robot, leaf)
        chain = (table if convention == "standard" else table.modified()).chain(robot)
        rows = np.stack([full[n] for n in chain.names], axis=-1)
        size = 1.0 + np.abs(chain.d).max()  # almost parallel axes meet far away
        expected = robot.fk(q, leaf)
        assert np.abs(chain.fk(rows) - expected).max() < 1e-12 * size
        alone = Robot(chain.description())
        assert np.abs(alone.fk(rows, alone.description.tool) - expected).max() < 1e-12 * size


def test_a_table_prints_as_a_person_writes_it() -> None:
    text = str(read_dh(catalogue.entry("armar1").file()))
    assert "DH table, standard convention" in text
    assert "a [mm]" in text
    row = text.splitlines()[4].split()
    assert row == ["joint3", "revolute", "0", "90", "223.5", "90+q"]
    puma = Robot.load("puma560")
    assert "a(i−1) [mm]" in str(dh_table(puma, "link6").modified().chain(puma))


# ---- files


DH = 'kind = "dh"\nconvention = "standard"\n'
TWISTS = 'kind = "twists"\nhome = { xyz = [0, 0, 1] }\n'


def test_units_offsets_and_poses(tmp_path: Path) -> None:
    text = (
        DH
        + """name = "arm"
units = { length = "mm", angle = "deg" }
columns = ["alpha", "a", "d", "theta", "name", "type", "lower", "upper", "home", "velocity", "effort", "flip"]
rows = [[90, 100, 200, 45, "one", "revolute", -90, 90, 30, 180, 5, false],
        [0, 0, 0, 0, "two", "prismatic", 0, 500, 100, 1000, 7, true]]
base = { xyz = [0, 0, 1000], rpy = [0, 0, 90] }
tool = [[1, 0, 0, 50], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
"""
    )
    d = load_description(write(tmp_path, text, "arm.toml"))
    one, two = d.joint("one"), d.joint("two")
    assert one.limits.upper == pytest.approx(math.pi / 2)
    assert one.limits.velocity == pytest.approx(math.pi)
    assert (two.limits.upper, two.limits.velocity, two.limits.effort) == (0.5, 1.0, 7.0)
    assert d.home == pytest.approx({"one": math.radians(30), "two": 0.1})
    arm = Robot(d)
    T = arm.fk([0.0, 0.1], "tool")  # base turned by 90°, joint at 45°; the sliding joint is flipped
    c = math.sqrt(0.5)
    assert np.allclose(T[:3, 3], [-c * 0.15 - c * 0.1, c * 0.15 - c * 0.1, 1.2], atol=1e-12)
    assert d.root == "world"


def test_inertia_of_a_row(tmp_path: Path) -> None:
    text = (
        DH
        + "[[joint]]\ntheta = 0\nd = 0\na = 1\nalpha = 0\nmass = 2\ncom = [-0.5, 0, 0]\n"
        + "inertia = [1, 2, 3, 0.1, 0, 0]\n"
    )
    path = write(tmp_path, text, "a.toml")
    inertial = read_table(path).links["link1"].inertial
    assert inertial is not None
    assert (inertial.mass, inertial.com[0], inertial.inertia[0, 1]) == (2, -0.5, 0.1)
    bad = write(tmp_path, text.replace("1, 2, 3", "1, 1, 3"), "b.toml")
    with pytest.raises(DescriptionError, match="joint 'joint1': impossible inertia"):
        load_description(bad, inertias="refuse")
    assert "took the nearest" in str(load_description(bad).repairs[0])
    assert "kept it, as asked" in str(load_description(bad, inertias="keep").repairs[0])


def test_puma_keeps_its_published_inertias_and_says_so() -> None:
    d = load_description("puma560")
    assert d.links["link3"].inertial.inertia[1, 1] == 0.086  # type: ignore[union-attr]
    assert "joint 'joint3': impossible inertia" in "\n".join(map(str, d.repairs))


@pytest.mark.parametrize("frame", ["base", "body"])
def test_twists_are_the_product_of_exponentials(tmp_path: Path, frame: str) -> None:
    from scipy.linalg import expm

    home = from_rpy((0.3, -0.2, 0.5), (0.4, -0.3, 0.9))
    twists = []
    for w, p in zip(np.eye(3)[[2, 0, 1]], RNG.normal(size=(3, 3)), strict=True):
        twists.append(np.concatenate([-np.cross(w, p), w]))
    twists.append(np.concatenate([np.array([0.6, 0, 0.8]), np.zeros(3)]))
    lines = "".join(f"[[joint]]\nv = {t[:3].tolist()}\nw = {t[3:].tolist()}\n" for t in twists)
    matrix = [list(map(float, row)) for row in home]
    text = f'kind = "twists"\nframe = "{frame}"\nhome = {matrix}\n{lines}'
    arm = Robot.load(write(tmp_path, text, "t.toml"))
    q = np.array([0.3, -1.2, 2.0, 0.1])
    T = np.eye(4) if frame == "base" else home
    for t, value in zip(twists, q, strict=True):
        x, y, z = t[3:]
        M = np.zeros((4, 4))
        M[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        M[:3, 3] = t[:3]
        T = T @ expm(M * value)
    expected = T @ home if frame == "base" else T
    assert np.abs(arm.fk(q, "tool") - expected).max() < 1e-13


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kind = ", "not TOML"),
        ('kind = "poe"', "kind is 'poe'; expected 'dh' or 'twists'"),
        ('kind = "dh"', "the file lacks 'convention'"),
        ('kind = "dh"\nconvention = "craig"', "convention is 'craig'; expected one of 'standard', 'modified'"),
        (DH, r"needs columns = \[...\] and rows"),
        (DH + 'column = ["a"]', r"the file: 'column' is unknown; .* Did you mean 'columns'"),
        (DH + 'columns = ["theta", "d", "a"]\nrows = []', r"columns .* lack 'alpha'; a row needs theta, d, a, alpha"),
        (DH + 'columns = ["theta", "d", "a", "alpha", "lowr"]\nrows = []', r"column 'lowr' is unknown.*mean 'lower'"),
        (DH + 'columns = ["theta", "d", "a", "alpha", "d"]\nrows = []', "name one twice"),
        (DH + 'columns = ["theta", "d", "a", "alpha"]\nrows = [[1, 2, 3]]', r"row 1 is \[1, 2, 3\]; expected 4 values"),
        (
            DH + 'columns = ["theta", "d", "a", "alpha"]\nrows = [[1, 2, "x", 0]]',
            "joint 'joint1': a is 'x'; expected a",
        ),
        (DH + 'columns = ["theta", "d", "a", "alpha"]\nrows = [[1, 2, nan, 0]]', "a is nan; expected a finite number"),
        (DH + 'columns = ["theta", "d", "a", "alpha"]\nrows = []', "there is no joint; a chain needs at least one"),
        (
            DH + 'columns = ["theta", "d", "a", "alpha", "name"]\nrows = [[0, 0, 0, 0, "x"], [0, 0, 0, 0, "x"]]',
            "two joints are named 'x'",
        ),
        (
            DH + 'columns = ["theta", "d", "a", "alpha", "type"]\nrows = [[0, 0, 0, 0, "ball"]]',
            "joint 'joint1': type is 'ball'; expected one of 'revolute', 'prismatic', 'continuous'",
        ),
        (
            DH + 'columns = ["theta", "d", "a", "alpha", "lower", "upper"]\nrows = [[0, 0, 0, 0, 1, 0]]',
            "limits reversed: lower=1 is above upper=0",
        ),
        (
            DH + 'columns = ["theta", "d", "a", "alpha", "flip"]\nrows = [[0, 0, 0, 0, 1]]',
            "flip is 1; expected true or",
        ),
        (DH + 'columns = ["theta", "d", "a", "alpha", "mass"]\nrows = [[0, 0, 0, 0, -1]]', "mass is -1 kg"),
        (DH + "[[joint]]\ntheta = 0\n", "joint 1 lacks 'd'; it needs theta, d, a, alpha"),
        (DH + "joint = 3\n", r"joint is not a list of tables; write \[\[joint\]\]"),
        (DH + "columns = []\n[[joint]]\ntheta = 0\nd = 0\na = 0\nalpha = 0", "has both"),
        (DH + "[[joint]]\ntheta = 0\nd = 0\na = 0\nalpha = 0\ncom = [0, 0, 0]", "has com or inertia but no mass"),
        (DH + 'units = { length = "inch" }', "units.length is 'inch'; expected one of 'm', 'mm', 'cm'"),
        (
            DH + 'base = { xy = [0] }\ncolumns = ["theta", "d", "a", "alpha"]\nrows = [[0, 0, 0, 0]]',
            "base: 'xy' is unk",
        ),
        (
            DH + "tool = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
            'columns = ["theta", "d", "a", "alpha"]\nrows = [[0, 0, 0, 0]]',
            "tool is not a homogeneous transform with a rotation",
        ),
        ('kind = "twists"\n[[joint]]\nv = [0, 0, 0]\nw = [0, 0, 1]', "the file lacks 'home'"),
        (TWISTS + "[[joint]]\nv = [0, 0]\nw = [0, 0, 1]", r"joint 'joint1': v is \[0, 0\]; expected 3 numbers"),
        (TWISTS + "[[joint]]\nv = [0, 0, 0]\nw = [0, 0, 0]", "v and w are both zero; expected a twist"),
        (TWISTS + "[[joint]]\nv = [0, 0, 0]\nw = [0, 0, 2]", "w has length 2; expected 1"),
        (TWISTS + "[[joint]]\nv = [0, 0, 2]\nw = [0, 0, 0]", "v has length 2; a translation needs length 1"),
        (TWISTS + "[[joint]]\nv = [0, 0, 0.1]\nw = [0, 0, 1]", "v · w is 0.1: a helical joint"),
        (TWISTS + '[[joint]]\nv = [0, 0, 1]\nw = [0, 0, 0]\ntype = "revolute"', "is revolute, but its w is zero"),
        (TWISTS + '[[joint]]\nv = [0, 0, 0]\nw = [0, 0, 1]\ntype = "prismatic"', "is prismatic, but its w is not zero"),
        (TWISTS + 'frame = "tool"\n[[joint]]\nv = [0, 0, 0]\nw = [0, 0, 1]', "frame is 'tool'; expected one of 'base'"),
    ],
)
def test_mistakes_in_tables(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=said) as caught:
        load_description(write(tmp_path, text, "t.toml"))
    assert "t.toml" in str(caught.value)


def test_mistakes_in_calls() -> None:
    with pytest.raises(InputError, match="alpha has 2 entries; expected 1, one for each joint"):
        DHChain("standard", ("q",), (JointType.REVOLUTE,), np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(2))
    with pytest.raises(InputError, match=r"q has shape \(5,\); expected \(\.\.\., 7\)"):
        read_dh(catalogue.entry("armar1").file()).fk(np.zeros(5))
    with pytest.raises(DescriptionError, match="kind is 'twists'; expected 'dh'"):
        read_dh(catalogue.entry("scara").file())
