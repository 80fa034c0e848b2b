"""The grasp process as a list of steps, and the loop that runs it (G 4)."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..collision import Scene
from ..errors import InputError, unknown_name
from ..kinematics import Hand
from .context import Context
from .episode import Episode, EpisodeStatus, StepRecord, StepStatus, Verdict
from .export import recording_data, scene_data
from .fine import Refine
from .fingers import CloseFingers, RateFingers
from .grasping import Close, PlanGrasp, Preshape, Rate
from .judge import judge
from .locate import Locate
from .placing import Place, Release, Retreat, Transport
from .reaching import Approach, Lift, Reach
from .recover import back_off
from .step import Observer, Outcome, Step

ATTEMPTS = 3
"""Grasps that are tried before the process gives up."""


@dataclass(frozen=True)
class Process:
    """Steps in order. Where one up to *commit* asks for it, the hand backs off and they start over from *again*."""

    steps: tuple[Step, ...]
    commit: str = "rate"
    again: str = "locate"

    @classmethod
    def default(cls, hand: Hand | None = None) -> Process:
        """G 4's decomposition, from locating the object to letting go of it, for a jaw or for the fingers of *hand*.

        Fingers take their pre-grasp far from the object, and close and are rated in their own way.
        """
        process = cls(
            (
                Locate(), PlanGrasp(), Reach(), Preshape(), Refine(), Approach(), Close(), Lift(), Rate(),
                Transport(), Place(), Release(), Retreat(),
            )
        )  # fmt: skip
        if hand is None or hand.is_jaw:
            return process
        steps = list(process.replaced("close", CloseFingers()).replaced("rate", RateFingers()).steps)
        reach = process.index("reach")
        steps[reach : reach + 2] = Preshape(), Reach()
        return replace(process, steps=tuple(steps))

    def replaced(self, name: str, step: Step) -> Process:
        """The process with *step* in the place of the step *name*."""
        self.index(name)
        return replace(self, steps=tuple(step if s.name == name else s for s in self.steps))

    def index(self, name: str) -> int:
        """Position of the step *name*."""
        names = [s.name for s in self.steps]
        if name not in names:
            unknown_name("step", name, names, "the process")
        return names.index(name)

    def run(self, context: Context) -> Iterator[StepRecord]:
        """Run the steps, yielding the record of each; the last one failed if the process could not go on."""
        at, attempt, commit = 0, 1, self.index(self.commit)
        while at < len(self.steps):
            record, outcome = run_step(self.steps[at], context)
            yield record
            if record.status is not StepStatus.FAILED:
                at += 1
            elif outcome.retry and at <= commit and attempt < ATTEMPTS:
                attempt += 1
                back_off(context)
                at = self.index(self.again)
            else:
                return


def run_step(step: Step, context: Context) -> tuple[StepRecord, Outcome]:
    """Run one step and record it."""
    context.observer.started(step.name, step.title)
    clock, simulated = time.perf_counter(), context.world.time
    outcome = step.run(context)
    status = StepStatus.SKIPPED if outcome.skipped else StepStatus.SUCCESS if outcome.success else StepStatus.FAILED
    record = StepRecord(
        step.name, step.title, status, outcome.message, time.perf_counter() - clock, context.world.time - simulated,
        outcome.inputs, outcome.outputs, outcome.margins,
    )  # fmt: skip
    context.observer.finished(record)
    return record, outcome


def pick_and_place(
    scene: Scene,
    *,
    seed: int = 0,
    rng: np.random.Generator | None = None,
    process: Process | None = None,
    observer: Observer | None = None,
) -> Episode:
    """Run the whole grasp process on *scene* in the physics engine, and judge it (G 4).

    The scene's task names the body to pick and where to place it (`Scene.with_task`). All random choices come from
    *rng* (or a generator seeded with *seed*): the same seed gives the same episode. *process* is the list of steps,
    by default `Process.default`; *observer* hears of the progress.

    The episode's ``status`` is the verdict of the physics; ``episode.steps`` holds every step's inputs, outputs,
    timings and margins. A process that ends early is an episode too: its verdict names the step and the reason.

    Raises `InputError` where the scene has no task, or one that nothing could do.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene is {type(scene).__name__}; expected a Scene (Scene.load, Scene.tabletop)")
    context = Context.begin(scene, np.random.default_rng(seed) if rng is None else rng, observer)
    steps = process or Process.default(context.hand)
    records: list[StepRecord] = []
    marks: list[float] = []
    for record in steps.run(context):
        records.append(record)
        marks.append(context.world.time)
    verdict = _verdict(context, records)
    data, meshes = scene_data(scene)
    return Episode(
        title=f"{scene.robot.name} picks {context.name}",
        inputs=_inputs(context, seed),
        steps=tuple(records),
        verdict=verdict,
        scene=data,
        recording=recording_data(context, marks),
        meshes=meshes,
    )


def _verdict(context: Context, records: Sequence[StepRecord]) -> Verdict:
    last = records[-1]
    if last.status is StepStatus.FAILED:
        status = EpisodeStatus.DROPPED if context.dropped else EpisodeStatus.FAILED_STEP
        return Verdict(status, f"{last.title} failed: {last.message}", slip=context.slip)
    return judge(context)


def _inputs(context: Context, seed: int) -> dict[str, Any]:
    scene, body = context.scene, context.body
    repairs = [str(r) for r in scene.robot.description.repairs] + [f"{body.name}: {r}" for r in body.repairs]
    return {
        "robot": scene.robot_source.arm, "hand": scene.robot_source.hand, "body": body.name, "mass": body.mass,
        "friction": body.friction, "scene": scene.source, "seed": seed,
        "repairs": repairs, "assumptions": list(context.world.plant.assumptions),
    }  # fmt: skip
