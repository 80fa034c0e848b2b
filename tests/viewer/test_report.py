"""The report: whole, self-contained, escaped, and honest about episodes that stopped early."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

from apprehend.errors import InputError
from apprehend.viewer import report, write_report
from apprehend.viewer.record import Record
from apprehend.viewer.stage import body_poses, read
from apprehend.viewer.studio import Contacts, Studio
from tests.viewer.conftest import make_episode, on_disk

VOID = {"meta", "img", "br", "line", "rect", "polyline"}


class Tree(HTMLParser):
    """Collects tags and text, and fails where tags are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.images: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.links += [v for k in ("href", "src") if (v := values.get(k))]
        if tag == "img":
            self.images.append(values["src"] or "")
            assert values["alt"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module", autouse=True)
def small_pictures() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name in ("HERO", "FRAME", "CLOSE"):
            patch.setattr(report, name, (240, 160))
        yield


@pytest.fixture(scope="module")
def written(episode: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> str:
    target = tmp_path_factory.mktemp("report") / "below" / "report.html"
    assert write_report(Path(episode["path"]), target) == target
    assert [p.name for p in target.parent.iterdir()] == ["report.html"]
    return target.read_text(encoding="utf-8")


def parsed(text: str) -> Tree:
    tree = Tree()
    tree.feed(text)
    tree.close()
    assert tree.open == []
    return tree


def test_nothing_is_loaded_from_anywhere(written: str) -> None:
    tree = parsed(written)
    assert all(link.startswith("data:") for link in tree.links)
    assert not re.search(r"https?://|@import|url\(", written)
    assert "prefers-color-scheme: dark" in written


def test_pictures_are_inside_and_show_something(written: str) -> None:
    images = parsed(written).images
    assert len(images) == 7  # the scene, four steps, and two of the grasp
    shots = [np.asarray(Pillow.open(io.BytesIO(base64.b64decode(i.split(",")[1])))).astype(int) for i in images]
    assert all(shot.std() > 10 for shot in shots)
    assert np.abs(shots[1] - shots[4]).mean() > 1.0  # the arm has moved


def test_the_grasp_shows_its_friction_cones(written: str, episode: dict[str, Any]) -> None:
    assert "µ = 0.5, half angle 26.6°" in parsed(written).text
    record, stage = Record.of(episode), read(episode)[1]
    contacts = Contacts.of(episode)
    assert contacts is not None
    bare = Contacts(contacts.points[:0], contacts.normals[:1], 0.5)
    studio = Studio.of(stage, record)
    shots = [studio.close_up("cube", c, 40, (200, 140), across=True).astype(int) for c in (contacts, bare)]
    blue = [(shot[..., 2] > shot[..., 0] + 30).sum() for shot in shots]
    assert blue[0] > 300 > blue[1]


def test_text_is_escaped_and_complete(written: str) -> None:
    tree = parsed(written)
    assert "<cube>" not in written
    for text in (
        "arm picks <cube>",
        "Placed",
        "because & so",
        "found <3> grasps & more",
        "0.100 mrad",
        "shoulder_pan_joint",
    ):
        assert text.replace("0.100", "0.1") in tree.text
    assert "1.00 mm" in re.sub(r"\s+", " ", tree.text)
    assert "0.57 °" in re.sub(r"\s+", " ", tree.text)


def test_values_under_the_pointer(written: str) -> None:
    data = json.loads(re.search(r'id="data">(.*?)</script>', written, re.DOTALL)[1])  # type: ignore[index]
    charts = written.count('class="chart"')
    assert charts == len(data["charts"]) == 4 + 6
    for lines in data["charts"]:
        assert all(len(values) == len(data["t"]) for _, values in lines)


def test_a_failed_episode(tmp_path: Path) -> None:
    data = on_disk(make_episode(success=False), tmp_path)
    write_report(data, tmp_path / "report.html")
    tree = parsed((tmp_path / "report.html").read_text())
    assert "Failed" in tree.text
    assert "✗" in tree.text
    assert "position error" not in tree.text  # not measured


def test_an_episode_that_never_moved(tmp_path: Path) -> None:
    data = on_disk(make_episode(success=False, recorded=False), tmp_path)
    write_report(data, tmp_path / "report.html")
    tree = parsed((tmp_path / "report.html").read_text())
    assert len(tree.images) == 1
    assert "Joint" not in tree.text


def test_a_mesh_outside_the_folder_is_refused(episode: dict[str, Any]) -> None:
    data = json.loads(json.dumps(episode))
    data["scene"]["bodies"][0]["mesh"] = "../../etc/passwd.obj"
    with pytest.raises(InputError, match="outside its folder"):
        read(data)
    del data["path"]
    with pytest.raises(InputError, match="not from where"):
        read(data)


def test_no_episode_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no episode"):
        write_report(tmp_path, tmp_path / "report.html")
    assert list(tmp_path.iterdir()) == []


def test_record_checks_shapes(episode: dict[str, Any]) -> None:
    data = json.loads(json.dumps(episode))
    data["recording"]["q"] = [row[:-1] for row in data["recording"]["q"]]
    with pytest.raises(InputError, match=r"recording\.q has shape \(181, 5\); expected \(181, 6\)"):
        Record.of(data)
    with pytest.raises(InputError, match="no recorded motion"):
        Record.of(make_episode(recorded=False))


def test_record_knows_when_each_step_was(episode: dict[str, Any]) -> None:
    record = Record.of(episode)
    assert [b.label for b in record.bands] == ["Plan the grasp", "Close until contact", "Lift", "Set down"]
    assert record.bands[2].start == pytest.approx(1.0, abs=0.02)
    assert record.bands[2].stop == pytest.approx(2.0, abs=0.02)
    assert record.at(-1.0) == 0
    assert record.at(99.0) == 180
    assert np.isinf(record.limits["acceleration"]).sum() + np.isfinite(record.limits["acceleration"]).sum() == 6


def test_poses_of_rows() -> None:
    half = np.sqrt(0.5)
    T = body_poses([[1.0, 2.0, 3.0, half, 0.0, 0.0, half]])[0]
    assert np.allclose(T[:3, 3], [1, 2, 3])
    assert np.allclose(T[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
