"""What MOG2 keeps out of its background, on drawn frames."""

from __future__ import annotations

import pytest

from heel.services.detector.core import Detector
from heel.services.detector.mog2 import Protection
from heel.services.detector.settings import DetectorSettings
from heel.services.detector.work_size import WorkSize
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


def visible_after_standing(settings: DetectorSettings, frames: int, **track: object) -> bool:
    detector = Detector(settings)
    for seq in range(30):
        detector.detect(frame_id(seq), frame_image(), SIZE, None)
    message = None
    for seq in range(30, 30 + frames):
        feedback = tracks_of(seq - 2, [PERSON], **track)
        message = detector.detect(frame_id(seq), frame_image([PERSON]), SIZE, feedback)
    assert message is not None
    return len(message.blobs) == 1


@pytest.mark.parametrize(
    ("settings", "track", "frames", "seen"),
    [
        ({}, {}, 70, True),
        ({}, {"state": "occluded"}, 70, True),
        ({}, {}, 280, False),
        ({"protect": False}, {}, 70, False),
        ({}, {"shown": False}, 70, False),
        ({}, {"state": "new"}, 70, False),
        ({}, {"state": "lost"}, 70, False),
        ({"preset": "paper", "background": None}, {}, 70, False),
    ],
    ids=str,
)
def test_only_confirmed_people_who_move_are_kept_out_of_the_background(
    settings: dict[str, object], track: dict[str, object], frames: int, seen: bool
) -> None:
    model = DetectorSettings.model_validate({"detector": "mog2", **settings})
    assert visible_after_standing(model, frames, **track) is seen


def test_protection_moves_ahead_with_the_person() -> None:
    protection = Protection(WorkSize.of_frame(WIDTH, HEIGHT, 480), 0.1, 10.0)
    feedback = tracks_of(28, [(20, 60, 40, 120)], velocity_pxps=(400.0, 0.0))
    mask = protection.mask(feedback, frame_id(30))
    assert mask[100, 120]
    assert not mask[100, 40]
