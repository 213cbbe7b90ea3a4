"""When a person counts, is somebody's double, a ghost, or gone: people placed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas.blobs import FOREGROUND, MOVING
from heel.services.tracker.evidence.canvas import Canvas
from heel.services.tracker.evidence.lifecycle import (
    is_alive,
    is_person,
    is_torn,
    observe_motion,
    without_duplicates,
)
from heel.services.tracker.evidence.silhouette import Silhouette
from heel.services.tracker.settings import TrackerSettings

RATIO, DT_S = 0.37, 0.1
ROWS, COLUMNS = 240, 320
CANVAS = Canvas((ROWS, COLUMNS), 120.0, 1, RATIO)
SETTINGS = TrackerSettings().reporting("foreground")


def person(
    number: int = 1, height: float = 60.0, moved: float = 0.0, x: float = 160.0
) -> Silhouette:
    return Silhouette(number, (x, 150.0), height, 1.0, confirmed=True, moved=moved)


@pytest.mark.parametrize(
    ("early", "still_s", "moved", "alive"),
    [
        (True, 1.2, 0.3, False),
        (True, 0.8, 0.3, True),
        (True, 60.0, 1.0, True),
        (False, 60.0, 0.0, True),
    ],
    ids=["left behind", "not yet sure", "came there", "later"],
)
def test_what_never_came_there_and_never_moves_is_a_ghost_of_the_start(
    early: bool, still_s: float, moved: float, alive: bool
) -> None:
    one = person(moved=moved)
    one.born_early, one.still_s = early, still_s
    assert is_alive(one, CANVAS, RATIO, SETTINGS) is alive


@pytest.mark.parametrize(
    ("height", "confirmed", "alive"),
    [(19.0, True, True), (19.0, False, False), (16.0, True, False), (25.0, False, True)],
)
def test_known_people_may_walk_farther_away_than_new_ones_are_looked_for(
    height: float, confirmed: bool, alive: bool
) -> None:
    one = person(height=height)
    one.confirmed = confirmed
    assert is_alive(one, CANVAS, RATIO, SETTINGS) is alive


@pytest.mark.parametrize(
    ("best_gain", "for_s", "kept"),
    [(0.5, 0.3, True), (0.5, 0.6, False), (1.0, 0.6, True), (1.0, 2.0, False)],
    ids=["not for long", "double", "hidden", "hidden for long"],
)
def test_a_double_goes_soon_and_somebody_hidden_late(
    best_gain: float, for_s: float, kept: bool
) -> None:
    older, younger = person(1), person(2)
    older.hits, younger.best_gain, younger.gain = 50, best_gain, 0.0
    people = [older, younger]
    for _ in range(round(for_s / DT_S)):
        people = without_duplicates(people, RATIO, DT_S)
    assert (younger in people) is kept
    assert older in people


def test_stillness_counts_while_nothing_moves_and_starts_over_when_it_does() -> None:
    one, still = person(), np.full((ROWS, COLUMNS), FOREGROUND, np.uint8)
    for _ in range(5):
        observe_motion(one, still, RATIO, DT_S)
    assert one.still_s == pytest.approx(0.5)
    observe_motion(one, np.full((ROWS, COLUMNS), MOVING, np.uint8), RATIO, DT_S)
    assert one.still_s == 0.0


def test_a_person_counts_once_seen_and_moving_for_three_frames() -> None:
    one, moving = person(), np.full((ROWS, COLUMNS), MOVING, np.uint8)
    counts = []
    for _ in range(4):
        observe_motion(one, moving, RATIO, DT_S)
        one.hits += 1
        counts.append(is_person(one))
    assert counts == [False, False, True, True]


@pytest.mark.parametrize(
    ("gains", "x", "newcomer_gain", "torn"),
    [
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 185.0, 1.0, True),
        ([1.4] * 20 + [1.4, 1.4, 1.35, 1.4], 185.0, 1.0, False),
        ([1.0] * 20 + [1.4] * 4 + [1.4, 1.0, 1.0, 1.0], 185.0, 1.0, False),
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 310.0, 1.0, False),
        ([1.4] * 20 + [0.5, 0.4, 0.3, 0.3], 185.0, 1.0, False),
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 185.0, 0.2, False),
        ([1.4, 1.0, 0.95], 185.0, 1.0, False),
    ],
    ids=["pair", "passer-by", "known alone before", "far", "hidden", "newcomer unclear", "too new"],
)
def test_a_box_was_a_pair_if_a_newcomer_takes_over_what_it_explained(
    gains: list[float], x: float, newcomer_gain: float, torn: bool
) -> None:
    one, newcomer = person(1), person(2, x=x)
    one.gains.extend(gains)
    newcomer.gain = newcomer_gain
    assert is_torn(one, newcomer) is torn
