"""Whole episodes in which the person goes behind a wall, by what the robot is told to do then."""

from __future__ import annotations

from dataclasses import replace

import pytest

from heel.evaluation.following.episode_scores import EpisodeScores
from heel.services.loops.scenarios.episode import load_stack, run_episode
from heel.services.loops.scenarios.parallel import EpisodeTask


def played(scenario: str, seed: int, **settings: float) -> EpisodeScores:
    stack = load_stack("simulated boxes", None)
    follower = stack.follower.model_copy(update=settings)
    return run_episode(replace(stack, follower=follower), EpisodeTask(scenario, seed)).scores


@pytest.mark.parametrize("trail_s", [0.0, 4.0])
def test_who_walks_on_behind_a_door_is_followed_along_their_way(trail_s: float) -> None:
    scores = played("through-door", 12003, trail_s=trail_s)
    assert scores.evt.success == float(trail_s > 0)
    assert scores.evt.collision == 0.0


@pytest.mark.parametrize("ask_after_s", [0.0, 3.0])
def test_a_twin_who_comes_out_first_is_followed_unless_the_robot_asks(ask_after_s: float) -> None:
    scores = played("hidden-twin", 52003, ask_after_s=ask_after_s)
    assert (scores.wrong_time == 0.0) == (ask_after_s > 0)
