"""Who is shown among people whom a network finds: not the distant, not those who have left."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.tracker.boxes.frame import checked
from heel.services.tracker.boxes.sequence import box_tracker
from heel.services.tracker.people.tuning import ROBOT
from heel.services.tracker.report import Report

IMAGE = (1000, 500)
FPS = 10.0
Box = tuple[float, float, float, float]


def person(x: float, height: float, foot: float = 400.0) -> Box:
    """A standing person's box by the middle of the foot line."""
    return x - 0.2 * height, foot - height, x + 0.2 * height, foot


def shown(frames: list[list[Box]], scores: float = 0.9) -> list[list[Report]]:
    """Shown tracks of every frame of boxes."""
    tracker = box_tracker(ROBOT, IMAGE)
    said = []
    for index, boxes in enumerate(frames):
        found = tracker.update(
            checked(np.array(boxes).reshape(-1, 4), np.full(len(boxes), scores)), index / FPS
        )
        said.append([track for track in found if track.shown])
    return said


@pytest.mark.parametrize(
    ("heights", "count"),
    [
        ((200.0, 30.0), 1),  # below 8 % of the picture, with somebody near
        ((200.0, 60.0), 2),
        ((30.0,), 1),  # alone
        ((30.0, 32.0), 2),  # nobody nearer
    ],
)
def test_distant_newcomers_are_left_while_somebody_nearer_is_in_sight(
    heights: tuple[float, ...], count: int
) -> None:
    people = [person(200 + 300 * k, height) for k, height in enumerate(heights)]
    assert len(shown([people] * 20)[-1]) == count


def test_who_comes_nearer_is_shown() -> None:
    near = person(200, 200)
    frames = [[near, person(600, 25 + 0.6 * k)] for k in range(60)]
    assert len(shown(frames)[15]) == 1
    assert len(shown(frames)[-1]) == 2


def test_a_known_person_who_walks_away_stays_known() -> None:
    near = person(200, 200)
    frames = [[near, person(600, 60 - 0.5 * k)] for k in range(60)]
    said = shown(frames)
    assert len(said[5]) == len(said[-1]) == 2
    assert {track.id for track in said[5]} == {track.id for track in said[-1]}


@pytest.mark.parametrize(
    ("x", "foot", "still"),
    [
        (500.0, 400.0, True),
        (985.0, 400.0, False),  # at the right side
        (15.0, 400.0, False),
        (500.0, 499.0, True),  # near people reach the lower edge all the time
    ],
)
def test_for_a_frame_without_a_box_people_are_shown_but_at_the_sides(
    x: float, foot: float, still: bool
) -> None:
    said = shown([[person(x, 150, foot)]] * 10 + [[]])
    assert len(said[-2]) == 1
    assert len(said[-1]) == int(still)


def test_a_known_person_is_shown_on_weak_boxes_and_a_newcomer_is_not() -> None:
    strong, weak = person(300, 150), person(700, 150)
    tracker = box_tracker(ROBOT, IMAGE)
    for index in range(40):
        boxes = [strong] if index < 20 else [strong, weak]
        found = tracker.update(
            checked(np.array(boxes), np.array([0.8, 0.35][: len(boxes)])), index / FPS
        )
    assert sum(track.shown for track in found) == 1
    for index in range(40, 80):
        found = tracker.update(checked(np.array([strong]), np.array([0.36])), index / FPS)
        assert any(track.shown for track in found)
