"""The one tree of exceptions. A caller's mistake raises one of these; a numerical outcome never does.

Every message is built from facts: what was given, where it stood, what is allowed, and what to do next.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable
from typing import Never


class ApprehendError(Exception):
    """Base of every exception that this package raises on purpose."""

    def __str__(self) -> str:  # KeyError would print its message quoted
        return str(self.args[0]) if self.args else ""


class InputError(ApprehendError, ValueError):
    """An argument has a wrong shape, unit, range or value."""


class UnknownNameError(ApprehendError, KeyError):
    """A name (robot, frame, joint, body, option) does not exist."""


class DescriptionError(ApprehendError, ValueError):
    """A robot, hand or scene description cannot be read as it stands."""


class MeshError(ApprehendError, ValueError):
    """A mesh file is missing, unreadable, or not usable as a body."""


class MissingDependencyError(ApprehendError, ImportError):
    """An optional dependency is needed for this call."""


class UnsuccessfulError(ApprehendError, RuntimeError):
    """Raised by ``Result.require_success()``: the computation answered, but not with a success."""


MADE_BY = {
    "Robot": "Robot.load(name_or_file)",
    "Hand": "Hand.load(name_or_file)",
    "Body": "Body.load(file) or Body.household(name)",
    "Scene": "Scene.load(file) or Scene.tabletop(robot, body=...)",
    "CollisionModel": "CollisionModel(robot, scene)",
    "Generator": "numpy.random.default_rng(seed)",
}
"""How to get what a function expects."""


def expect(value: object, kind: str, name: str) -> None:
    """Raise `InputError` unless the argument *name* is an object of class *kind*, one of `MADE_BY`."""
    if type(value).__name__ != kind and all(c.__name__ != kind for c in type(value).__mro__):
        raise InputError(f"{name} is {described(value)}; expected a {kind}: {MADE_BY[kind]}")


def expect_path(value: object, name: str, what: str) -> None:
    """Raise `InputError` unless the argument *name* can be a name or the path of a file."""
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} is {described(value)}; expected {what}")


def described(value: object) -> str:
    """A value as a message shows it: short ones themselves, of others the type."""
    short = isinstance(value, str | int | float) or value is None
    return repr(value) if short and len(repr(value)) < 80 else f"a {type(value).__name__}"


def suggestion(name: str, known: Iterable[str], limit: int = 3) -> str:
    """``" Did you mean 'a' or 'b'?"`` for close matches of *name* among *known*, else an empty string."""
    close = difflib.get_close_matches(name, list(known), n=limit, cutoff=0.6)
    return f" Did you mean {' or '.join(repr(c) for c in close)}?" if close else ""


def unknown_name(kind: str, name: object, known: Iterable[str], where: str = "") -> Never:
    """Raise `UnknownNameError` for *name*, listing what is close, or everything that is there."""
    names = sorted(known)
    hint = suggestion(name, names) if isinstance(name, str) else ""
    if not hint:
        shown = ", ".join(names[:12]) + (f", … ({len(names)} in all)" if len(names) > 12 else "")
        hint = f" There are: {shown}." if names else " There are none."
    raise UnknownNameError(f"no {kind} named {name!r}{' in ' + where if where else ''}.{hint}")
