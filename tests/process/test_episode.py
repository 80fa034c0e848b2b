"""The record of an episode: plain data, whole-or-nothing writing, and refusal of what is no episode."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apprehend.errors import InputError, UnknownNameError, UnsuccessfulError
from apprehend.process import Episode, EpisodeStatus, StepRecord, StepStatus, Verdict, read_episode
from apprehend.process.episode import plain


def episode(status: EpisodeStatus = EpisodeStatus.SUCCESS) -> Episode:
    step = StepRecord("lift", "Lift", StepStatus.SUCCESS, "raised 12 cm", 0.1, 1.0, outputs={"q": np.arange(3.0)})
    mesh = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    return Episode("test", {}, (step,), Verdict(status, "it stands", 1e-3, 0.01), {}, {}, {"meshes/a.obj": mesh})


def test_saved_episodes_are_read_back(tmp_path: Path) -> None:
    path = episode().save(tmp_path / "out")
    data = read_episode(path)
    assert data["verdict"]["success"] is True
    assert data["steps"][0]["outputs"]["q"] == [0.0, 1.0, 2.0]
    assert data["verdict"]["slip"] is None  # NaN is not JSON
    assert (tmp_path / "out" / "meshes" / "a.obj").read_text().count("v ") == 3
    assert read_episode(tmp_path / "out")["title"] == "test"


def test_saving_replaces_an_episode_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    episode().save(out)
    (out / "report.html").write_text("old")
    episode().save(out)
    assert not (out / "report.html").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_saving_does_not_destroy_other_directories(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match=r"is not empty and holds no episode\.json"):
        episode().save(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_failed_write_leaves_the_old_one(tmp_path: Path) -> None:
    out = tmp_path / "out"
    episode().save(out)
    before = (out / "episode.json").read_text()
    broken = Episode("x", {"bad": object()}, (), Verdict(EpisodeStatus.SUCCESS, ""), {}, {})
    with pytest.raises(TypeError):
        broken.save(out)
    assert (out / "episode.json").read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_success_follows_the_verdict() -> None:
    assert episode().require_success().success
    with pytest.raises(UnsuccessfulError, match="it stands"):
        episode(EpisodeStatus.MISPLACED).require_success()


def test_steps_by_name() -> None:
    assert episode().step("lift").outputs["q"][2] == 2.0
    with pytest.raises(UnknownNameError, match=r"no step named 'lit' in this episode\. Did you mean 'lift'"):
        episode().step("lit")


@pytest.mark.parametrize(
    "content, message",
    [
        ("{", "not JSON"),
        ("[]", "is not an episode"),
        (json.dumps({"format": "apprehend-episode/99"}), "apprehend-episode/99"),
    ],
)
def test_what_is_no_episode_is_refused(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "episode.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_episode(path)


def test_a_missing_episode_names_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="apprehend pick --out"):
        read_episode(tmp_path)


def test_plain_data_is_json() -> None:
    value = {"a": np.float64(np.inf), "b": np.bool_(True), "c": {StepStatus.FAILED}, "d": Path("x"), 3: np.int32(4)}
    assert json.loads(json.dumps(plain(value))) == {"a": None, "b": True, "c": ["failed"], "d": "x", "3": 4}
