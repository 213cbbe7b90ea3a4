"""An id has one colour: the page's, the film's and the plots' come from the same numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from heel.schemas import Track, Tracks
from heel.services.colours import HUE_STEP_DEG, LIGHTNESS, SATURATION, UNSURE_BELOW, colour_of
from heel.services.drawing import Annotator
from heel.services.follower.settings import FollowerSettings

PAGE = (Path(__file__).parents[2] / "services/web/static/picture.js").read_text(encoding="utf-8")


def test_the_page_has_the_same_numbers() -> None:
    found = re.search(r"hsl\(\$\{\(id \* ([\d.]+)\) % 360\} (\d+)% (\d+)%\)", PAGE)
    assert found is not None
    assert [float(each) for each in found.groups()] == pytest.approx(
        [HUE_STEP_DEG, 100 * SATURATION, 100 * LIGHTNESS]
    )


def test_page_and_film_call_unsure_what_the_follower_does() -> None:
    found = re.search(r"const UNSURE_BELOW = ([\d.]+);", PAGE)
    assert found is not None
    assert float(found[1]) == UNSURE_BELOW == FollowerSettings().min_identity_confidence


def test_the_film_draws_that_colour() -> None:
    track = Track(
        id=1, state="tracked", box_xyxy=(20.0, 20.0, 60.0, 90.0), velocity_pxps=(0.0, 0.0),
        area_px=1.0, span_px=1.0, identity_confidence=1.0, shown=True,
    )  # fmt: skip
    tracks = Tracks(
        stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=100, height=100,
        source_width=100, source_height=100, tracks=(track,),
    )  # fmt: skip
    picture = Annotator().draw(np.zeros((100, 100, 3), np.uint8), tracks, None, "")
    assert picture[50, 20, ::-1] / 255 == pytest.approx(np.array(colour_of(1)), abs=0.01)


def test_neighbours_differ() -> None:
    colours = np.array([colour_of(number) for number in range(1, 9)])
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2)
    assert apart[np.triu_indices(8, 1)].min() > 0.15
