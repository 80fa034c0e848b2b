"""The report of an episode: one HTML file with pictures, numbers and charts inside, readable without a network."""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import replace_file
from .charts import joint_charts, load_charts
from .picture import Image, jpeg
from .plots import Chart, legend, svg
from .record import Record
from .stage import Stage, read
from .studio import Contacts, Studio
from .style import CSS, SCRIPT
from .words import number, quantity

if TYPE_CHECKING:
    from ..process import Episode

HERO, FRAME, CLOSE = (1020, 700), (500, 356), (720, 480)
"""Sizes of the pictures in pixels."""
FRAMES = 8
"""Most pictures in the film strip."""
READOUT = 900
"""Samples that the page keeps for reading values under the pointer."""


def write_report(episode: str | Path | Mapping[str, Any] | Episode, path: str | Path) -> Path:
    """Write the HTML report of *episode* (file, directory, data, or `Episode`) to *path*, whole or not at all."""
    data, stage = read(episode)
    text = page(data, stage)
    target = Path(path)
    with replace_file(target) as work:
        work.write_text(text, encoding="utf-8")
    return target


def page(data: Mapping[str, Any], stage: Stage) -> str:
    """The text of the report."""
    record = Record.of(data) if data.get("recording", {}).get("t") else None
    charts = [*load_charts(record, data), *joint_charts(record, stage)] if record else []
    studio = Studio.of(stage, record)
    body = [
        _head(data),
        f'<div class="top">{_hero(studio, data)}<div class="tiles">{_tiles(data, record)}</div></div>',
        _film(studio),
        _grasp(studio, data),
        _steps(data["steps"]),
        _charts(charts),
        _inputs(data),
    ]
    title = html.escape(data["title"])
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{CSS}</style></head>'
        f"<body><main>{''.join(body)}</main>"
        f'<script type="application/json" id="data">{_readout(charts, record)}</script><script>{SCRIPT}</script>'
        "</body></html>\n"
    )


def _head(data: Mapping[str, Any]) -> str:
    good = data["verdict"]["success"]
    badge = f'<span class="badge{"" if good else " bad"}">{"Placed" if good else "Failed"}</span>'
    reason = html.escape(data["verdict"]["reason"])
    return f'<h1>{html.escape(data["title"])}</h1><div class="verdict">{badge}<span>{reason}</span></div>'


def _hero(studio: Studio, data: Mapping[str, Any]) -> str:
    record = studio.record
    if record is None:
        return _figure(studio.shot(None, HERO), "The scene")
    sample, caption = len(record.time) - 1, "At the end"
    for name in ("lift", "rate", "close", "approach"):
        index = next((i for i, s in enumerate(data["steps"]) if s["name"] == name), None)
        if index is not None and (record.step == index).any():
            sample = int(np.flatnonzero(record.step == index)[-1])
            caption = data["steps"][index]["title"]
            break
    goal = "; green: where it should go" if studio.stage.ghosts else ""
    return _figure(studio.shot(sample, HERO), f"<b>{html.escape(caption)}</b> at {record.time[sample]:.2f} s{goal}")


def _film(studio: Studio) -> str:
    record = studio.record
    if record is None:
        return ""
    bands = sorted(record.bands, key=lambda b: b.start - b.stop)[:FRAMES]
    shots = []
    for band in sorted(bands, key=lambda b: b.start):
        if band.stop - band.start < 0.03:
            continue
        caption = f"<b>{html.escape(band.label)}</b>, until {band.stop:.2f} s"
        shots.append(_figure(studio.shot(record.at(band.stop), FRAME), caption))
    if len(shots) < 2:
        return ""  # the picture above shows it
    return f'<h2>What happened</h2><div class="film">{"".join(shots)}</div>'


def _grasp(studio: Studio, data: Mapping[str, Any]) -> str:
    """The object in the closed hand from two sides, with what is known of the contacts."""
    record, body, contacts = studio.record, (data["scene"].get("goal") or {}).get("body"), Contacts.of(data)
    closed = [i for i, s in enumerate(data["steps"]) if s["name"] == "close" and s["status"] == "success"]
    if record is None or contacts is None or body is None or body not in record.bodies or not closed:
        return ""
    samples = np.flatnonzero(record.step == closed[-1])
    if not len(samples):
        return ""
    sample, half = int(samples[-1]), math.degrees(math.atan(contacts.friction))
    cones = f"The planned contacts and their friction cones: µ = {contacts.friction:g}, half angle {half:.1f}°"
    shots = _figure(studio.close_up(body, contacts, sample, CLOSE, across=True), cones)
    shots += _figure(studio.close_up(body, contacts, sample, CLOSE, across=False), "Along the line on which it closes")
    return f'<h2>The grasp</h2><div class="pair">{shots}</div>'


def _figure(image: Image, caption: str) -> str:
    data = base64.b64encode(jpeg(image)).decode()
    height, width = image.shape[:2]
    plain = html.escape(html.unescape(caption.replace("<b>", "").replace("</b>", "")), quote=True)
    return (
        f'<figure><img src="data:image/jpeg;base64,{data}" width="{width}" height="{height}" alt="{plain}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _tiles(data: Mapping[str, Any], record: Record | None) -> str:
    verdict, steps = data["verdict"], data["steps"]
    tiles = [
        ("position error", verdict.get("position_error"), 1e3, "mm", 2),
        ("angle error", verdict.get("angle_error"), 180.0 / math.pi, "°", 2),
        ("slip in the hand", verdict.get("slip"), 1e3, "mm", 2),
        ("time to plan and simulate", sum(s["duration"] for s in steps), 1.0, "s", 1),
    ]
    if record is not None:
        tiles.append(("length of the motion", float(record.time[-1]), 1.0, "s", 1))
        if record.force.max() > 0.0:
            tiles.append(("largest net force of the hand", float(record.force.max()), 1.0, "N", 1))
    plan = next((s for s in steps if s["name"] == "plan"), None)
    if plan and plan["outputs"].get("width") is not None:
        tiles.append(("width of the grasp", plan["outputs"]["width"], 1e3, "mm", 1))
    if data["inputs"].get("mass") is not None:
        tiles.append(("mass of the object", data["inputs"]["mass"], 1.0, "kg", 3))
    return "".join(
        f'<div class="tile"><div class="value">{number(value * factor, digits)} <small>{unit}</small></div>'
        f'<div class="name">{name}</div></div>'
        for name, value, factor, unit, digits in tiles
        if value is not None
    )


def _steps(steps: Sequence[Mapping[str, Any]]) -> str:
    longest = max((s["duration"] for s in steps), default=1.0) or 1.0
    signs = {"success": '<span class="mark ok">✓</span>', "failed": '<span class="mark no">✗</span>'}
    rows = []
    for i, step in enumerate(steps, 1):
        details = _pairs({**step.get("inputs", {}), **step.get("outputs", {})})
        more = f"<details><summary>inputs and outputs</summary>{details}</details>" if details else ""
        rows.append(
            f'<tr><td class="n">{i}</td><td>{signs.get(step["status"], "<span class=mark>–</span>")}'
            f"<b>{html.escape(step['title'])}</b></td><td>{html.escape(step['message'])}{more}</td>"
            f'<td class="margins">{_pairs(step.get("margins", {}))}</td>'
            f'<td class="n">{step["duration"]:.3f} s'
            f'<span class="bar" style="width:{60 * step["duration"] / longest:.1f}px"></span></td>'
            f'<td class="n">{step.get("simulated", 0.0):.2f} s</td></tr>'
        )
    return (
        '<h2>Steps</h2><div class="card scroll"><table><thead><tr><th class="n">#</th><th>step</th><th>outcome</th>'
        '<th>margins</th><th class="n">computed in</th><th class="n">motion</th></tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _pairs(values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<dt>{html.escape(name.replace('_', ' '))}</dt><dd>{html.escape(quantity(name, value))}</dd>"
        for name, value in values.items()
        if value is not None
    )
    return f"<dl>{rows}</dl>" if rows else ""


def _charts(charts: Sequence[Chart]) -> str:
    if not charts:
        return ""
    wide = [(i, c) for i, c in enumerate(charts) if c.bands]
    small = [(i, c) for i, c in enumerate(charts) if not c.bands]
    out = ['<h2>Motion and forces</h2><div class="charts">']
    out += [_card(i, c, 1060, 190, True) for i, c in wide]
    out.append('</div><h2>Joint positions within their limits</h2><div class="joints">')
    out += [_card(i, c, 340, 140, False) for i, c in small]
    return "".join(out) + "</div>"


def _card(index: int, chart: Chart, width: int, height: int, wide: bool) -> str:
    rest = html.escape(chart.note, quote=True)
    unit = f' <span class="soft">in {html.escape(chart.unit)}</span>' if chart.unit else ""
    return (
        f'<section class="card"><header class="{"wide" if wide else "small"}"><h3>{html.escape(chart.title)}{unit}</h3>'
        f'<span class="readout" data-chart="{index}" data-rest="{rest}">{rest}</span></header>'
        f"{legend(chart) if wide else ''}{svg(chart, width, height, labels=wide)}</section>"
    )


def _readout(charts: Sequence[Chart], record: Record | None) -> str:
    """The values under the pointer, as JSON, thinned and rounded to what is shown."""
    if record is None:
        return '{"t": [], "charts": []}'
    keep = np.unique(np.linspace(0, len(record.time) - 1, READOUT).astype(int))
    data = {
        "t": np.round(record.time[keep], 3).tolist(),
        "charts": [
            [
                [ln.label if len(c.lines) > 1 else "", np.round(ln.values[keep], c.digits).tolist()]
                for ln in c.lines
                if ln.shade >= 0
            ]
            for c in charts
        ],
    }
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _inputs(data: Mapping[str, Any]) -> str:
    pairs = _pairs(dict(data["inputs"]))
    return f'<h2>Inputs</h2><div class="card">{pairs}</div>' if pairs else ""
