"""Pictures of bodies and models in the plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apprehend import Body
from apprehend.bodies import MODELS, Boxes, draw, save_picture
from apprehend.errors import InputError, UnknownNameError

pytest.importorskip("matplotlib")


def test_every_model_is_drawn_within_its_bounds() -> None:
    body = Body.household("can")
    low, high = 1e3 * body.bounds
    for name in MODELS:
        axes = draw(body.model(name))
        assert axes.get_xlabel() == "x in mm"
        assert axes.get_ylabel() == "z in mm"
        assert axes.get_xlim()[0] <= low[0] + 1.0
        assert axes.get_xlim()[1] >= high[0] - 1.0
        assert axes.get_ylim()[1] >= high[2] - 1.0
    axes = draw(body.distance_field(0.005), view="top")
    assert axes.get_xlabel() == "x in mm"
    assert axes.get_ylabel() == "y in mm"
    assert draw(body, body.section(), view=[1.0, 1.0, 0.0]).get_xlabel() == "(-0.71, 0.71, 0.00) in mm"


def test_the_filled_area_is_that_of_the_silhouette() -> None:
    boxes = Boxes(np.eye(4)[None], np.array([[0.1, 0.2, 0.3]]))
    for view, area in (("front", 0.03), ("side", 0.06), ("top", 0.02)):
        patch = draw(boxes, view=view).patches[0]
        width, height = np.ptp(patch.get_path().vertices, axis=0) / 1e3
        assert width * height == pytest.approx(area, rel=1e-6)


def test_pictures_are_written(tmp_path: Path) -> None:
    body = Body.household("mug")
    for name in ("mug.png", "mug.svg", "mug.pdf"):
        assert save_picture(tmp_path / name, body, body.wireframe()).stat().st_size > 3000
    with pytest.raises(InputError, match=r"mug\.gif is not a picture's name"):
        save_picture(tmp_path / "mug.gif", body)


def test_what_cannot_be_drawn() -> None:
    body = Body.household("mug")
    with pytest.raises(InputError, match="nothing to draw"):
        draw()
    with pytest.raises(InputError, match="cannot draw a int"):
        draw(3)
    with pytest.raises(UnknownNameError, match=r"no view named 'fron'.*'front'"):
        draw(body, view="fron")
    with pytest.raises(InputError, match="view is zero"):
        draw(body, view=[0.0, 0.0, 0.0])
