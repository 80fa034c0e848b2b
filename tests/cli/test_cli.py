"""The command line as a person meets it: it works, it speaks JSON, and mistakes are one paragraph and exit code 2."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 0.04) for y in (0, 0.04) for z in (0, 0.04)]
    + [f"f {a} {b} {c}" for a, b, c in (
        (1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5),
        (2, 6, 8), (2, 8, 4))]
)  # fmt: skip


def run(*args: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    program = "from apprehend.cli import main; main()"
    return subprocess.run([sys.executable, "-c", program, *args], capture_output=True, text=True, cwd=cwd, timeout=800)


def test_help_lists_the_commands() -> None:
    result = run("--help")
    assert result.returncode == 0
    assert "pick" in result.stdout
    assert "view" in result.stdout


def test_robots_lists_the_catalogue_and_describes_one() -> None:
    names = {entry["name"] for entry in json.loads(run("robots", "--json").stdout)}
    assert {"ur5e", "robotiq_2f_85", "panda"} <= names
    told = run("robots", "ur5e", "--frame", "tool0").stdout
    assert "shoulder_pan_joint: revolute" in told
    assert "DH table to tool0 (standard" in told


def test_forward_and_inverse_kinematics_agree() -> None:
    q = "0.3,-1.2,1.4,-1.0,-1.5,0.2"
    T = json.loads(run("fk", "ur5e", "tool0", "--q", q, "--json").stdout)["tool0"]
    xyz = ",".join(repr(T[i][3]) for i in range(3))
    rpy = run("fk", "ur5e", "tool0", "--q", q).stdout.splitlines()[1].split()[4:]
    result = run("ik", "ur5e", "tool0", "--xyz", xyz, "--rpy", ",".join(rpy), "--n", "20", "--json")
    assert result.returncode == 0
    answers = json.loads(result.stdout)["q"]
    wanted = [float(v) for v in q.split(",")]
    assert min(max(abs(a - b) for a, b in zip(answer, wanted, strict=True)) for answer in answers) < 1e-4


def test_the_jacobian_has_full_rank_away_from_singularities() -> None:
    J = json.loads(run("jacobian", "ur5e", "tool0", "--json").stdout)
    assert len(J["jacobian"]) == 6
    assert min(J["singular_values"]) > 0.1


def test_inverse_kinematics_out_of_reach_is_exit_code_one() -> None:
    result = run("ik", "ur5e", "tool0", "--xyz", "2,0,0")
    assert result.returncode == 1
    assert "no joint vector reaches the target" in result.stdout


def test_picking_a_mesh_writes_the_episode_and_the_report(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE)
    result = run("pick", "cube.obj", "--mass", "0.1", "--seed", "1", "--out", "out", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    data = json.loads(result.stdout)
    assert data["verdict"]["success"] is True
    assert (tmp_path / "out" / "episode.json").exists()
    report = (tmp_path / "out" / "report.html").read_text()
    assert "<html" in report
    assert "http://" not in report.replace("http://www.w3.org/", "")
    assert "https://" not in report


def test_a_mesh_with_a_hole_is_repaired_and_the_repair_is_told(tmp_path: Path) -> None:
    (tmp_path / "holed.obj").write_text(CUBE.rsplit("\n", 1)[0])
    result = run("pick", "holed.obj", "--mass", "0.1", "--seed", "1", cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    told = [line for line in result.stdout.splitlines() if line.startswith("repaired") and "holed" in line]
    assert told


NAN = CUBE.replace("v 0 0 0.04", "v 0 nan 0.04")
BIG = "\n".join(
    "v " + " ".join(str(float(x) * 2250) for x in line.split()[1:]) if line.startswith("v") else line
    for line in CUBE.splitlines()
)
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><robot name="x"><link name="&b;"/></robot>'

MISTAKES = {
    "missing mesh": (["pick", "nothing.obj"], "nothing.obj"),
    "unknown household object": (["pick", "mugg"], "Did you mean 'mug'"),
    "unknown robot": (["pick", "mug", "--robot", "ur5ee"], "ur5e"),
    "unknown hand": (["pick", "mug", "--hand", "robotiq_2f_58"], "robotiq_2f_85"),
    "zero mass": (["pick", "cube.obj", "--mass", "0"], "mass"),
    "NaN mass": (["pick", "cube.obj", "--mass", "nan"], "mass"),
    "negative friction": (["pick", "cube.obj", "--friction", "-1"], "friction"),
    "NaN in the mesh": (["pick", "nan.obj"], "nan.obj"),
    "millimetres": (["pick", "big.obj"], "mm"),
    "wrong kind of file": (["pick", "robot.urdf"], ".toml"),
    "malformed scene": (["pick", "bad.toml"], "bad.toml"),
    "unknown key": (["pick", "key.toml"], "Did you mean 'robot'"),
    "hostile XML": (["pick", "mug", "--robot", "bomb.urdf"], "bomb.urdf"),
    "malformed XML": (["pick", "mug", "--robot", "broken.urdf"], "broken.urdf"),
    "two descriptions": (["pick", "key.toml", "--robot", "panda"], "--robot"),
    "unknown frame": (["fk", "ur5e", "tol0"], "Did you mean 'tool0'"),
    "too few joints": (["fk", "ur5e", "--q", "1,2"], "has 2 numbers; expected 6"),
    "words for numbers": (["ik", "ur5e", "tool0", "--xyz", "a,b,c"], "--xyz is 'a,b,c'"),
    "no episode": (["view", "out"], "out"),
    "unknown model": (["view", "mug", "--as", "spherez", "--picture", "x.png"], "Did you mean 'spheres'"),
    "a figure on a page": (["view", "mug", "--as", "section"], "give --picture or --save"),
    "voxels too fine": (["view", "mug", "--as", "voxels", "--resolution", "1e-6", "--save", "v.npz"], "grid points"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_are_one_paragraph(case: str, tmp_path: Path) -> None:
    args, expected = MISTAKES[case]
    files = {
        "cube.obj": CUBE, "nan.obj": NAN, "big.obj": BIG, "bad.toml": "[robot\n", "key.toml": '[robbot]\narm="ur5e"\n',
        "bomb.urdf": BOMB, "broken.urdf": "<robot><link></robot>", "robot.urdf": "<robot/>",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "out").mkdir()
    result = run(*args, *(["--out", "new"] if args[0] == "pick" else []), cwd=tmp_path)
    assert result.returncode == 2, result.stdout + result.stderr
    assert result.stderr.startswith("error: ")
    assert expected in result.stderr
    assert "Traceback" not in result.stderr
    assert "\n\n" not in result.stderr.strip()
    assert not (tmp_path / "new").exists()


def test_view_writes_models_and_pictures(tmp_path: Path) -> None:
    told = run(
        "view", "mug", "--as", "boxes", "--count", "3", "--save", "mug.npz", "--picture", "mug.png", cwd=tmp_path
    )
    assert told.returncode == 0, told.stderr
    assert "3 boxes of mug: encloses it, sticks out by at most" in told.stdout
    assert (tmp_path / "mug.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "mug.npz").exists()
    told = run("view", "mug", "--as", "section", "--save", "mug.svg", cwd=tmp_path)
    assert "section of mug: " in told.stdout
    assert (tmp_path / "mug.svg").read_text().startswith("<svg")
    told = run("view", "ur5e", "--as", "spheres", "--count", "4", "--save", "ur5e.urdf", cwd=tmp_path)
    assert "spheres: encloses it" in told.stdout
    assert "<sphere" in (tmp_path / "ur5e.urdf").read_text()


def test_wrong_options_are_explained() -> None:
    result = run("pick", "--sed", "1")
    assert result.returncode == 2
    assert "--sed" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_failed_pick_is_exit_code_one(tmp_path: Path) -> None:
    crate = "\n".join(
        "v " + " ".join(str(float(x) * 5) for x in line.split()[1:]) if line.startswith("v") else line
        for line in CUBE.splitlines()
    )
    (tmp_path / "crate.obj").write_text(crate)
    result = run("pick", "crate.obj", "--mass", "1", cwd=tmp_path)
    assert result.returncode == 1
    assert "failed" in result.stdout


def test_a_reachability_map_is_built_kept_and_asked(tmp_path: Path) -> None:
    out, picture = tmp_path / "ur5e.reach", tmp_path / "ur5e.png"
    options = ("reach", "ur5e", "tool0", "--resolution", "0.1", "--angle", "60", "--out", str(out), "--json")
    near = run(*options, "--xyz", "0.4,0.1,0.4", "--rpy", "180,0,0", "--deg")
    assert near.returncode == 0, near.stderr
    facts = json.loads(near.stdout)
    assert facts["reachable"]
    assert facts["agreement"] > 0.8
    assert facts["coverage"] > 0.95
    far = run(*options, "--xyz", "3,0,0", "--picture", str(picture))
    assert far.returncode == 1
    assert json.loads(far.stdout)["samples"] == facts["samples"]  # it went on from the file, and had nothing to add
    wrong = run("reach", "ur5e", "tool")
    assert wrong.returncode == 2
    assert "Did you mean" in wrong.stderr


def test_a_mesh_in_millimetres_is_said_in_words_of_the_command_line(tmp_path: Path) -> None:
    part = tmp_path / "part.obj"
    part.write_text(CUBE.replace("0.04", "40"))
    result = run("view", str(part), "--as", "boxes", "--save", str(tmp_path / "boxes.npz"))
    assert result.returncode == 2
    assert "--units mm" in result.stderr
    result = run("view", str(part), "--units", "mm", "--as", "boxes", "--save", str(tmp_path / "boxes.npz"))
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "boxes.npz").is_file()


def test_a_scene_is_drawn(tmp_path: Path) -> None:
    scene = tmp_path / "cell.toml"
    scene.write_text('[robot]\narm = "ur5e"\n[[box]]\nname = "t"\nsize = [1, 1, 0.1]\npose = {xyz = [1, 0, 0]}\n')
    result = run("view", str(scene), "--picture", str(tmp_path / "cell.png"))
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "cell.png").read_bytes().startswith(b"\x89PNG")
    assert "--as shows models of one body" in run("view", str(scene), "--as", "boxes").stderr


def test_exit_codes_and_units_are_in_the_help() -> None:
    told = " ".join(run("plan", "--help").stdout.replace("│", " ").split())
    assert "Exit code 0: a path, checked; 1: there is none" in told
    assert "roll,pitch,yaw in rad" in told
    assert "[default: (as at the start)]" in told


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("fk ur5e --q nan,0,0,0,0,0", "is 'nan,0,0,0,0,0'; expected 6 finite numbers"),
        ("jacobian ur5e tool0 --picture x.nope", "--picture is x.nope; expected a name that ends in .png or .svg or"),
        ("ik ur5e tool0 --xyz 0.4,0.2,0.4 --picture none/x.png", "but there is no folder"),
        ("ik ur5e tool0 --xyz 0.4,0.2,0.4 --near 1", "--near (joints shoulder_pan_joint"),
        ("reach ur5e tool0 --picture x.nope", "expected a name that ends in"),
        ("reach ur5e tool0 --rpy 1,2,3", "give --xyz"),
        ("plan ur5e --goal home --rpy 1,2,3", "give --xyz"),
        ("trajectory w.csv --velocity 1 --acceleration 1 --deviation 1", "give --straight"),
        ("trajectory w.csv --velocity 1 --acceleration 1 --dt 1e-12 --out x.csv", "choose a larger dt"),
        ("grasp plan robotiq_2f_85 nothing", "no household body named 'nothing'"),
        ("pick mug --out w.csv", "give a directory"),
        ("view mug --units mm --picture x.png", "--units goes with a mesh file"),
    ],
)
def test_mistakes_are_found_before_anything_is_computed(
    line: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from apprehend.cli import main

    (tmp_path / "w.csv").write_text("0,0\n1,1\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["apprehend", *line.split()])
    with pytest.raises(SystemExit) as stop:
        main()
    said = capsys.readouterr()
    assert stop.value.code == 2, said
    assert message in " ".join(said.err.split())
    assert not list(tmp_path.glob("x.*"))
