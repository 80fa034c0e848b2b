"""How the commands talk: a console for people, plain JSON for programs, and errors as one paragraph."""

from __future__ import annotations

import json
import sys
from typing import Any

from rich.console import Console
from rich.text import Text

console = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


def complain(message: str, label: str = "error") -> None:
    """One paragraph on standard error."""
    errors.print(Text.assemble((f"{label}: ", "bold red"), message), soft_wrap=not errors.is_terminal)


def print_json(data: Any) -> None:
    """One JSON document on standard output, with numbers at full precision."""
    sys.stdout.write(json.dumps(data, allow_nan=False) + "\n")
