"""Mesh files of every kind give the same triangles; shapes become surfaces of the right size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from apprehend.errors import MeshError
from apprehend.robots import Link, Shape, ShapeKind, link_surface, load_shape_mesh, read_mesh, shape_surface
from apprehend.robots import meshes as meshes_module


def wedge() -> trimesh.Trimesh:
    """A closed body without symmetry."""
    points = [[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1], [0.25, 0.15, 0.07]]
    return trimesh.convex.convex_hull(points)


def mesh_shape(path: Path, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Shape:
    return Shape(ShapeKind.MESH, scale, np.eye(4), mesh=path)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb", "off", "dae"])
def test_formats_agree(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"wedge.{suffix}"
    wedge().export(path)
    vertices, faces = load_shape_mesh(mesh_shape(path))
    again = trimesh.Trimesh(vertices, faces, process=False)
    assert len(vertices) == len(wedge().vertices)  # corners are merged
    assert again.is_watertight
    assert again.volume == pytest.approx(wedge().volume, rel=1e-5)
    assert np.allclose(vertices.max(axis=0), wedge().bounds[1], atol=1e-6)


def test_scale_and_mirror_keep_faces_outward(tmp_path: Path) -> None:
    path = tmp_path / "w.stl"
    wedge().export(path)
    vertices, faces = load_shape_mesh(mesh_shape(path, (0.001, -0.002, 0.001)))
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(wedge().volume * 2e-9, rel=1e-5)


def test_collada_unit_is_applied_and_its_up_axis_is_not(tmp_path: Path) -> None:
    path = tmp_path / "w.dae"
    wedge().export(path)
    text = path.read_text()
    head = (
        text[: text.index("<asset>")] + '<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>'
    )
    path.write_text(head + text[text.index("</asset>") + len("</asset>") :])
    vertices, _ = read_mesh(path)
    assert np.allclose(vertices.max(axis=0), 0.01 * wedge().bounds[1], atol=1e-8)


@pytest.mark.parametrize(
    ("kind", "size", "extents", "volume"),
    [
        (ShapeKind.BOX, (1.0, 2.0, 3.0), (1, 2, 3), 6.0),
        (ShapeKind.SPHERE, (0.5,), (1, 1, 1), np.pi / 6),
        (ShapeKind.CYLINDER, (0.5, 2.0), (1, 1, 2), np.pi / 2),
        (ShapeKind.CAPSULE, (0.5, 2.0), (1, 1, 3), np.pi / 2 + np.pi / 6),
    ],
)
def test_shapes_become_surfaces(
    kind: ShapeKind, size: tuple[float, ...], extents: tuple[float, ...], volume: float
) -> None:
    vertices, faces = shape_surface(Shape(kind, size, np.eye(4)))
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert np.allclose(np.ptp(vertices, axis=0), extents, rtol=0.01)
    assert np.allclose(vertices.max(axis=0) + vertices.min(axis=0), 0, atol=1e-9)
    assert mesh.volume == pytest.approx(volume, rel=0.02)
    assert mesh.volume <= volume + 1e-12


def test_a_link_is_the_sum_of_its_shapes_in_its_frame() -> None:
    T = np.eye(4)
    T[0, 3] = 5.0
    cube = Shape(ShapeKind.BOX, (1.0, 1.0, 1.0), np.eye(4))
    link = Link("l", collisions=(cube, Shape(ShapeKind.BOX, (1.0, 1.0, 1.0), T)))
    vertices, faces = link_surface(link)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.volume == pytest.approx(2.0)
    assert np.allclose(mesh.bounds, [[-0.5, -0.5, -0.5], [5.5, 0.5, 0.5]])
    assert link_surface(link, visual=True)[0].shape == (0, 3)


def test_unusable_files_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MeshError, match=r"mesh .*none\.stl cannot be read: No such file"):
        read_mesh(tmp_path / "none.stl")
    (tmp_path / "bad.stl").write_bytes(b"\x00" * 90)
    with pytest.raises(MeshError, match=r"bad\.stl (cannot be read as stl|has no faces)"):
        read_mesh(tmp_path / "bad.stl")
    (tmp_path / "empty.obj").write_text("# nothing\n")
    with pytest.raises(MeshError, match=r"empty\.obj (cannot be read as obj|has no faces)"):
        read_mesh(tmp_path / "empty.obj")
    (tmp_path / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"nan\.obj has vertices that are not finite"):
        read_mesh(tmp_path / "nan.obj")
    monkeypatch.setattr(meshes_module, "MAX_BYTES", 10)
    with pytest.raises(MeshError, match="a mesh may have"):
        read_mesh(tmp_path / "nan.obj")
    with pytest.raises(MeshError, match="shape 'b' is a box, not a mesh"):
        load_shape_mesh(Shape(ShapeKind.BOX, (1.0, 1.0, 1.0), np.eye(4), name="b"))
