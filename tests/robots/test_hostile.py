"""Files from strangers: XML bombs, entities, oversized files and paths that reach outside are refused, quickly."""

from __future__ import annotations

from pathlib import Path

import pytest

from apprehend.errors import DescriptionError, MeshError
from apprehend.robots import load_description, markup, parse_urdf, read_mesh, read_srdf, read_urdf
from tests.robots.build import joint, link, robot, write

BOMB = """<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>
<robot name="&c;"><link name="a"/></robot>"""
READS_A_FILE = """<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="r"><link name="&x;"/></robot>"""


@pytest.mark.parametrize("text", [BOMB, READS_A_FILE, "<!doctype r><robot name='r'/>"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_refused(text: str, encoding: str) -> None:
    data = text.replace(' version="1.0"', f' version="1.0" encoding="{encoding}"').encode(encoding)
    with pytest.raises(DescriptionError, match="declares a DOCTYPE or entities, which is refused"):
        parse_urdf(data)


def test_entities_in_srdf_and_mesh_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="DOCTYPE"):
        read_srdf(write(tmp_path, BOMB, "r.srdf"))
    with pytest.raises(MeshError, match="DOCTYPE"):
        read_mesh(write(tmp_path, BOMB, "m.dae"))


def test_undeclared_entities_are_malformed() -> None:
    with pytest.raises(DescriptionError, match="Entity 'x' not defined"):
        parse_urdf('<robot name="&x;"><link name="a"/></robot>')


def test_size_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, robot(*(link(f"l{i}") for i in range(100))))
    monkeypatch.setattr(markup, "MAX_ELEMENTS", 50)
    with pytest.raises(DescriptionError, match="has 101 elements; a description may have 50"):
        read_urdf(path)
    monkeypatch.setattr(markup, "MAX_BYTES", 1000)
    with pytest.raises(DescriptionError, match="a description may have"):
        read_urdf(path)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(DescriptionError, match=r"malformed XML: .*depth"):
        parse_urdf("<robot name='r'>" + "<a>" * 5000 + "</a>" * 5000 + "</robot>")


def mesh_robot(name: str) -> str:
    return robot(link("a", f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'))


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """outside.stl beside a package with meshes/in.stl and urdf/."""
    (tmp_path / "outside.stl").write_text("x")
    for folder in ("pkg/urdf", "pkg/meshes"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "pkg/meshes/in.stl").write_text("x")
    return tmp_path


def test_the_folder_above_urdf_is_part_of_the_package(tree: Path) -> None:
    d = read_urdf(write(tree / "pkg/urdf", mesh_robot("../meshes/in.stl")))
    assert d.links["a"].visuals[0].mesh == tree / "pkg/meshes/in.stl"


@pytest.mark.parametrize("name", ["../../outside.stl", "{tree}/outside.stl", "file://{tree}/outside.stl"])
def test_paths_outside_are_refused_until_allowed(tree: Path, name: str) -> None:
    path = write(tree / "pkg/urdf", mesh_robot(name.format(tree=tree)))
    with pytest.raises(DescriptionError, match=r"r\.urdf:2: mesh .* outside the allowed folders"):
        read_urdf(path)
    assert read_urdf(path, packages=tree).links["a"].visuals[0].mesh == tree / "outside.stl"


def test_a_symbolic_link_does_not_lead_out(tree: Path) -> None:
    (tree / "pkg/meshes/link.stl").symlink_to(tree / "outside.stl")
    with pytest.raises(DescriptionError, match="outside the allowed folders"):
        read_urdf(write(tree / "pkg/urdf", mesh_robot("../meshes/link.stl")))


def test_package_names(tree: Path) -> None:
    path = write(tree / "pkg/urdf", mesh_robot("package://pkg/meshes/in.stl"))
    mesh = tree / "pkg/meshes/in.stl"
    assert read_urdf(path).links["a"].visuals[0].mesh == mesh  # an ancestor bears the name
    other = write(tree, mesh_robot("package://other/meshes/in.stl"), "o.urdf")
    with pytest.raises(MeshError, match=r"no folder of the package 'other' was found; pass packages=\{'other': folder"):
        read_urdf(other)
    assert read_urdf(other, packages={"other": tree / "pkg"}).links["a"].visuals[0].mesh == mesh
    assert read_urdf(path, packages=[tree]).links["a"].visuals[0].mesh == mesh


def test_package_names_do_not_climb_out(tree: Path) -> None:
    path = write(tree / "pkg/urdf", mesh_robot("package://pkg/../outside.stl"))
    with pytest.raises(DescriptionError, match="outside the allowed folders"):
        read_urdf(path)


def test_three_slashes_are_read_and_reported(tree: Path) -> None:
    d = read_urdf(write(tree / "pkg/urdf", mesh_robot("package:///pkg/meshes/in.stl")))
    assert d.links["a"].visuals[0].mesh == tree / "pkg/meshes/in.stl"
    assert "three slashes" in str(d.repairs[0])


def test_a_missing_mesh_is_named_with_what_was_tried(tree: Path) -> None:
    path = write(tree / "pkg/urdf", mesh_robot("../meshes/none.stl"))
    with pytest.raises(MeshError, match=r"r\.urdf:2: mesh '\.\./meshes/none\.stl' does not exist \(looked for .*none"):
        load_description(path)
    d = load_description(path, meshes="ignore")
    assert not d.links["a"].visuals
    assert "was not found; left the shape out, as asked" in str(d.repairs[0])


def test_a_folder_of_meshes_serves_names_from_another_machine(tree: Path) -> None:
    path = write(tree / "pkg/urdf", mesh_robot("/home/someone/ws/in.stl"))
    assert read_urdf(path, packages=tree / "pkg/meshes").links["a"].visuals[0].mesh == tree / "pkg/meshes/in.stl"


def test_only_mesh_files_are_meshes(tree: Path) -> None:
    (tree / "pkg/meshes/secret.txt").write_text("x")
    with pytest.raises(MeshError, match=r"files of type '\.txt' are not read; expected one of \.dae"):
        read_urdf(write(tree / "pkg/urdf", mesh_robot("../meshes/secret.txt")))


def test_a_package_of_another_name_is_guessed_and_reported(tree: Path) -> None:
    d = read_urdf(write(tree / "pkg/urdf", mesh_robot("package://renamed/meshes/in.stl")))
    assert d.links["a"].visuals[0].mesh == tree / "pkg/meshes/in.stl"
    assert "no folder of the package 'renamed' was found; took " in str(d.repairs[0])


def test_backslashes_are_read_and_reported(tree: Path) -> None:
    d = read_urdf(write(tree / "pkg/urdf", mesh_robot(r"..\meshes\in.stl")))
    assert d.links["a"].visuals[0].mesh == tree / "pkg/meshes/in.stl"
    assert "backslashes" in str(d.repairs[0])


def test_a_default_namespace_says_nothing() -> None:
    d = parse_urdf('<robot xmlns="http://drake.mit.edu" name="r"><link name="a"/></robot>')
    assert d.root == "a"


def test_long_circles_and_chains_are_answered_at_once() -> None:
    count = 5_000
    links = [link(f"l{i}") for i in range(count)]
    circle = robot(*links, *(joint(f"j{i}", f"l{i}", f"l{(i + 1) % count}") for i in range(count)))
    with pytest.raises(DescriptionError, match=r"the links form a cycle: .*… \(5000 in all\) …") as caught:
        parse_urdf(circle)
    assert len(str(caught.value)) < 400
    follow = '<limit lower="-1" upper="1"/><mimic joint="j{}"/>'
    chain = [joint(f"j{i}", "root", f"l{i}", inner=follow.format(i + 1)) for i in range(count - 1)]
    d = parse_urdf(robot(link("root"), *links, *chain, joint(f"j{count - 1}", "root", f"l{count - 1}")))
    mimic = d.joint("j0").mimic
    assert mimic is not None
    assert mimic.joint == f"j{count - 1}"


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ('<worldbody><replicate count="1000"><replicate count="1000"><body/></replicate></replicate></worldbody>',
         r"<replicate> makes 1e\+06 of one; a description may have 10000"),
        ('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>', "<hfield> makes"),
        ('<worldbody><composite type="cable" count="x 1 1"/></worldbody>', "count='x 1 1' is not numbers"),
        ('<asset><model name="m" file="../../../../../../etc/passwd"/></asset>', "outside the allowed folders"),
    ],
)  # fmt: skip
def test_small_files_do_not_make_huge_models(tmp_path: Path, inner: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=said):
        load_description(write(tmp_path, f"<mujoco>{inner}</mujoco>", "m.xml"))


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("m.stl", b"\0" * 80 + (2**31).to_bytes(4, "little") + b"\0" * 50),
        ("m.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n"),
        ("m.ply", b"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n1\n"),
        ("m.glb", b"glTF" + (2).to_bytes(4, "little") + (2**31).to_bytes(4, "little") + b"\0" * 20),
        ("m.gltf", b'{"asset":{"version":"2.0"},"buffers":[{"uri":"../../../etc/passwd","byteLength":10}]}'),
        ("m.off", b"OFF\n4000000000 4000000000 0\n"),
        ("m.obj", b"v 0 0 0\nf 1 2 3\n"),
    ],
)
def test_meshes_that_promise_more_than_they_hold(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MeshError, match=r"mesh .* (cannot be read as|has no faces)"):
        read_mesh(tmp_path / name)
