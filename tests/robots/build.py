"""Small URDF texts for tests."""

from __future__ import annotations

from pathlib import Path


def link(name: str, inner: str = "") -> str:
    return f'<link name="{name}">{inner}</link>\n'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inner: str = '<limit lower="-1" upper="1"/>'
) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inner}</joint>\n'


def robot(*parts: str, name: str = "r", attributes: str = "") -> str:
    return f'<robot name="{name}"{attributes}>\n{"".join(parts)}</robot>\n'


def inertial(mass: float = 1.0, ixx: float = 1.0, iyy: float = 1.0, izz: float = 1.0) -> str:
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )


def two_links(inner: str, kind: str = "revolute") -> str:
    return robot(link("a"), link("b"), joint("j", "a", "b", kind, inner))


def write(folder: Path, text: str, name: str = "r.urdf") -> Path:
    path = folder / name
    path.write_text(text)
    return path
