"""The rules by which evidence changes a network's boxes, and the rows that are printed of them."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.two_front_ends import (
    RULES,
    Beside,
    Fitted,
    Watched,
    completed,
    confirmed,
    left_out,
    rows,
    shared_boxes,
    split,
)
from heel.evaluation.sequence_scores import SequenceScores
from heel.schemas import Blobs, FrameId
from heel.schemas.base import BoxXyxy
from heel.schemas.blobs import MAX_BLOBS
from heel.services.detector.messages import person_blobs
from heel.services.detector.scene import WorkSize

SIZE = (320, 240)
LEFT, RIGHT = (100.0, 60.0, 140.0, 160.0), (135.0, 64.0, 175.0, 164.0)
BOTH = (100.0, 60.0, 175.0, 164.0)
FAR = (250.0, 60.0, 290.0, 160.0)


def message(*boxes: tuple[BoxXyxy, float]) -> Blobs:
    image = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    return Blobs(
        stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=SIZE[0], height=SIZE[1],
        source_width=SIZE[0], source_height=SIZE[1], kind="people", detector="onnx",
        blobs=tuple(person_blobs(boxes, image)),
    )  # fmt: skip


def frame(
    sent: Blobs, *people: BoxXyxy, steady: bool = True, foreground: float = 1.0
) -> Watched:  # fmt: skip
    fitted = [Fitted(blob, steady) for blob in message(*((box, 0.5) for box in people)).blobs]
    return Watched(sent, tuple(fitted), (foreground,) * len(sent.blobs))


def boxes(blobs: Blobs) -> list[BoxXyxy]:
    return [blob.box_xyxy for blob in blobs.blobs]


def test_a_box_around_two_becomes_two_with_its_score() -> None:
    seen = frame(message((BOTH, 0.8), (FAR, 0.6)), LEFT, RIGHT)
    changed = split(seen, steady=True)
    assert sorted(boxes(changed)) == [LEFT, RIGHT, FAR]
    assert [blob.score for blob in changed.blobs] == [0.8, 0.8, 0.6]


def test_people_who_are_not_steady_split_nothing_unless_any_may() -> None:
    seen = frame(message((BOTH, 0.8)), LEFT, RIGHT, steady=False)
    assert split(seen, steady=True) == seen.sent
    assert sorted(boxes(split(seen, steady=False))) == [LEFT, RIGHT]
    assert left_out(seen) == completed(seen) == seen.sent


@pytest.mark.parametrize(
    ("people", "why"),
    [
        ((LEFT,), "one person"),
        ((LEFT, FAR), "the other one is elsewhere"),
        ((LEFT, (104.0, 62.0, 144.0, 162.0)), "one behind the other, not beside"),
        ((BOTH, RIGHT), "one of them alone is as good"),
    ],
)
def test_a_box_stays_whole(people: tuple[BoxXyxy, ...], why: str) -> None:
    seen = frame(message((BOTH, 0.8)), *people)
    assert split(seen, steady=True) == seen.sent, why


def test_each_person_is_of_the_nearest_box_alone() -> None:
    sent = message((BOTH, 0.8), (LEFT, 0.7))
    assert shared_boxes(sent, message((LEFT, 0.5), (RIGHT, 0.5)).blobs) == {}


def test_shared_boxes_are_left_out_and_others_stay() -> None:
    seen = frame(message((BOTH, 0.8), (FAR, 0.6)), LEFT, RIGHT)
    assert boxes(left_out(seen)) == [FAR]


def test_people_the_network_misses_are_added_and_the_others_are_not() -> None:
    seen = frame(message((LEFT, 0.8)), LEFT, FAR)
    assert boxes(completed(seen)) == [LEFT, FAR]
    assert boxes(completed(frame(message(), FAR))) == [FAR]


def test_boxes_without_foreground_are_left_out() -> None:
    sent = message((LEFT, 0.8), (FAR, 0.6))
    assert boxes(confirmed(frame(sent, foreground=0.02))) == []
    assert confirmed(frame(sent, foreground=0.4)) == sent


def test_no_rule_makes_a_message_too_long() -> None:
    many = message(*((LEFT, 0.8) for _ in range(MAX_BLOBS)))
    for rule in RULES.values():
        assert len(rule(frame(many, FAR)).blobs) <= MAX_BLOBS


def test_nothing_is_known_of_the_people_while_the_background_is_learned() -> None:
    beside = Beside(WorkSize.of_frame(*SIZE, 480))
    first = FrameId(stream="front", epoch=1, seq=0, index=0, t_capture_ns=0)
    image = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    sent = message((LEFT, 0.8))
    seen = beside.watch(first, image, sent, None)
    assert (seen.people, seen.foreground) == ((), (1.0,))
    assert all(rule(seen) == sent for rule in RULES.values())


def test_a_row_has_the_means_and_each_recording() -> None:
    def scores(keep: float, wrong: float) -> SequenceScores:
        return SequenceScores(
            sequence="x", mota=50, motp=70, idf1=60, hota=40, idsw=0, fp=0, fn=0, boxes=1,
            keep=keep, wrong=wrong, wrong_apart=wrong, dice=50,
        )  # fmt: skip

    line = rows("net", {"as sent": [(scores(80, 2), 3), (scores(90, 0), 4)]})
    assert line == ["| net | as sent | 7 | 50.0 | 60.0 | 85.0 | 1.0 | 80.0, 2.0 | 90.0, 0.0 |"]
