"""Every example runs; each ends in its own assertion."""

from __future__ import annotations

import runpy

import pytest

from tests.support import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))


def test_there_are_examples() -> None:
    assert EXAMPLES


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path: object) -> None:
    runpy.run_path(str(path), run_name="__main__")
