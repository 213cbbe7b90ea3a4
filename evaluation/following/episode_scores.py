"""Every score of following: of one episode, and of a set of episodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from heel.evaluation.following.attention import longest_loss_s, wrong_person_time
from heel.evaluation.following.comfort import (
    driven_to_m,
    jerk_p95_mps3,
    minimum_distance_m,
    personal_space_compliance,
)
from heel.evaluation.following.evt import EvtScores, evt_scores
from heel.evaluation.following.habitat import HabitatScores, habitat_scores
from heel.evaluation.following.log import EpisodeLog
from heel.evaluation.following.recovery import follow_bench_success, returns
from heel.evaluation.returns import Returns, ReturnScores, summed_up
from heel.schemas.errors import HeelError


class FollowingScores(BaseModel):
    """A set of episodes; one episode is a set, too. Fractions and SI units."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    episodes: int = Field(ge=1, description="how many")
    sr: float = Field(ge=0, le=1, description="EVT-Bench's success rate: share of episodes")
    tr: float = Field(
        ge=0, le=1, description="EVT-Bench's tracking rate: following steps / reference steps"
    )
    cr: float = Field(ge=0, le=1, description="share of episodes that end in contact")
    s: float = Field(ge=0, le=1, description="Habitat's finding success S: share of episodes")
    spl: float = Field(ge=0, le=1, description="Habitat's SPS, mean of the episodes")
    f: float = Field(ge=0, le=1, description="Habitat's following rate F, mean of the episodes")
    wrong_time: float = Field(
        ge=0, le=1, description="share of all time in which the robot acts upon another person"
    )
    space_1m: float = Field(
        ge=0, le=1, description="share of all time at 1.0 m or more from everybody"
    )
    jerk_p95: float = Field(
        ge=0, description="95th percentile of the jerk, m/s^3, mean of the episodes"
    )
    longest_loss_s: float = Field(ge=0, description="longest loss of all episodes, s")
    min_distance_m: float = Field(
        ge=0, description="least distance to any person's body in all episodes, m; 0 is contact"
    )
    driven_to_m: float = Field(
        ge=0, description="how near it drove to any person in sight, from centre to centre, m"
    )
    follow_bench_sr: float = Field(
        ge=0, le=1, description="Follow-Bench's success rate: share of episodes"
    )
    returns: ReturnScores = Field(
        description="the same identity after full occlusion of the target, and losses of it"
    )


class EpisodeScores(BaseModel):
    """One episode, with the counts that sets of episodes add up."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    duration_s: float = Field(gt=0, description="simulated time until the end")
    habitat: HabitatScores
    evt: EvtScores
    wrong_time: float = Field(ge=0, le=1)
    space_1m: float = Field(ge=0, le=1)
    jerk_p95: float = Field(ge=0)
    longest_loss_s: float = Field(ge=0)
    min_distance_m: float = Field(ge=0)
    driven_to_m: float = Field(ge=0)
    follow_bench: float = Field(ge=0, le=1)
    returns: Returns


def score_episode(log: EpisodeLog, max_speed_mps: float) -> EpisodeScores:
    """Every score of one episode.

    Args:
        log: what happened.
        max_speed_mps: of the robot, for Habitat's oracle.
    """
    return EpisodeScores(
        duration_s=len(log.t_s) * log.period_s,
        habitat=habitat_scores(log, max_speed_mps),
        evt=evt_scores(log),
        wrong_time=wrong_person_time(log),
        space_1m=personal_space_compliance(log),
        jerk_p95=jerk_p95_mps3(log),
        longest_loss_s=longest_loss_s(log),
        min_distance_m=minimum_distance_m(log),
        driven_to_m=driven_to_m(log),
        follow_bench=follow_bench_success(log),
        returns=returns(log),
    )


def summarise(episodes: Sequence[EpisodeScores]) -> FollowingScores:
    """The scores of a set; time shares weigh every second alike, so long episodes weigh more.

    Raises:
        HeelError: the set is empty.
    """
    if not episodes:
        raise HeelError("no episode to sum up: run at least one")
    seconds = np.array([episode.duration_s for episode in episodes])

    def over_time(shares: list[float]) -> float:
        return min(1.0, float(np.average(shares, weights=seconds)))

    return FollowingScores(
        episodes=len(episodes),
        sr=_mean([e.evt.success for e in episodes]),
        tr=sum(e.evt.following_steps for e in episodes)
        / sum(max(e.evt.reference_steps, e.evt.following_steps) for e in episodes),
        cr=_mean([e.evt.collision for e in episodes]),
        s=_mean([e.habitat.found for e in episodes]),
        spl=_mean([e.habitat.path_efficiency for e in episodes]),
        f=_mean([e.habitat.following_rate for e in episodes]),
        wrong_time=over_time([e.wrong_time for e in episodes]),
        space_1m=over_time([e.space_1m for e in episodes]),
        jerk_p95=_mean([e.jerk_p95 for e in episodes]),
        longest_loss_s=max(e.longest_loss_s for e in episodes),
        min_distance_m=min(e.min_distance_m for e in episodes),
        driven_to_m=min(e.driven_to_m for e in episodes),
        follow_bench_sr=_mean([e.follow_bench for e in episodes]),
        returns=summed_up([e.returns for e in episodes]),
    )


def _mean(values: list[float]) -> float:
    return float(np.mean(values))
