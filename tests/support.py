"""What tests share: where the optional reference files lie."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]


def shared(relative: str) -> Path:
    """A file of the shared references beside the repository, or a skip with the reason."""
    path = ROOT.parent / "shared" / relative
    if not path.exists():
        pytest.skip(f"the optional reference {relative} is not beside the repository")
    return path


def reference(name: str) -> dict[str, Any]:
    """A parsed file of ``shared/reference``."""
    data: dict[str, Any] = json.loads(shared(f"reference/{name}").read_text())
    return data
