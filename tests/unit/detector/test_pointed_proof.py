"""Whether a place pointed at is a person: what shows a box, and what lets a robot drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from heel.schemas import Blobs, Pointed
from heel.services.detector.core import Detector
from heel.services.detector.pointed.proof import MovementWatch, Proof
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.picture_motion import estimate_turn
from tests.unit.detector.drawn_scene import FPS, frame_id
from tests.unit.detector.test_pointed import (
    HEIGHT,
    SHIRT,
    TROUSERS,
    WIDTH,
    Picture,
    draw,
    on_person,
    overlap,
    person_box,
    pointed,
    seen,
)

X, TALL = 240.0, 150.0


def play(
    picture: Callable[[int], Picture], frames: int, points: dict[int, Pointed] | None = None
) -> list[Blobs]:
    """Half a second of waiting, a click on the middle of the picture, and so many frames more."""
    detector = Detector(DetectorSettings())
    points = points or {0: pointed(X, 160.0)}
    return [
        detector.detect(frame_id(seq), picture(seq), (WIDTH, HEIGHT), None, points.get(seq))
        for seq in range(frames)
    ]


def proven(messages: Sequence[Blobs]) -> list[int]:
    return [m.seq for m in messages if m.kind == "people" and m.blobs and m.blobs[0].proven]


def shown(messages: Sequence[Blobs]) -> list[int]:
    return [m.seq for m in messages if m.kind == "people" and m.blobs]


def locker(picture: Picture, x: float) -> Picture:
    """As tall and as colourful as a person, but without head and shoulders."""
    _, top, _, bottom = (round(side) for side in person_box(x, TALL))
    columns = slice(round(x - 0.14 * TALL), round(x + 0.14 * TALL))
    picture[top:bottom, columns] = TROUSERS
    picture[top : round(top + 0.5 * TALL), columns] = SHIRT
    return picture


def walked(seq: int, from_seq: int) -> float:
    return X + 2.5 * max(0, seq - from_seq)


def test_who_only_stands_is_shown_with_a_doubt_and_is_not_proven() -> None:
    messages = play(lambda seq: seen(X), 20)
    assert shown(messages) == list(range(20))
    assert not proven(messages)
    assert {message.blobs[0].score for message in messages} == {0.6}


def test_who_walks_is_proven_soon_after() -> None:
    messages = play(lambda seq: seen(walked(seq, 20)), 45)
    first = proven(messages)[0]
    assert 20 < first <= 32
    assert proven(messages) == list(range(first, 45))
    assert on_person(messages[-1], walked(44, 20))
    assert (messages[-1].blobs[0].score or 0.0) > 0.6


@pytest.mark.parametrize("pan", [1, 3])
def test_what_a_turning_camera_sees_does_not_walk(pan: int) -> None:
    messages = play(lambda seq: seen(X - pan * seq, pan=pan * seq), 30)
    assert len(shown(messages)) > 15
    assert not proven(messages)


def test_a_thing_without_head_and_shoulders_is_never_shown_and_left_after_a_while() -> None:
    messages = play(lambda seq: locker(seen(None), X), 56)
    assert not shown(messages)
    kinds = [message.kind for message in messages]
    left = kinds.index("regions")
    assert 5.0 < left / FPS < 5.4
    assert kinds == ["people"] * left + ["regions"] * (56 - left)


def test_something_without_them_that_walks_off_was_somebody() -> None:
    messages = play(lambda seq: locker(seen(None), walked(seq, 20)), 50)
    first = shown(messages)[0]
    assert 20 < first <= 42
    assert proven(messages)[0] == first
    last = messages[-1].blobs[0].box_xyxy
    assert overlap(last, person_box(walked(49, 20), TALL)) > 0.3


@pytest.mark.parametrize("step", [4.0, 7.0])
def test_who_passes_by_a_thing_makes_it_no_person(step: float) -> None:
    def passing(seq: int) -> Picture:
        picture = locker(seen(None), X)
        draw(picture, 60.0 + step * max(0, seq - 10), TALL * 1.05)
        return picture

    assert not proven(play(passing, 55))


def test_who_walks_straight_away_is_proven_while_they_are_near() -> None:
    def leaving(seq: int) -> Picture:
        return seen(X, TALL * 3.0 / (3.0 + 0.06 * max(0, seq - 15)))

    first = proven(play(leaving, 40))[0]
    assert 15 < first <= 30, "1.2 m/s from 3 m on, 20 frames a second"


def test_something_small_that_walks_within_a_larger_box_is_not_who_is_in_it() -> None:
    evidence, box = Proof(), person_box(X, 240.0)
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    free[:, round(box[0]) - 24 : round(box[2]) + 24] = 0
    for seq in range(30):
        picture = locker(seen(None), X)
        low, left = round(box[3]), round(200.0 + 2.0 * seq)
        picture[low - 70 : low, left : left + 36] = (30, 30, 30)
        picture[low - 60 : low - 20, left + 8 : left + 30] = (200, 220, 230)
        evidence.look(np.ascontiguousarray(picture[..., 1]), box, free, seq / FPS)
    assert not evidence.proves


def test_nothing_is_told_of_a_box_whose_background_is_seen_on_one_side_only() -> None:
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    for x, told in ((240.0, True), (70.0, False), (WIDTH - 60.0, False)):
        watch, movement = MovementWatch(), None
        for seq in range(8):
            grey = np.ascontiguousarray(seen(x, TALL * 1.4)[..., 1])
            movement = watch.look(grey, person_box(x, TALL * 1.4), free, seq / FPS)
        assert (movement is not None) == told


def test_clicking_again_on_the_same_place_goes_on_watching_it() -> None:
    points = {seq: pointed(walked(seq, 20), 160.0) for seq in range(0, 60, 7)}
    messages = play(lambda seq: locker(seen(None), walked(seq, 20)), 50, points)
    assert shown(messages)[0] <= 42
    assert {message.sought for message in messages} == {1}


def test_a_turn_is_a_homography_and_a_picture_of_something_else_is_none() -> None:
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    before, now = (np.asarray(seen(None, pan=pan)[..., 1]) for pan in (0, 6))
    turn = estimate_turn(before, now, free)
    assert turn is not None
    moved = turn @ np.array([200.0, 100.0, 1.0])
    assert moved[:2] / moved[2] == pytest.approx([194.0, 100.0], abs=0.3)
    noise = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH), np.uint8)
    assert estimate_turn(before, noise, free) is None
