"""`show`: an episode in the browser, with a player, its steps, its margins and its loads."""

from __future__ import annotations

import html
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..arrays import Array
from ..errors import InputError
from .charts import load_charts
from .live import Page, Serving, serve
from .marks import ball, friction_cone, tube
from .plots import Chart
from .record import Record
from .stage import Stage, read
from .studio import Contacts, Studio
from .words import number, quantity

if TYPE_CHECKING:
    from ..process import Episode

FRAME_RATE = 30.0
"""Updates per second while playing."""
SPEEDS = {"¼ ×": 0.25, "½ ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "4 ×": 4.0}
COLOURS = ("#2f6db5", "#d9730d", "#2e9e6b", "#b8408f", "#7a5fc0", "#0f8fa3", "#9a7b0a", "#c2413b")
QUIET = "#b4bcc6"
PLOT_POINTS = 400
"""Points of a line in the page's plots."""


def show(
    episode: str | Path | Mapping[str, Any] | Episode,
    **serving: Unpack[Serving],
) -> Page:
    """Replay *episode* (file, directory, data, or `Episode`) on a page; *serving*: see `Serving`."""
    data, stage = read(episode)
    record = Record.of(data)

    def build(page: Page) -> None:
        page.add(stage)
        page.look(Studio.of(stage, record).camera((1400, 900)))
        Player(page, stage, record, data)

    return serve(data["title"], build, **serving)


class Player:
    """Time on the page: a slider, play and pause, speed, and jumps to the steps."""

    def __init__(self, page: Page, stage: Stage, record: Record, data: Mapping[str, Any]) -> None:
        if stage.robot is None:
            raise InputError("the episode names no robot: there is nothing to replay")
        self.page, self.record = page, record
        self.frames = stage.robot.frame_names
        self.links = stage.robot.fk(record.q)
        self._sample = -1
        self._moving = False
        self._build(data)
        self._marks(stage, data)
        self.go(0.0)
        self._before = time.perf_counter()
        page.every(1.0 / FRAME_RATE, self._advance)

    def go(self, seconds: float) -> None:
        """Show the state at a time of the recording."""
        sample = self.record.at(seconds)
        if sample == self._sample:
            return
        self._sample = sample
        self.page.draw(dict(zip(self.frames, self.links[sample])), self.record.poses(sample))
        step = int(self.record.step[sample])
        title = self.record.titles[step] if step < len(self.record.titles) else "End"
        force = self.record.force[sample]
        self.now.content = f"**{title}**  \nnet force of the hand on the object {force:.1f} N"

    def _build(self, data: Mapping[str, Any]) -> None:
        import viser

        gui, end = self.page.server.gui, float(self.record.time[-1])
        gui.add_markdown(_verdict(data))
        with gui.add_folder("Replay"):
            self.now = gui.add_markdown("")
            self.slider: Any = gui.add_slider("time in s", 0.0, round(end, 2), 0.01, 0.0)
            self.play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            self.speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1 ×")
            names = [f"{i + 1}  {band.label}" for i, band in enumerate(self.record.bands)]
            jump = gui.add_dropdown("go to", ("–", *names))
        self.slider.on_update(lambda _: self.go(self.slider.value))
        self.play.on_click(lambda _: self._toggle())

        def leap(_: Any) -> None:
            if jump.value != "–":
                self.slider.value = round(self.record.bands[names.index(jump.value)].start, 2)

        jump.on_update(leap)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Steps"):
            gui.add_html(_steps(data))
        with tabs.add_tab("Loads"):
            for chart in load_charts(self.record, data):
                plot(gui, chart)
        with tabs.add_tab("Show"):
            self._shown = gui

    def _marks(self, stage: Stage, data: Mapping[str, Any]) -> None:
        """Goal, contacts with their cones, and the object's way: each can be hidden."""
        scene, gui, body = self.page.server.scene, self._shown, (data["scene"].get("goal") or {}).get("body")
        groups: dict[str, list[Any]] = {}
        contacts = Contacts.of(data)
        if body is not None and contacts is not None:
            label = f"contacts and friction cones (µ = {contacts.friction:g})"
            size = 0.35 * float(np.ptp(next(t.vertices for t in stage.bodies if t.name == body), axis=0).max())
            groups[label] = []
            for i, (point, normal) in enumerate(zip(contacts.points, contacts.normals)):
                cone = friction_cone(point, normal, contacts.friction, size)
                groups[label] += [
                    self.page.mesh(f"/bodies/{body}/cone{i}", *cone, (0.16, 0.45, 0.80, 0.35)),
                    self.page.mesh(f"/bodies/{body}/contact{i}", *ball(point, 0.04 * size), (0.05, 0.15, 0.45, 1.0)),
                ]
        if (
            body is not None
            and body in self.record.bodies
            and (way := tube(self.record.bodies[body][:, :3, 3], 0.0015))
        ):
            groups[f"way of {body}"] = [self.page.mesh(f"/way of {body}", *way, (0.85, 0.35, 0.10, 0.9))]
        groups["goal"] = [scene.add_frame("/goals", show_axes=False)]
        groups["surroundings"] = [scene.add_frame("/surroundings", show_axes=False)]
        for label, handles in groups.items():
            switch(gui, label, handles)

    def _toggle(self) -> None:
        import viser

        self._moving = not self._moving
        self.play.label = "Pause" if self._moving else "Play"
        self.play.icon = viser.Icon.PLAYER_PAUSE if self._moving else viser.Icon.PLAYER_PLAY
        if self._moving and self.slider.value >= self.record.time[-1] - 0.02:
            self.slider.value = 0.0

    def _advance(self) -> None:
        now = time.perf_counter()
        elapsed, self._before = now - self._before, now
        if not self._moving:
            return
        end = float(self.record.time[-1])
        seconds = min(self.slider.value + elapsed * SPEEDS[self.speed.value], end)
        if seconds == end:
            self._toggle()
        self.slider.value = min(seconds, self.slider.max)
        self.go(seconds)


def switch(gui: Any, label: str, handles: list[Any], *, shown: bool = True) -> None:
    """A checkbox that shows and hides *handles*."""
    box = gui.add_checkbox(label, shown)

    def change(_: Any) -> None:
        for handle in handles:
            handle.visible = box.value

    box.on_update(change)


def _verdict(data: Mapping[str, Any]) -> str:
    verdict = data["verdict"]
    facts = [
        f"{label} {number(verdict[key] * factor, 2)} {unit}"
        for label, key, factor, unit in (
            ("position error", "position_error", 1e3, "mm"),
            ("angle error", "angle_error", 180.0 / np.pi, "°"),
            ("slip", "slip", 1e3, "mm"),
        )
        if verdict.get(key) is not None
    ]
    sign = "✓ **Placed.**" if verdict["success"] else "✗ **Failed.**"
    return f"{sign} {verdict['reason']}\n\n{' · '.join(facts)}"


def _steps(data: Mapping[str, Any]) -> str:
    rows = []
    for i, step in enumerate(data["steps"], 1):
        sign = {"success": "✓", "failed": "✗"}.get(step["status"], "–")
        margins = ", ".join(
            f"{name.replace('_', ' ')} {quantity(name, value)}" for name, value in step.get("margins", {}).items()
        )
        rows.append(
            f'<div style="padding:5px 0;border-bottom:1px solid #8883"><b>{sign} {i} {html.escape(step["title"])}</b> '
            f'<span style="opacity:.65;float:right">{step["duration"]:.2f} s</span><br>{html.escape(step["message"])}'
            f'<br><span style="opacity:.65;font-size:.88em">{html.escape(margins)}</span></div>'
        )
    return f'<div style="font-size:13px;line-height:1.4;padding:2px 10px">{"".join(rows)}</div>'


def plot(gui: Any, chart: Chart) -> None:
    """A chart of the report as one of the page's own plots."""
    from viser import uplot

    keep = np.unique(np.linspace(0, len(chart.time) - 1, PLOT_POINTS).astype(int))
    columns: list[Array] = [chart.time[keep], *(np.asarray(line.values[keep]) for line in chart.lines)]
    series = [uplot.Series(label=chart.axis)]
    for line in chart.lines:
        colour = COLOURS[line.shade] if line.shade >= 0 else QUIET
        series.append(uplot.Series(label=line.label, stroke=colour, width=1.5))
    gui.add_uplot(
        tuple(columns), tuple(series), title=f"{chart.title} in {chart.unit}", aspect=1.7,
        scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
        legend=uplot.Legend(show=True),
    )  # fmt: skip
