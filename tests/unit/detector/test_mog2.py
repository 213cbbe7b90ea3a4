"""What the paper's detector learns, on drawn frames."""

from __future__ import annotations

import pytest

from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import (
    HEIGHT,
    WIDTH,
    Person,
    frame_id,
    frame_image,
    tracks_of,
)

PERSON: Person = (100, 60, 40, 120)
SIZE = (WIDTH, HEIGHT)


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize(("frames", "seen"), [(3, 1), (280, 0)])
def test_a_person_that_stands_becomes_background_tracked_or_not(
    preset: str, frames: int, seen: int
) -> None:
    detector = Detector(DetectorSettings.model_validate({"detector": "mog2", "preset": preset}))
    for seq in range(30):
        detector.detect(frame_id(seq), frame_image(), SIZE, None)
    for seq in range(30, 30 + frames):
        feedback = tracks_of(seq - 2, [PERSON])
        message = detector.detect(frame_id(seq), frame_image([PERSON]), SIZE, feedback)
    assert len(message.blobs) == seen
