"""keep% and wrong%: is the identity chosen at first sight still on that person?"""

from __future__ import annotations

import numpy as np
import pytest

from heel.evaluation.alignment import AlignedSequence, align
from heel.evaluation.retention import APART_IOU, Retention, retention
from tests.support.box_rows import rows_from_array

# Where people and outputs stand in the scripts below: one letter is one place, none overlap.
PLACES = {"a": 0.0, "b": 100.0, "c": 200.0, "d": 300.0}


def rows(scripts: dict[int, str]) -> list[list[float]]:
    """One row per letter: the place of an identity in frame 1, 2, ...; a dot means not there."""
    return [
        [frame, identity, PLACES[letter], 10, 30, 60, 1]
        for identity, script in scripts.items()
        for frame, letter in enumerate(script, start=1)
        if letter != "."
    ]


def sequence(people: dict[int, str], tracks: dict[int, str]) -> AlignedSequence:
    return align(
        rows_from_array(np.array(rows(people)), "ground truth"),
        rows_from_array(np.array(rows(tracks)), "tracks"),
    )


@pytest.mark.parametrize(
    ("people", "tracks", "expected"),
    [
        pytest.param({1: "aaaa"}, {7: "aaaa"}, Retention(1, 3, 3, 0), id="kept to the end"),
        pytest.param({1: "aaaa"}, {7: "a..."}, Retention(1, 3, 0, 0), id="lost"),
        pytest.param({1: "aaaa"}, {7: "a..a"}, Retention(1, 3, 1, 0), id="lost and found again"),
        pytest.param({1: "aaaa"}, {7: "a...", 8: ".aaa"}, Retention(1, 3, 0, 0), id="renamed"),
        pytest.param(
            {1: "aaaa"}, {7: "ad..", 8: ".aaa"}, Retention(1, 3, 0, 0), id="held id on nobody: lost"
        ),
        pytest.param(
            {1: "aaaa", 2: "bbbb"},
            {7: "aabb", 8: "bbaa"},
            Retention(2, 6, 2, 4),
            id="two swap: both wrong from then on",
        ),
        pytest.param(
            {1: "aaaa", 2: ".bbb"},
            {7: "abbb"},
            Retention(2, 5, 2, 3),
            id="an id may be chosen for the second person as well",
        ),
        pytest.param(
            {1: "aa..", 2: "bbbb"},
            {7: "aabb"},
            Retention(2, 2, 2, 0),
            id="no frame counts once the person has left",
        ),
        pytest.param(
            {1: "aaaa"}, {7: "..aa"}, Retention(1, 1, 1, 0), id="only frames after the choice"
        ),
        pytest.param({1: "aa..aa"}, {7: "aa..aa"}, Retention(1, 3, 3, 0), id="person away"),
        pytest.param(
            {1: "aaaa"}, {7: "dddd"}, Retention(0, 0, 0, 0), id="never shown: never chosen"
        ),
        pytest.param({1: "aaaa"}, {}, Retention(0, 0, 0, 0), id="no tracks at all"),
        pytest.param({1: "a..."}, {7: "a..."}, Retention(1, 0, 0, 0), id="nothing remains"),
    ],
)
def test_every_remaining_frame_is_kept_wrong_or_lost(
    people: dict[int, str], tracks: dict[int, str], expected: Retention
) -> None:
    assert retention(sequence(people, tracks)) == expected


def test_percentages_are_of_the_remaining_frames_of_all_people() -> None:
    held = retention(sequence({1: "aaaaaaaaa", 2: "bb"}, {7: "aaaaa....", 8: "b."}))
    assert held.keep_percent == pytest.approx(100 * 4 / 9)
    assert held.wrong_percent == 0.0


def test_percentages_are_zero_when_nobody_was_chosen() -> None:
    held = retention(sequence({1: "aaaa"}, {}))
    assert (held.keep_percent, held.wrong_percent) == (0.0, 0.0)


def test_the_pair_of_the_frame_before_has_no_advantage() -> None:
    truth = [[1, 1, 10, 10, 30, 60, 1], [2, 1, 10, 10, 30, 60, 1]]
    tracks = [[1, 7, 10, 10, 30, 60, 1], [2, 7, 16, 10, 30, 60, 1], [2, 8, 10, 10, 30, 60, 1]]
    both = align(
        rows_from_array(np.array(truth), "ground truth"),
        rows_from_array(np.array(tracks), "tracks"),
    )
    assert retention(both) == Retention(1, 1, 0, 0)


def test_threshold_decides_what_is_on_a_person() -> None:
    shifted = align(
        rows_from_array(np.array([[f, 1, 10, 10, 30, 60, 1] for f in (1, 2)]), "ground truth"),
        rows_from_array(np.array([[f, 7, 22, 10, 30, 60, 1] for f in (1, 2)]), "tracks"),
    )
    assert retention(shifted, 0.5).people == 0
    assert retention(shifted, 0.3) == Retention(1, 1, 1, 0)


def test_nobody_is_chosen_by_a_box_that_is_on_two_until_they_are_apart() -> None:
    # One box on two who stand nearly in line, a little more on the second; then one on each.
    truth = [[f, who, 10 + at, 10, 30, 60, 1] for f in (1, 2, 3)
             for who, at in ((1, 0), (2, 6 if f == 1 else 60))]  # fmt: skip
    tracks = [[1, 7, 14, 10, 30, 60, 1]]
    tracks += [[f, own, 10 + at, 10, 30, 60, 1] for f in (2, 3) for own, at in ((7, 0), (8, 60))]
    both = align(
        rows_from_array(np.array(truth), "ground truth"),
        rows_from_array(np.array(tracks), "tracks"),
    )
    assert retention(both) == Retention(2, 3, 1, 2)
    assert retention(both, apart_iou=APART_IOU) == Retention(2, 2, 2, 0)
