"""The commands by name. Their modules import nothing heavy before they run, so that ``--help`` stays quick."""

from __future__ import annotations

import typer

from . import fk, grasp, ik, pick, plan, reach, robots, trajectory, view

app = typer.Typer(name="apprehend", add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)
app.command("pick", help="Pick an object and place it: plan, simulate, judge.")(pick.command)
app.command("view", help="Look at an episode, a body, a robot, a scene, and their models.")(view.command)
app.command("robots", help="The catalogue, or one robot: its tree, limits and DH table.")(robots.command)
app.command("fk", help="Poses of a robot's frames.")(fk.command)
app.command("jacobian", help="The Jacobian of a frame, its singular values and manipulability.")(fk.jacobian)
app.command("ik", help="Joint values for a pose, or why there are none.")(ik.command)
app.command("plan", help="A collision-free path in a scene, or why there is none.", epilog=plan.EPILOG)(plan.command)
app.command("reach", help="Which poses a robot reaches, and how well: a map, its picture, a query.")(reach.command)
app.add_typer(grasp.app, name="grasp")
app.command("forces", help="Optimal contact forces against a wrench.")(grasp.forces)
app.command("trajectory", help="Time a path through waypoints within proven limits.")(trajectory.command)


@app.callback()
def root() -> None:
    """From a robot description and an object to a grasp that holds, and the motion that gets there."""
