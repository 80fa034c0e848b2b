"""Contacts from files, pictures, and the commands on top."""

import json
import sys

import numpy as np
import pytest

from apprehend.cli import main
from apprehend.errors import InputError
from apprehend.grasp import Contact, Grasp, read_grasp, save_picture

PAIR = {
    "contacts": [
        {"position": [0.05, 0, 0], "normal": [-1, 0, 0], "model": "soft", "torsion": 0.01, "friction": 0.5},
        {"position": [-0.05, 0, 0], "normal": [1, 0, 0], "model": "soft", "torsion": 0.01, "friction": 0.5},
    ],
    "length": 0.05,
}


def written(tmp_path, data, name="grasp.json"):
    path = tmp_path / name
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def test_json_and_csv_say_the_same(tmp_path):
    table = "x,y,z,nx,ny,nz,friction,model,torsion\n0.05,0,0,-2,0,0,0.5,soft,0.01\n-0.05,0,0,1,0,0,,,\n"
    a = read_grasp(written(tmp_path, PAIR))
    b = read_grasp(written(tmp_path, table, "grasp.csv"), friction=0.5, model="soft", torsion=0.01)
    np.testing.assert_allclose(a.matrix, b.matrix)
    assert a.length == 0.05
    assert [c.model for c in a.contacts] == [c.model for c in b.contacts]


def test_a_body_beside_the_file_gives_reference_and_length(tmp_path):
    import apprehend as ap

    body = ap.Body.box((0.1, 0.06, 0.04), mass=0.2)
    body.save(tmp_path / "box.obj")
    grasp = read_grasp(written(tmp_path, {**PAIR, "length": None, "body": "box.obj", "mass": 0.2}))
    assert grasp.length == pytest.approx(body.radius)


@pytest.mark.parametrize(
    ("data", "name", "message"),
    [
        ("{", "a.json", r"a\.json:1: not JSON"),
        ("[]", "a.json", 'list "contacts"'),
        ({"contacts": [{"position": [0, 0, 0]}]}, "a.json", 'contact 0: expected an object with "position"'),
        ({"contacts": [{**PAIR["contacts"][0], "mu": 1}]}, "a.json", "unknown field 'mu'"),
        ({"contacts": [{**PAIR["contacts"][0], "friction": -1}]}, "a.json", "contact 0: contact friction is -1"),
        ({"contacts": [{**PAIR["contacts"][0], "normal": "up"}]}, "a.json", "contact 0: "),
        ("x,y,z\n1,2,3\n", "a.csv", "no column nx, ny, nz"),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0,one\n", "a.csv", r"a\.csv:2: could not convert"),
        ("x", "a.txt", r"neither \.json nor \.csv"),
    ],
)
def test_bad_files_are_named(tmp_path, data, name, message):
    with pytest.raises(InputError, match=message):
        read_grasp(written(tmp_path, data, name))


def test_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_grasp(tmp_path / "nowhere.json")


def test_picture(tmp_path):
    pytest.importorskip("matplotlib")
    grasp = read_grasp(written(tmp_path, PAIR))
    forces = grasp.contact_forces([0, 0, -1.0, 0, 0, 0]).forces
    path = save_picture(grasp, tmp_path / "grasp.png", forces)
    assert path.read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(InputError, match="not a picture's name"):
        save_picture(grasp, tmp_path / "grasp.txt")
    with pytest.raises(InputError, match="forces has shape"):
        save_picture(grasp, tmp_path / "grasp.png", forces[:3])
    flat = Grasp([Contact(np.array([x, 0.0]), np.array([-x, 0.0]), 0.5) for x in (1.0, -1.0)])
    path = save_picture(flat, tmp_path / "flat.svg", flat.contact_forces([0, -1.0, 0]).forces)
    assert b"wrench space" in path.read_bytes() or path.stat().st_size > 10_000


@pytest.fixture
def apprehend(monkeypatch, capsys):
    """Run a command in this process: exit code, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["apprehend", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        shown = capsys.readouterr()
        return int(stopped.value.code or 0), shown.out, shown.err

    return call


def test_commands(tmp_path, apprehend):
    path = written(tmp_path, PAIR)
    code, out, error = apprehend("grasp", "check", path, "--json")
    assert code == 0, error
    answer = json.loads(out)
    assert answer["force_closure"]["closed"]
    assert not answer["form_closure"]["closed"]
    assert "force closure" in apprehend("grasp", "check", path)[1]
    code, out, _ = apprehend("forces", path, "--wrench", "0,0,-10,0,0,0", "--json")
    assert code == 0
    assert json.loads(out)["value"] == pytest.approx(20.0)
    assert "friction cone of contact 0" in apprehend("forces", path, "--wrench", "0,0,-10,0,0,0")[1]
    code, out, _ = apprehend("forces", path, "--wrench", "0,0,-10,0,0,0", "--normal", "5")
    assert code == 1
    assert "no contact forces" in out
    code, _, error = apprehend("forces", path, "--wrench", "up")
    assert code == 2
    assert "--wrench 'up' is not a list" in error
    frictionless = written(tmp_path, {"contacts": [{**c, "friction": 0} for c in PAIR["contacts"]]}, "smooth.json")
    assert apprehend("grasp", "check", frictionless)[0] == 1


def test_commands_on_a_simulated_model(tmp_path, apprehend):
    from tests.sim.test_grasps import VICE

    path = written(tmp_path, VICE.format(dim=4), "vice.xml")
    code, out, error = apprehend("grasp", "check", path, "--body", "thing", "--json")
    assert code == 0, error
    answer = json.loads(out)
    assert answer["contacts"] == 2
    assert answer["quality"]["contacts may be off by (m)"]["upper"] is None
    assert "antipodal" in apprehend("grasp", "check", path, "--body", "thing")[1]
    code, out, _ = apprehend("forces", path, "--body", "thing", "--wrench", "0,0,-3,0,0,0", "--json")
    assert code == 0
    assert json.loads(out)["value"] > 0.0
    one = apprehend("grasp", "check", path, "--body", "thing", "--by", "left")
    assert one[0] == 1
    assert "wrench not resisted" in one[1]
    for arguments, message in (
        ((), "say which is held with --body"),
        (("--body", "thong"), "Did you mean 'thing'"),
        (("--body", "thing", "--time", "0"), "nothing touches 'thing'"),
    ):
        code, _, error = apprehend("grasp", "check", path, *arguments)
        assert code == 2
        assert message in error
    code, _, error = apprehend("forces", path, "--body", "thing", "--wrench", "1,2")
    assert code == 2
    assert "--wrench has 2 numbers; expected 6" in error
    code, _, error = apprehend("grasp", "check", written(tmp_path, PAIR), "--body", "thing")
    assert code == 2
    assert "is no .xml" in error


@pytest.mark.parametrize("hand", ["panda_hand", "allegro_right"])
def test_planning_on_the_command_line(tmp_path, apprehend, hand):
    code, out, error = apprehend("grasp", "plan", hand, "can", "--n", "2", "--json")
    assert code == 0, error
    answer = json.loads(out)
    assert 1 <= len(answer["grasps"]) <= 2
    first = answer["grasps"][0]
    assert ("q" in first) == (hand == "allegro_right")
    again = read_grasp(written(tmp_path, {"contacts": first["contacts"]}, "one.json"))
    assert again.force_closure().success
    code, out, _ = apprehend("grasp", "plan", hand, "can", "--n", "1")
    assert code == 0
    assert "1 grasps" in out


def test_no_grasp_on_the_command_line(apprehend):
    code, out, _ = apprehend("grasp", "plan", "panda_hand", "can", "--friction", "0.001")
    assert code == 1
    assert "'panda_hand' on 'can'" in out
