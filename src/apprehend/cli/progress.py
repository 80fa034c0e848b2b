"""The checklist that a person watches while the process runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from ..process import Observer, StepStatus

if TYPE_CHECKING:
    from ..process import StepRecord

MARK = {StepStatus.SUCCESS: ("✓", "green"), StepStatus.FAILED: ("✗", "red"), StepStatus.SKIPPED: ("·", "dim")}


class Checklist(Observer):
    """One line a step: done, running with a word on what it does, or failed with the reason.

    On a terminal the running line moves; in a log every line is printed once, when its step has ended.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, refresh_per_second=10, transient=True) if console.is_terminal else None
        self._running: str | None = None
        self._said = ""

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._live is not None:
            self._live.stop()

    def started(self, name: str, title: str) -> None:
        """Show the running step."""
        self._running, self._said = title, ""
        self._show()

    def progress(self, text: str) -> None:
        """Show a word beside the running step."""
        self._said = text
        self._show()

    def finished(self, record: StepRecord) -> None:
        """Print the line of a step that has ended."""
        self._running = None
        mark, colour = MARK[record.status]
        line = Table.grid(padding=(0, 1))
        line.add_column(width=1)
        line.add_column(width=27, no_wrap=True)
        line.add_column(justify="right", width=9, no_wrap=True)
        line.add_column(ratio=1)
        line.add_row(
            Text(mark, colour), Text(record.title), Text(f"{record.duration:.2f} s", "dim"), Text(record.message, "dim")
        )
        self._console.print(line)
        self._show()

    def _show(self) -> None:
        if self._live is None:
            return
        row: RenderableType = Text("")
        if self._running is not None:
            row = Group(Spinner("dots", Text.assemble(f" {self._running}  ", (self._said, "dim"))))
        self._live.update(row)


@contextmanager
def silence() -> Iterator[Observer]:
    """An observer that says nothing, as a context like `Checklist`."""
    yield Observer()
