"""A detector that comes after a crash looks for the person that the one before has looked for."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from heel.schemas import Blobs, HeelError
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import frame_id
from tests.unit.detector.test_pointed import HEIGHT, WIDTH, person_box, pointed, seen

_BEFORE = 20
_AFTER = range(150, 158)
"""Frames 5 s later."""


@cache
def left() -> bytes:
    """By a detector that has looked for the person at column 200 for a while."""
    detector = Detector(DetectorSettings())
    for seq in range(_BEFORE):
        point = pointed(200, 180) if seq == 1 else None
        blobs = detector.detect(frame_id(seq), seen(200 + seq), (WIDTH, HEIGHT), None, point)
    assert blobs.kind == "people"
    assert len(blobs.blobs) == 1
    state = detector.snapshot()
    assert state is not None
    return state


def after(detector: Detector, x: float | None, other: float | None = None) -> Blobs:
    """The last answer of one that goes on in pictures of 5 s later."""
    for seq in _AFTER:
        picture = seen(x, other=other)
        blobs = detector.detect(frame_id(seq), picture, (WIDTH, HEIGHT), None)
    return blobs


def test_the_person_is_found_again_wherever_they_are_by_now() -> None:
    detector = Detector(DetectorSettings())
    detector.restore(left())
    blobs = after(detector, 380)
    assert blobs.kind == "people"
    assert blobs.sought == 1, "the same person to the tracker, which so keeps the id"
    (found,) = blobs.blobs
    assert abs(np.mean(found.box_xyxy[::2]) - np.mean(person_box(380, 150)[::2])) < 15


def test_nobody_else_is_taken_for_them() -> None:
    detector = Detector(DetectorSettings())
    detector.restore(left())
    blobs = after(detector, None, other=300)
    assert (blobs.kind, blobs.blobs) == ("people", ())


def test_in_other_pictures_nobody_is_looked_for() -> None:
    detector = Detector(DetectorSettings())
    detector.restore(left())
    frame = frame_id(0).model_copy(update={"epoch": 77})
    blobs = detector.detect(frame, seen(200), (WIDTH, HEIGHT), None)
    assert blobs.kind == "regions"


def test_one_that_looked_for_nobody_leaves_nobody() -> None:
    before = Detector(DetectorSettings())
    before.detect(frame_id(0), seen(200), (WIDTH, HEIGHT), None)
    detector = Detector(DetectorSettings())
    detector.restore(before.snapshot() or b"")
    assert after(detector, 200).kind == "regions"


@pytest.mark.parametrize("spoil", ["cut", "flipped", "other settings"])
def test_what_is_no_state_is_refused_and_changes_nothing(spoil: str) -> None:
    state = left()
    if spoil == "cut":
        state = state[:-40]
    elif spoil == "flipped":
        state = state.replace(b"PointedPerson", b"PointedParson")
    work_width_px = 240 if spoil == "other settings" else DetectorSettings().work_width_px
    detector = Detector(DetectorSettings(work_width_px=work_width_px))
    with pytest.raises(HeelError):
        detector.restore(state)
    assert after(detector, 200).kind == "regions"


def test_a_detector_without_a_state_says_so() -> None:
    detector = Detector(DetectorSettings(detector="mixture"))
    assert detector.snapshot() is None
    with pytest.raises(HeelError, match="keeps no state"):
        detector.restore(b"")
