"""Since when nobody has answered: a detector that stands by takes over by it."""

from __future__ import annotations

from heel.schemas import Blobs
from heel.services.detector.service import Unanswered, _Found
from tests.unit.tracker.drawn_detections import message

PERIOD_S = 0.04


def found(seq: int) -> _Found:
    return _Found(answer(seq), 0.0, 100.0 + PERIOD_S * seq)


def answer(seq: int) -> Blobs:
    return message([], seq, 25.0)


def test_silence_is_counted_from_the_first_frame_without_an_answer() -> None:
    """At 25 frames a second the two that are kept are never older than a tenth of a second."""
    waiting = Unanswered()
    for seq in range(25):
        waiting.add(found(seq))
    assert waiting.since_s == 100.0
    assert [one.blobs.seq for one in waiting.newest] == [23, 24]


def test_an_answer_is_one_of_all_frames_before_it() -> None:
    waiting = Unanswered()
    for seq in range(4):
        waiting.add(found(seq))
    waiting.answered(answer(2))
    assert waiting.since_s == 100.0 + PERIOD_S * 3
    waiting.answered(answer(3))
    assert waiting.since_s is None
    waiting.add(found(4))
    assert waiting.since_s == 100.0 + PERIOD_S * 4
    waiting.clear()
    assert (waiting.since_s, len(waiting.newest)) == (None, 0)
