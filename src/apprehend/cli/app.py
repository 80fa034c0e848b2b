"""The commands by name. Each is imported when it is called, so that ``--help`` and start-up stay quick."""

from __future__ import annotations

import importlib

import typer
from click import Command, Context
from typer.core import TyperGroup

_COMMANDS = {
    "pick": "Pick an object and place it: plan, simulate, judge.",
    "view": "Replay an episode in the browser, or look at a body or a robot.",
}


class LazyGroup(TyperGroup):
    """A group whose commands live in ``cli/<name>.py`` as a function ``command`` and load on demand."""

    def list_commands(self, ctx: Context) -> list[str]:
        """The commands in the order of the table above."""
        return list(_COMMANDS)

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """Import and wrap the command of that name."""
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f"apprehend.cli.{cmd_name}")
        single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        single.command(name=cmd_name, help=_COMMANDS[cmd_name])(module.command)
        return typer.main.get_command(single)


app = typer.Typer(
    cls=LazyGroup,
    name="apprehend",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="From a robot description and an object to a grasp that holds, and the motion that gets there.",
)


@app.callback()
def root() -> None:
    """From a robot description and an object to a grasp that holds, and the motion that gets there."""
