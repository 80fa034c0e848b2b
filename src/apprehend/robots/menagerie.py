"""``menagerie:NAME``: models of MuJoCo Menagerie through its official loader, for users who are online."""

from __future__ import annotations

from pathlib import Path

from ..errors import DescriptionError, MissingDependencyError, unknown_name

PREFIX = "menagerie:"


def menagerie_file(name: str) -> Path:
    """The model file of ``NAME`` or ``NAME/ENTRY``; downloaded on first use, then taken from the loader's cache.

    Raises `MissingDependencyError` without the extra ``[menagerie]``, `UnknownNameError` for a name that Menagerie does
    not have, and `DescriptionError` when the download fails.
    """
    try:
        import mujoco_menagerie
    except ImportError:
        raise MissingDependencyError(
            f"{PREFIX}{name} needs the loader of MuJoCo Menagerie: pip install 'apprehend[menagerie]'"
        ) from None
    robot_name, _, entry = name.partition("/")
    if robot_name not in mujoco_menagerie.names():
        unknown_name("robot", robot_name, mujoco_menagerie.names(), "MuJoCo Menagerie")
    robot = mujoco_menagerie.get(robot_name)
    entry = entry or robot.default_model or robot.default_scene
    if entry not in robot.entry_names:
        unknown_name("model", entry, robot.entry_names, f"{robot_name} of MuJoCo Menagerie")
    try:
        return Path(robot.xml(entry))
    except (mujoco_menagerie.MenagerieError, OSError) as error:
        reason = " ".join(str(error).split())
        raise DescriptionError(
            f"{PREFIX}{name} could not be downloaded ({reason}); go online once, or set MENAGERIE_ROOT to a checkout "
            "of the repository mujoco_menagerie"
        ) from None
