"""The README's tour runs as it stands, and its numbers name files that exist."""

from __future__ import annotations

import re

import pytest

from tests.support import ROOT

README = (ROOT / "README.md").read_text()


def test_the_tour_runs(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cmeel", reason="the extra [robots] is not installed")
    code = "\n".join(re.findall(r"```python\n(.*?)```", README, re.DOTALL))
    exec(compile(code, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "reaches the target" in said
    assert "mug stands" in said


def test_the_files_it_names_exist() -> None:
    named = set(re.findall(r"`((?:docs|benchmarks|examples)/[\w./-]*)`", README))
    assert named
    assert not [name for name in named if not (ROOT / name).exists()]
