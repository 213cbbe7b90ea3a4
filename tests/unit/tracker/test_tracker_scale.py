"""When a height line may be used, and when it is seen to be wrong."""

from __future__ import annotations

import numpy as np

from heel.services.tracker.evidence.arrays import FloatMap
from heel.services.tracker.evidence.line import Line
from heel.services.tracker.evidence.runs import Runs
from heel.services.tracker.evidence.scale import SceneScale

ROWS, COLUMNS = 240, 320
HIGH = Line(0.2, 0.0)
"""People that a camera on a post sees: 20 to 44 pixels high."""


def bodies(*places: tuple[int, int, int]) -> FloatMap:
    """Upright bodies of column, foot row and height, working pixels."""
    evidence = np.zeros((ROWS, COLUMNS), np.float32)
    for column, foot, height in places:
        half = round(0.15 * height)
        evidence[foot - height : foot, column - half : column + half] = 1.0
    return evidence


FAR = bodies(*((30 + 40 * k, row, round(HIGH.height(row))) for k, row in
               enumerate((110, 140, 170, 200, 220, 130))))  # fmt: skip
NEAR = bodies((60, 200, 130), (160, 210, 140), (260, 205, 135))


def scale_that_knows() -> SceneScale:
    scale = SceneScale(ROWS, 10.0)
    for row in (110, 140, 170, 200, 220, 130, 150, 190):
        scale.add_blob(float(row), HIGH.height(row))
    for _ in range(5):
        scale.update(FAR)
    return scale


def test_runs_of_people_as_high_as_the_line_says_are_not_overlong() -> None:
    runs = Runs(10.0)
    runs.add(FAR, 0.0)
    assert runs.overlong(HIGH) == 0.0


def test_a_near_person_is_overlong_for_a_line_of_far_people() -> None:
    runs = Runs(10.0)
    runs.add(NEAR, 0.0)
    assert runs.overlong(HIGH) > 0.9


def test_runs_follow_a_camera_that_tilts() -> None:
    runs = Runs(10.0)
    runs.add(np.roll(FAR, 20, axis=0), 20.0)
    assert runs.overlong(HIGH) == 0.0


def test_a_line_that_explains_what_is_seen_is_used() -> None:
    scale = scale_that_knows()
    assert scale.known
    assert abs(scale.height(180.0) / HIGH.height(180.0) - 1.0) < 0.15


def test_a_line_of_far_people_is_given_up_where_near_ones_walk() -> None:
    scale = scale_that_knows()
    for _ in range(100):
        scale.update(NEAR)
    assert scale.refused
    assert scale.refuted == 1


def test_one_near_person_gives_no_line() -> None:
    scale = SceneScale(ROWS, 10.0)
    for _ in range(5):
        scale.add_blob(200.0, 130.0)
        scale.update(bodies((60, 200, 130)))
    assert scale.refused
    assert not scale.known
