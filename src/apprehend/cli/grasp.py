"""``apprehend grasp check`` and ``apprehend forces``: contacts from a file or a simulation, judged and loaded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import console, print_json
from .options import Json, Port, Units, load_body

if TYPE_CHECKING:
    from ..arrays import Array
    from ..grasp import Candidate, Grasp

File = Annotated[
    Path, typer.Argument(help="contacts: .json or .csv (see apprehend.grasp.read_grasp), or an MJCF model .xml")
]
BodyName = Annotated[str | None, typer.Option(help="of a model: the body that is held")]
Time = Annotated[float, typer.Option(help="of a model: seconds to simulate from its first keyframe")]
By = Annotated[str | None, typer.Option(help="of a model: bodies whose contacts count, with commas (default: all)")]
View = Annotated[bool, typer.Option("--view", help="show contacts and wrench space in the browser")]
Friction = Annotated[float, typer.Option(help="µ of contacts without their own")]
Model = Annotated[str, typer.Option(help="frictionless, coulomb, soft or soft_box, for contacts without their own")]
Torsion = Annotated[float, typer.Option(help="γ in m of soft fingers without their own")]
Picture = Annotated[Path | None, typer.Option(help="write a picture (.png, .svg, .pdf)")]

app = typer.Typer(no_args_is_help=True, help="Judge grasps given as contacts, or plan them.")


@app.callback()
def root() -> None:
    """Judge grasps given as contacts, or plan them."""


def _read(
    file: Path, friction: float, model: str, torsion: float, body: str | None, time: float, by: str | None
) -> tuple[Grasp, Array | None]:
    """The grasp, and the forces of the simulation if it comes from one."""
    from ..errors import InputError
    from ..grasp import read_grasp

    if file.suffix.lower() != ".xml":
        if body is not None or by is not None:
            raise InputError(f"--body and --by pick contacts of a simulated model; {file.name} is no .xml")
        return read_grasp(file, friction=friction, model=model, torsion=torsion), None
    if body is None:
        raise InputError(f"{file.name} is a model with several bodies; say which is held with --body NAME")
    from ..sim import simulated

    found = simulated(file, body, time, None if by is None else [name.strip() for name in by.split(",")])
    return found.grasp, found.forces


def _qualities(grasp: Grasp) -> dict[str, Any]:
    found = {
        "ε, L1, exact cones": grasp.quality(),
        "ε, L∞, exact cones": grasp.quality(norm="linf"),
        "ε, L1, 8 edges": grasp.quality(cone="polyhedral"),
        "ε of forces alone": grasp.quality(subspace="force"),
        "ε of torques alone": grasp.quality(subspace="torque"),
        "volume, L1, 8 edges": grasp.quality("volume"),
        "mean facet distance": grasp.quality("mean_facet_distance"),
        "smallest singular value": grasp.quality("min_singular_value"),
        "isotropy": grasp.quality("isotropy"),
        "contacts may be off by (m)": grasp.quality("position_margin"),
    }
    if len(grasp) > 2:
        found["polygon of contacts (m²)"] = grasp.quality("polygon_area")
    return found


@app.command("check")
def check(
    file: File,
    friction: Friction = 0.6,
    model: Model = "coulomb",
    torsion: Torsion = 0.0,
    body: BodyName = None,
    time: Time = 0.5,
    by: By = None,
    picture: Picture = None,
    view: View = False,
    port: Port = 8080,
    as_json: Json = False,
) -> int:
    """Closure with its proof, and the standard qualities. Exit code 0: force closure; 1: none; 2: wrong input."""
    from ..grasp import save_picture

    grasp, forces = _read(file, friction, model, torsion, body, time, by)
    force, form = grasp.force_closure(), grasp.form_closure()
    qualities = _qualities(grasp)
    if picture is not None:
        save_picture(grasp, picture, forces)
    if as_json:
        print_json(
            {
                "contacts": len(grasp), "rank": grasp.rank,
                "force_closure": {"closed": force.success, "margin": force.margin, "why": force.explain(),
                                  "tolerance": force.tolerance,
                                  "internal_force": force.internal_force.tolist(), "wrench": force.wrench.tolist()},
                "form_closure": {"closed": form.success, "margin": form.margin, "why": form.explain()},
                "removable": list(grasp.removable()),
                "quality": {name: {"lower": q.lower, "upper": q.upper if q.upper < float("inf") else None,
                                   "worst_wrench": q.worst_wrench.tolist()}
                            for name, q in qualities.items()},
            }
        )  # fmt: skip
    else:
        _print_check(file.name, grasp, force, form, qualities)
    _show(grasp, forces, view, port)
    return 0 if force.success else 1


def _print_check(title: str, grasp: Grasp, force: Any, form: Any, qualities: dict[str, Any]) -> None:
    table = _table(f"{title}: {len(grasp)} contacts", "property", "value", "certified")
    table.add_row("force closure", "yes" if force.success else "no", force.explain())
    if not force.success:
        table.add_row("wrench not resisted", "", ", ".join(f"{v:.3g}" for v in force.wrench))
    table.add_row("form closure", "yes" if form.success else "no", form.explain())
    table.add_row("internal forces", f"{grasp.null_space.shape[1]}", "dimension of the null space of G")
    if len(grasp) == 2:
        table.add_row("antipodal", "yes" if grasp.antipodal() else "no", "each contact lies in the other's cone")
    removable = ", ".join(map(str, grasp.removable())) or "none"
    table.add_row("contacts that may go", removable, "one at a time, force closure kept")
    for name, q in qualities.items():
        certified = "exact" if q.lower == q.upper else f"between {q.lower:.6g} and {q.upper:.6g}"
        table.add_row(name, f"{q.value:.6g}", certified if q.upper < float("inf") else "at least")
    console.print(table)


@app.command("plan")
def plan(
    hand: Annotated[str, typer.Argument(help="a hand of the catalogue, or a file")],
    body: Annotated[str, typer.Argument(help="a mesh, or a household body")],
    n: Annotated[int, typer.Option(help="how many grasps")] = 10,
    method: Annotated[str, typer.Option(help="of hands with several fingers: both, inverse or closing")] = "both",
    friction: Annotated[float | None, typer.Option(help="µ (default: the body's)")] = None,
    mass: Annotated[float | None, typer.Option(help="of the body, in kg")] = None,
    units: Units = None,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 0,
    view: View = False,
    port: Port = 8080,
    as_json: Json = False,
) -> int:
    """Plan grasps of a body by a hand, best first. Exit code 0: found; 1: none, and why; 2: wrong input."""
    import numpy as np

    from .. import grasp
    from ..bodies import HOUSEHOLD, Body
    from ..errors import unknown_name
    from ..kinematics import Hand

    if body in HOUSEHOLD:
        thing = Body.household(body) if mass is None else Body.household(body).with_(mass=mass)
    elif Path(body).suffix:
        thing = load_body(body, mass=mass, units=units)
    else:
        unknown_name("household body", body, HOUSEHOLD, "the catalogue (and it has no ending of a mesh file)")
    gripper = Hand.load(hand)
    found = grasp.plan(gripper, thing, n=n, rng=np.random.default_rng(seed), friction=friction, method=method)
    if as_json:
        print_json({"why": found.explain(), "rejected": dict(found.rejected), "grasps": [_as_data(c) for c in found]})
    else:
        console.print(found.explain())
        if found.success:
            table = _table(f"{gripper.name} on {thing.name}", "rank", "quality", "contacts", "force", "how")
            for i, c in enumerate(found):
                how = c.method if isinstance(c, grasp.HandCandidate) else f"{1e3 * c.width:.1f} mm wide"
                links = ", ".join(c.links) if isinstance(c, grasp.HandCandidate) else "both pads"
                table.add_row(str(i), f"{c.quality:.3f}", links, f"{c.required_force:.1f} N", how)
            console.print(table)
    if view and found.success:
        from .. import viewer

        viewer.show_grasp(thing, found.candidates, gripper, port=port, announce=console.print)
    return 0 if found.success else 1


def _as_data(candidate: Candidate) -> dict[str, Any]:
    """A grasp as JSON: poses in the frame of the body, and its contacts as `read_grasp` reads them."""
    from ..grasp import HandCandidate

    data: dict[str, Any] = {
        "quality": candidate.quality, "T_body_hand": candidate.pose.tolist(), "T_body_tcp": candidate.tcp.tolist(),
        "required_force": float(candidate.required_force),
        "margins": {name: float(value) for name, value in candidate.margins.items()},
        "contacts": [{"position": c.position.tolist(), "normal": c.normal.tolist(), "model": c.model.value,
                      "friction": c.friction, "torsion": c.torsion} for c in candidate.contacts],
    }  # fmt: skip
    if isinstance(candidate, HandCandidate):
        data |= {"q": candidate.q.tolist(), "pregrasp": candidate.pregrasp.tolist(), "links": list(candidate.links),
                 "method": candidate.method}  # fmt: skip
    else:
        data |= {"width": candidate.width, "opening": candidate.opening}
    return data


def _show(grasp: Grasp, forces: Array | None, view: bool, port: int) -> None:
    if view:
        from .. import viewer

        viewer.show_contacts(grasp, forces, port=port, announce=console.print)


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
    body: BodyName = None,
    time: Time = 0.5,
    by: By = None,
    picture: Picture = None,
    view: View = False,
    port: Port = 8080,
    as_json: Json = False,
) -> int:
    """Optimal contact forces against a wrench. Exit code 0: found; 1: none exist, with a proof; 2: wrong input."""
    import numpy as np

    from ..errors import InputError
    from ..grasp import ContactForces, Limits, save_picture

    try:
        w = np.array([float(v) for v in wrench.split(",")])
    except ValueError as error:
        raise InputError(f"--wrench {wrench!r} is not a list of numbers such as 0,0,-9.81,0,0,0") from error
    grasp, _ = _read(file, friction, model, torsion, body, time, by)
    if w.shape != (grasp.wrench_size,):
        raise InputError(f"--wrench has {w.size} numbers; expected {grasp.wrench_size} for this grasp")
    found = grasp.contact_forces(w, objective, Limits(normal=normal, total=total))
    assert isinstance(found, ContactForces)
    if picture is not None:
        save_picture(grasp, picture, found.forces)
    if as_json:
        print_json(
            {
                "status": str(found.status), "why": found.explain(), "forces": found.forces.tolist(),
                "value": found.value if found.success else None, "bound": found.bound if found.success else None,
                "slack": found.slack.tolist(), "active": list(found.active),
                "certificate": found.certificate.tolist(),
            }
        )  # fmt: skip
    elif not found.success:
        console.print(found.explain())
        console.print("proof (direction in scaled wrench space): " + ", ".join(f"{v:.6g}" for v in found.certificate))
    else:
        table = _table(f"{objective} = {found.value:.9g}, at least {found.bound:.9g}", "contact", "force", "inside by")
        for i, s in enumerate(grasp.slices):
            table.add_row(str(i), ", ".join(f"{v:.5g}" for v in found.forces[s]), f"{found.slack[i]:.3g} N")
        console.print(table)
        console.print("limits reached: " + (", ".join(found.active) or "none"))
    _show(grasp, found.forces, view, port)
    return 0 if found.success else 1


def _table(title: str, *columns: str) -> Any:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column)
    return table
