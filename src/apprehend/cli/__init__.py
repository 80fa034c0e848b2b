"""The command line: one file per command, and the only place that prints."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; mistakes end as one paragraph on standard error and exit code 2, never as a traceback."""
    from ..errors import ApprehendError
    from .app import app
    from .console import complain

    try:
        code = app(standalone_mode=False)
    except ApprehendError as error:
        complain(str(error))
        sys.exit(2)
    except Exception as error:
        code = usage_error(error)
    except KeyboardInterrupt:
        complain("interrupted; nothing was written", label="stopped")
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)


def usage_error(error: Exception) -> int:
    """Show what click says of wrong options in its own words; anything else is a fault of ours and is raised."""
    show = getattr(error, "show", None)
    if show is None:
        raise error
    show()
    return int(getattr(error, "exit_code", 2))


__all__ = ["main"]
