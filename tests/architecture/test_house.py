"""The house itself: rooms stay small, importing stays light, public names exist."""

from __future__ import annotations

import subprocess
import sys

import pytest

import apprehend
from tests.support import ROOT

SOURCES = sorted((ROOT / "src" / "apprehend").rglob("*.py"))


def test_files_stay_under_about_400_lines() -> None:
    crowded = {str(p.relative_to(ROOT)): n for p in SOURCES if (n := p.read_text().count("\n")) > 420}
    assert not crowded


def test_depth_is_at_most_three() -> None:
    assert not [p for p in SOURCES if len(p.relative_to(ROOT / "src" / "apprehend").parts) > 3]


def test_import_is_light() -> None:
    heavy = ("numba", "scipy", "trimesh", "mujoco", "viser", "matplotlib", "typer")
    code = f"import sys, apprehend; print([m for m in {heavy} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize("name", apprehend.__all__)
def test_public_names_resolve(name: str) -> None:
    assert getattr(apprehend, name) is not None


def test_unknown_attribute_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = apprehend.nonsense  # type: ignore[attr-defined]


def test_nothing_names_one_machine() -> None:
    prefixes = ("/" + "work/", "/" + "farm/")
    stray = [str(p) for p in SOURCES if any(x in p.read_text() for x in prefixes)]
    assert not stray
