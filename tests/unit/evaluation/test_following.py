"""The scores of following, against cases worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from heel.evaluation.following.attention import longest_loss_s, wrong_person_time
from heel.evaluation.following.comfort import (
    jerk_p95_mps3,
    minimum_distance_m,
    personal_space_compliance,
)
from heel.evaluation.following.episode_scores import score_episode, summarise
from heel.evaluation.following.evt import EvtScores, evt_scores
from heel.evaluation.following.habitat import HabitatScores, habitat_scores
from heel.evaluation.following.log import EpisodeLog
from heel.evaluation.following.recovery import follow_bench_success, returns
from heel.evaluation.returns import Absences
from heel.schemas import HeelError

TARGET, STRANGER, NOBODY = 0, 1, -1
ROBOT_RADIUS_M, PERSON_RADIUS_M = 0.25, 0.25


def log(
    distances_m: list[float],
    *,
    strangers_m: list[float] | None = None,
    headings_rad: list[float] | None = None,
    period_s: float = 0.1,
    planned_s: float | None = None,
    **columns: Any,
) -> EpisodeLog:
    """A robot in the origin, the target ahead on x, a stranger behind; columns replace defaults."""
    count = len(distances_m)
    people = np.zeros((count, 2, 2))
    people[:, TARGET, 0] = distances_m
    people[:, STRANGER, 0] = np.negative(strangers_m or [9.0] * count)
    given = {
        "robot_xy_m": np.zeros((count, 2)),
        "robot_heading_rad": np.array(headings_rad or [0.0] * count),
        "linear_mps": np.zeros(count),
        "angular_radps": np.zeros(count),
        "path_m": np.array(distances_m),
        "path_from_start_m": np.array(distances_m),
        "visible": np.ones(count),
        "people_visible": np.ones((count, 2)),
        "identities": np.tile([7, NOBODY], (count, 1)),
        "followed": np.full(count, TARGET),
        "contact": np.zeros(count, bool),
        "state": np.full(count, "following"),
    } | {name: np.array(value) for name, value in columns.items()}
    return EpisodeLog(
        planned_s=count * period_s if planned_s is None else planned_s,
        robot_radius_m=ROBOT_RADIUS_M,
        people_radius_m=np.full(2, PERSON_RADIUS_M),
        target=TARGET,
        t_s=np.arange(count) * period_s,
        people_xy_m=people,
        **given,
    )


SIDEWAYS_RAD = math.acos(0.49)
"""Just too far off the heading for Habitat."""


# At 1 m/s the robot covers 0.1 m a step: 1.5 m away it arrives in the 16th step (15 < 16).
@pytest.mark.parametrize(
    ("episode", "expected"),
    [
        pytest.param(
            log([1.5] * 40), HabitatScores(1.0, 1.0, 1.0, 0.0), id="in the band all the time"
        ),
        pytest.param(log([2.5] * 40), HabitatScores(0.0, 0.0, 0.0, 0.0), id="too far all the time"),
        pytest.param(
            log([0.9] * 40), HabitatScores(0.0, 0.0, 0.0, 0.0), id="too near all the time"
        ),
        pytest.param(
            log([1.5] * 40, headings_rad=[SIDEWAYS_RAD] * 40),
            HabitatScores(0.0, 0.0, 0.0, 0.0),
            id="does not face",
        ),
        # Found in step 32, reachable in step 16 by the way on the floor.
        pytest.param(
            log([3.0] * 31 + [1.5] * 9, path_from_start_m=[1.5] * 40),
            HabitatScores(1.0, 16 / 32, 9 / (40 - 16), 0.0),
            id="found late",
        ),
        pytest.param(
            log([1.5] * 40, path_m=[2.1] * 40),
            HabitatScores(0.0, 0.0, 0.0, 0.0),
            id="the way around an obstacle counts",
        ),
        # Not reachable: l is the planned length, and F is 1 as soon as one step is in the band.
        pytest.param(
            log([3.0] * 39 + [1.5], path_from_start_m=[99.0] * 40),
            HabitatScores(1.0, 1.0, 1.0, 0.0),
            id="never reachable",
        ),
        # Ten of forty planned steps; 10 / (40 - 16).
        pytest.param(
            log([1.5] * 10, planned_s=4.0, contact=[False] * 9 + [True]),
            HabitatScores(1.0, 1.0, 10 / 24, 1.0),
            id="contact ends it, and the planned length counts",
        ),
    ],
)
def test_habitat(episode: EpisodeLog, expected: HabitatScores) -> None:
    scores = habitat_scores(episode, max_speed_mps=1.0)

    assert scores.found == expected.found
    assert scores.path_efficiency == pytest.approx(expected.path_efficiency)
    assert scores.following_rate == pytest.approx(expected.following_rate)
    assert scores.collision == expected.collision


def test_habitat_gives_up_finding_after_1500_steps() -> None:
    late = log([3.0] * 1500 + [1.5])

    assert habitat_scores(late, 1.0).found == 0.0
    assert habitat_scores(log([3.0] * 1499 + [1.5]), 1.0).found == 1.0


@pytest.mark.parametrize(
    ("episode", "expected"),
    [
        pytest.param(log([2.9] * 40), EvtScores(1.0, 40, 40, 0.0), id="near and seen"),
        pytest.param(log([3.0] * 40), EvtScores(1.0, 40, 40, 0.0), id="3 m is near enough"),
        pytest.param(log([3.1] * 40), EvtScores(0.0, 0, 40, 0.0), id="between 3 and 4 m: not lost"),
        pytest.param(
            log([3.1] * 39 + [2.0]), EvtScores(1.0, 1, 40, 0.0), id="the last step decides"
        ),
        pytest.param(
            log([2.0] * 39 + [3.1]), EvtScores(0.0, 39, 40, 0.0), id="the last step decides, too"
        ),
        pytest.param(
            log([2.0] * 40, visible=[0.24] * 20 + [0.25] * 20),
            EvtScores(1.0, 20, 40, 0.0),
            id="hidden is not followed",
        ),
        pytest.param(
            log([4.1] * 20 + [2.0] * 20), EvtScores(1.0, 20, 40, 0.0), id="20 far steps are allowed"
        ),
        pytest.param(
            log([4.1] * 21 + [2.0] * 19), EvtScores(0.0, 0, 40, 0.0), id="the 21st is the end"
        ),
        pytest.param(
            log([4.1] * 11 + [3.5] * 5 + [4.1] * 10 + [2.0] * 14),
            EvtScores(0.0, 0, 40, 0.0),
            id="coming nearer without following forgives nothing",
        ),
        pytest.param(
            log([4.1] * 11 + [2.0] + [4.1] * 20 + [2.0] * 8),
            EvtScores(1.0, 9, 40, 0.0),
            id="one following step forgives all",
        ),
        pytest.param(
            log([2.0] * 30, planned_s=4.0, contact=[False] * 29 + [True]),
            EvtScores(0.0, 30, 40, 1.0),
            id="contact ends it",
        ),
        pytest.param(
            log([2.0] * 200, period_s=0.02), EvtScores(1.0, 40, 40, 0.0), id="logged at 50 Hz"
        ),
    ],
)
def test_evt(episode: EpisodeLog, expected: EvtScores) -> None:
    assert evt_scores(episode) == expected


@pytest.mark.parametrize(
    ("followed", "wrong", "loss_s"),
    [
        ([TARGET] * 4, 0.0, 0.0),
        ([STRANGER] * 4, 1.0, 0.4),
        ([NOBODY] * 4, 0.0, 0.4),
        ([TARGET, STRANGER, TARGET, TARGET], 0.25, 0.1),
        ([NOBODY, STRANGER, TARGET, NOBODY], 0.25, 0.2),
        ([NOBODY, TARGET, NOBODY, NOBODY], 0.0, 0.2),
    ],
)
def test_attention(followed: list[int], wrong: float, loss_s: float) -> None:
    episode = log([1.5] * 4, followed=followed)

    assert wrong_person_time(episode) == wrong
    assert longest_loss_s(episode) == pytest.approx(loss_s)


@pytest.mark.parametrize(
    ("target_m", "stranger_m", "space", "gap_m"),
    [
        ([1.5, 1.5], [9.0, 9.0], 1.0, 1.0),
        ([1.0, 1.0], [9.0, 9.0], 1.0, 0.5),
        ([1.5, 0.9], [9.0, 9.0], 0.5, 0.4),
        ([1.5, 1.5], [0.9, 0.7], 0.0, 0.2),
        ([1.5, 0.3], [9.0, 9.0], 0.5, 0.0),
    ],
)
def test_comfort(
    target_m: list[float], stranger_m: list[float], space: float, gap_m: float
) -> None:
    episode = log(target_m, strangers_m=stranger_m)

    assert personal_space_compliance(episode) == space
    assert minimum_distance_m(episode) == pytest.approx(gap_m)


@pytest.mark.parametrize(
    ("linear_mps", "jerk_mps3"),
    [
        ([0.5, 0.5, 0.5, 0.5], 0.0),
        ([0.0, 0.1, 0.2, 0.3], 0.0),
        # Accelerations 0, 1, 0 m/s^2, 0.1 s apart.
        ([0.0, 0.0, 0.1, 0.1], 10.0),
        ([0.0, 0.1], 0.0),
    ],
)
def test_jerk(linear_mps: list[float], jerk_mps3: float) -> None:
    assert jerk_p95_mps3(log([1.5] * len(linear_mps), linear_mps=linear_mps)) == pytest.approx(
        jerk_mps3
    )


def test_a_set_adds_up_steps_and_time() -> None:
    good = score_episode(log([1.5] * 40), max_speed_mps=1.0)
    bad = score_episode(
        log([3.5] * 120, followed=[STRANGER] * 60 + [NOBODY] * 60), max_speed_mps=1.0
    )

    scores = summarise([good, bad])

    assert (scores.episodes, scores.sr, scores.s, scores.cr) == (2, 0.5, 0.5, 0.0)
    assert scores.tr == pytest.approx(40 / 160)
    assert scores.f == pytest.approx(0.5)
    assert scores.wrong_time == pytest.approx(60 / 160)
    assert scores.longest_loss_s == pytest.approx(12.0)
    assert scores.min_distance_m == pytest.approx(1.0)


def test_an_empty_set_has_no_scores() -> None:
    with pytest.raises(HeelError, match="run at least one"):
        summarise([])


@pytest.mark.parametrize(
    ("column", "value"), [("visible", [1.0]), ("people_xy_m", None), ("followed", [])]
)
def test_a_log_whose_arrays_do_not_belong_together_is_refused(column: str, value: object) -> None:
    if column == "people_xy_m":
        fields = {name: getattr(log([1.5]), name) for name in EpisodeLog.__slots__}
        with pytest.raises(HeelError, match="do not go with 2 people"):
            EpisodeLog(**fields | {"people_xy_m": np.zeros((1, 3, 2))})
    else:
        with pytest.raises(HeelError, match=column):
            log([1.5] * 3, **{column: value})


def test_an_absence_of_the_target_counts_for_the_time_in_which_nothing_of_them_is_in_view() -> None:
    # In view, missed by the tracker for 1 s, hidden for 3 s with a box guessed on them, back.
    shown = [1.0] * 30 + [0.0] * 30 + [1.0] * 20
    ids = [7] * 20 + [NOBODY] * 10 + [7] * 30 + [7] * 20
    seen = log(
        [1.5] * 80, visible=shown, people_visible=[[one, 0.0] for one in shown],
        identities=[[one, NOBODY] for one in ids],
    )  # fmt: skip
    found = returns(seen).absences
    assert {about: (one.same, one.count) for about, one in found.items() if one.count} == {
        3: (1, 1)
    }


def test_somebody_elses_identity_on_the_target_after_an_absence_is_told_from_a_fresh_one() -> None:
    shown = [1.0] * 10 + [0.0] * 10 + [1.0] * 20
    for after, others in ((8, 1), (9, 0)):
        seen = log(
            [1.5] * 40, visible=shown, people_visible=[[one, 1.0] for one in shown],
            identities=[[7, 8]] * 10 + [[NOBODY, 8]] * 10 + [[after, NOBODY]] * 20,
        )  # fmt: skip
        assert returns(seen).absences[1] == Absences(count=1, same=0, others=others)


def test_the_robot_loses_the_target_while_it_acts_upon_nobody_or_another_person() -> None:
    lost = [TARGET] * 5 + [NOBODY] * 10 + [TARGET] * 5 + [STRANGER] * 20 + [TARGET] + [NOBODY] * 9
    found = returns(log([1.5] * 50, followed=lost))
    assert found.losses == 3
    assert found.delays_s == pytest.approx((1.0, 2.0))


@pytest.mark.parametrize(
    ("unseen", "columns", "success"),
    [
        ([0] * 80 + [1] * 10 + [0] * 50 + [1], {}, 1.0),
        ([1] * 10 + [0] * 51 + [1], {}, 0.0),
        ([1] * 10 + [0] * 20 + [1], {"contact": [False] * 30 + [True]}, 0.0),
    ],
    ids=["not seen at first, and lost for 5 s", "lost for longer", "touched"],
)
def test_success_in_follow_bench(
    unseen: list[int], columns: dict[str, list[bool]], success: float
) -> None:
    assert follow_bench_success(log([1.5] * len(unseen), visible=unseen, **columns)) == success
