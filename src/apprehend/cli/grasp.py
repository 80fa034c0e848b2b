"""``apprehend grasp check`` and ``apprehend forces``: contacts from a file, closure, quality, forces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .console import console, print_json

File = Annotated[Path, typer.Argument(help="contacts: .json or .csv (see apprehend.grasp.read_grasp)")]
Friction = Annotated[float, typer.Option(help="µ of contacts without their own")]
Model = Annotated[str, typer.Option(help="frictionless, coulomb, soft or soft_box, for contacts without their own")]
Torsion = Annotated[float, typer.Option(help="γ in m of soft fingers without their own")]
Picture = Annotated[Path | None, typer.Option(help="write a picture (.png, .svg, .pdf)")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]

app = typer.Typer(no_args_is_help=True, help="Judge grasps given as contacts.")


@app.callback()
def root() -> None:
    """Judge grasps given as contacts."""


@app.command("check")
def check(
    file: File,
    friction: Friction = 0.6,
    model: Model = "coulomb",
    torsion: Torsion = 0.0,
    picture: Picture = None,
    as_json: Json = False,
) -> int:
    """Closure with its proof, and the standard qualities. Exit code 0: force closure; 1: none; 2: wrong input."""
    from ..grasp import read_grasp, save_picture

    grasp = read_grasp(file, friction=friction, model=model, torsion=torsion)
    force, form = grasp.force_closure(), grasp.form_closure()
    qualities = {
        "ε, L1, exact cones": grasp.quality(),
        "ε, L∞, exact cones": grasp.quality(norm="linf"),
        "ε, L1, 8 edges": grasp.quality(cone="polyhedral"),
        "volume, L1, 8 edges": grasp.quality("volume"),
        "smallest singular value": grasp.quality("min_singular_value"),
        "isotropy": grasp.quality("isotropy"),
    }
    if picture is not None:
        save_picture(grasp, picture)
    if as_json:
        print_json(
            {
                "contacts": len(grasp), "rank": grasp.rank,
                "force_closure": {"closed": force.success, "margin": force.margin, "why": force.explain(),
                                  "internal_force": force.internal_force.tolist(), "wrench": force.wrench.tolist()},
                "form_closure": {"closed": form.success, "margin": form.margin, "why": form.explain()},
                "removable": list(grasp.removable()),
                "quality": {name: {"lower": q.lower, "upper": q.upper, "worst_wrench": q.worst_wrench.tolist()}
                            for name, q in qualities.items()},
            }
        )  # fmt: skip
        return 0 if force.success else 1
    table = _table(f"{file.name}: {len(grasp)} contacts", "property", "value", "certified")
    table.add_row("force closure", "yes" if force.success else "no", force.explain())
    table.add_row("form closure", "yes" if form.success else "no", form.explain())
    removable = ", ".join(map(str, grasp.removable())) or "none"
    table.add_row("contacts that may go", removable, "one at a time, force closure kept")
    for name, q in qualities.items():
        certified = "exact" if q.lower == q.upper else f"between {q.lower:.6g} and {q.upper:.6g}"
        table.add_row(name, f"{q.value:.6g}", certified)
    console.print(table)
    return 0 if force.success else 1


def forces(
    file: File,
    wrench: Annotated[
        str, typer.Option(help="fx,fy,fz,tx,ty,tz on the body about the reference point, in N and N m")
    ] = "",
    objective: Annotated[str, typer.Option(help="what to optimise")] = "min_normal",
    normal: Annotated[float | None, typer.Option(help="largest normal force of a contact, in N")] = None,
    total: Annotated[float | None, typer.Option(help="largest sum of normal forces, in N")] = None,
    friction: Friction = 0.6,
    model: Model = "coulomb",
    torsion: Torsion = 0.0,
    picture: Picture = None,
    as_json: Json = False,
) -> int:
    """Optimal contact forces against a wrench. Exit code 0: found; 1: none exist, with a proof; 2: wrong input."""
    import numpy as np

    from ..errors import InputError
    from ..grasp import ContactForces, Limits, read_grasp, save_picture

    try:
        w = np.array([float(v) for v in wrench.split(",")])
    except ValueError as error:
        raise InputError(f"--wrench {wrench!r} is not a list of numbers such as 0,0,-9.81,0,0,0") from error
    grasp = read_grasp(file, friction=friction, model=model, torsion=torsion)
    found = grasp.contact_forces(w, objective, Limits(normal=normal, total=total))
    assert isinstance(found, ContactForces)
    if picture is not None:
        save_picture(grasp, picture, found.forces)
    finite = found.success
    if as_json:
        print_json(
            {
                "status": str(found.status), "why": found.explain(), "forces": found.forces.tolist(),
                "value": found.value if finite else None, "bound": found.bound if finite else None,
                "slack": found.slack.tolist(), "active": list(found.active),
                "certificate": found.certificate.tolist(),
            }
        )  # fmt: skip
        return 0 if found.success else 1
    if not found.success:
        console.print(found.explain())
        console.print("proof (direction in scaled wrench space): " + ", ".join(f"{v:.6g}" for v in found.certificate))
        return 1
    table = _table(f"{objective} = {found.value:.9g}, at least {found.bound:.9g}", "contact", "force", "inside by")
    for i, s in enumerate(grasp.slices):
        table.add_row(str(i), ", ".join(f"{v:.5g}" for v in found.forces[s]), f"{found.slack[i]:.3g} N")
    console.print(table)
    console.print("limits reached: " + (", ".join(found.active) or "none"))
    return 0


def _table(title: str, *columns: str) -> Any:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column)
    return table
