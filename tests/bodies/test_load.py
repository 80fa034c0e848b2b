"""Files from strangers are read whole or refused with the place and the remedy."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from apprehend import Body
from apprehend.bodies import load, shapes
from apprehend.errors import InputError, MeshError

MUG = shapes.cylinder(0.045, 0.09)
SOUND = [
    data.encode()
    if isinstance(data := trimesh.Trimesh(*shapes.box([0.1, 0.1, 0.1])).export(file_type=kind[1:]), str)
    else data
    for kind in load.FORMATS
]


@pytest.mark.parametrize("ending", load.FORMATS)
def test_saved_and_loaded_again(tmp_path: Path, ending: str) -> None:
    body = Body.household("mug")
    again = Body.load(body.save(tmp_path / f"mug{ending}"), mass=body.mass)
    assert again.watertight
    assert again.name == "mug"
    assert again.volume == pytest.approx(body.volume, rel=1e-5)
    assert np.allclose(again.com, body.com, atol=1e-6)
    assert [p.name for p in tmp_path.iterdir()] == [f"mug{ending}"]


def test_obj_with_quads_materials_and_texture_coordinates(tmp_path: Path) -> None:
    vertices = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1))
    corners = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    quads = "".join("f " + " ".join(f"{c}/{k + 1}" for k, c in enumerate(quad)) + "\n" for quad in corners)
    uv = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    path = tmp_path / "cube.obj"
    path.write_text(f"mtllib ../../../etc/passwd\n{vertices}{uv}usemtl red\n{quads}")
    body = Body.load(path, density=1000.0)
    assert body.watertight
    assert len(body.vertices) == 8
    assert body.mass == pytest.approx(1.0)


@pytest.mark.parametrize("unit, factor", [("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254)])
def test_units(tmp_path: Path, unit: str, factor: float) -> None:
    path = Body.from_mesh(MUG[0] / factor, MUG[1]).save(tmp_path / "mug.ply")
    assert np.allclose(Body.load(path, units=unit).extents, [0.09, 0.09, 0.09], atol=1e-6)


def test_a_mug_of_90_metres_is_in_millimetres(tmp_path: Path) -> None:
    path = Body.from_mesh(MUG[0] * 1e3, MUG[1]).save(tmp_path / "mug.ply")
    with pytest.raises(
        MeshError, match=r"90 × 90 × 90 m large.*millimetres\? Pass units='mm' \(0\.09 × 0\.09 × 0\.09 m\)"
    ):
        Body.load(path)
    assert Body.load(path, units="m").extents[0] == pytest.approx(90.0)


def test_a_thing_of_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    path = Body.from_mesh(MUG[0] * 1e-3, MUG[1]).save(tmp_path / "mug.ply")
    with pytest.raises(MeshError, match=r"no object for a hand.*scaled twice\?"):
        Body.load(path)


def test_a_thing_of_many_kilometres(tmp_path: Path) -> None:
    path = Body.from_mesh(MUG[0] * 1e6, MUG[1]).save(tmp_path / "mug.ply")
    with pytest.raises(MeshError, match=r"no object for a hand.*re-export it in metres"):
        Body.load(path)


def test_unknown_unit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="units is 'furlong'; expected one of 'm', 'cm', 'mm', 'in'"):
        Body.load(tmp_path / "x.obj", units="furlong")


def test_missing_file_suggests_its_neighbours(tmp_path: Path) -> None:
    Body.from_mesh(*MUG).save(tmp_path / "mug.obj")
    with pytest.raises(MeshError, match=r"mgu\.obj does not exist\. Did you mean 'mug\.obj'\?"):
        Body.load(tmp_path / "mgu.obj")
    with pytest.raises(MeshError, match=r"Meshes in that folder: mug\.obj"):
        Body.load(tmp_path / "xyzzy.stl")
    with pytest.raises(MeshError, match="does not exist either"):
        Body.load(tmp_path / "nowhere" / "mug.obj")
    (tmp_path / "bare").mkdir()
    with pytest.raises(MeshError, match="There is no mesh in"):
        Body.load(tmp_path / "bare" / "mug.obj")


def test_folder_and_unknown_ending(tmp_path: Path) -> None:
    (tmp_path / "x.obj").mkdir()
    with pytest.raises(MeshError, match="is a folder"):
        Body.load(tmp_path / "x.obj")
    with pytest.raises(MeshError, match=r"'\.step' is not a mesh format; expected \.obj, \.stl, \.ply, \.glb"):
        Body.load(tmp_path / "x.step")
    with pytest.raises(MeshError, match="not a mesh format"):
        Body.from_mesh(*MUG).save(tmp_path / "x.step")


def test_too_large_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = Body.from_mesh(*MUG).save(tmp_path / "mug.obj")
    monkeypatch.setattr(load, "MAX_BYTES", 2**10)
    with pytest.raises(MeshError, match="decimate the mesh"):
        Body.load(path)


def test_too_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = Body.from_mesh(*MUG).save(tmp_path / "mug.obj")
    monkeypatch.setattr(load, "MAX_FACES", 10)
    with pytest.raises(MeshError, match=r"has 256 triangles; at most 10 are read"):
        Body.load(path)


@pytest.mark.parametrize("ending", load.FORMATS)
@pytest.mark.parametrize("data", [b"\x00\xff\x13 not a mesh \x80" * 20, b"solid nothing\nendsolid", b"ply\nformat"])
def test_garbage(tmp_path: Path, ending: str, data: bytes) -> None:
    path = tmp_path / f"bad{ending}"
    path.write_bytes(data)
    with pytest.raises(MeshError, match=r"bad\.\w+ (is not a readable|holds no triangles|: )"):
        Body.load(path)


@given(st.integers(0, 3), st.integers(0, 10_000))
def test_damaged_files_never_end_in_a_traceback(which: int, seed: int) -> None:
    """Bytes are overwritten, cut off or inserted: the answer is a body or a `MeshError`."""
    rng = np.random.default_rng(seed)
    data = bytearray(SOUND[which])
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(data)))
        change = rng.integers(3)
        if change == 0:
            data[at] = int(rng.integers(256))
        elif change == 1:
            del data[at : at + int(rng.integers(1, 40))]
        else:
            data[at:at] = rng.bytes(8)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"x{load.FORMATS[which]}"
        path.write_bytes(bytes(data))
        with contextlib.suppress(MeshError):
            load.read_mesh(path)


def test_a_glb_that_claims_a_billion_points(tmp_path: Path) -> None:
    header = b'{"asset":{"version":"2.0"},"accessors":[{"componentType":5126,"count":9000000000,"type":"VEC3"}]}'
    header += b" " * (-len(header) % 4)
    chunk = len(header).to_bytes(4, "little") + b"JSON" + header
    path = tmp_path / "bomb.glb"
    path.write_bytes(b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunk)).to_bytes(4, "little") + chunk)
    with pytest.raises(MeshError, match=r"claims 9000000000 elements in .* bytes: the file is damaged or hostile"):
        Body.load(path)


def test_empty_file(tmp_path: Path) -> None:
    path = tmp_path / "empty.obj"
    path.touch()
    with pytest.raises(MeshError, match=r"empty \(0 bytes\)"):
        Body.load(path)


def test_points_without_faces(tmp_path: Path) -> None:
    path = tmp_path / "cloud.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(MeshError, match="no triangles"):
        Body.load(path)


def test_nan_vertex_is_named(tmp_path: Path) -> None:
    path = tmp_path / "nan.obj"
    path.write_text("v 0 0 0\nv 0.1 0 0\nv 0 nan 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    with pytest.raises(MeshError, match=r"vertex \d+ is \[0\.0, nan, 0\.0\]; every coordinate must be finite"):
        Body.load(path)


def test_flat_and_collapsed_meshes() -> None:
    square = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]
    with pytest.raises(MeshError, match=r"sheet is flat \(extents 0\.1 × 0\.1 × 0 m\): a body needs a volume"):
        Body.from_mesh(square, [[0, 1, 2], [0, 2, 3]], name="sheet")
    with pytest.raises(MeshError, match="all vertices coincide"):
        Body.from_mesh(np.ones((3, 3)), [[0, 1, 2]])


def test_wrong_arrays() -> None:
    with pytest.raises(MeshError, match=r"vertices have shape \(4, 2\)"):
        Body.from_mesh(np.zeros((4, 2)), [[0, 1, 2]])
    with pytest.raises(MeshError, match=r"faces have shape \(1, 4\)"):
        Body.from_mesh(np.eye(4, 3), [[0, 1, 2, 3]])
    with pytest.raises(MeshError, match=r"face 1 is \[0, 1, 9\], but there are 4 vertices"):
        Body.from_mesh(np.eye(4, 3), [[0, 1, 2], [0, 1, 9]])
    with pytest.raises(MeshError, match="expected integers"):
        Body.from_mesh(np.eye(4, 3), [[0.0, 1.0, 2.0]])


def test_a_file_that_is_not_written_whole_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Path, target: Path) -> Path:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        Body.from_mesh(*MUG).save(tmp_path / "mug.obj")
    assert list(tmp_path.iterdir()) == []
