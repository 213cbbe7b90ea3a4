"""Episodes without a world, for tests of what is around them; importable by worker processes."""

from __future__ import annotations

import os
import signal

from heel.evaluation.following.episode_scores import EpisodeScores
from heel.evaluation.following.evt import EvtScores
from heel.evaluation.following.habitat import HabitatScores
from heel.evaluation.returns import CLASSES, Absences, Returns
from heel.services.loops.scenarios.parallel import EpisodeTask
from heel.services.loops.scenarios.results import EpisodeResult


def scores(following_rate: float = 1.0, wrong_time: float = 0.0) -> EpisodeScores:
    return EpisodeScores(
        duration_s=30.0,
        habitat=HabitatScores(1.0, 1.0, following_rate, 0.0),
        evt=EvtScores(1.0, 300, 300, 0.0),
        wrong_time=wrong_time,
        space_1m=1.0,
        jerk_p95=2.0,
        longest_loss_s=0.5,
        min_distance_m=0.8,
        driven_to_m=1.3,
        follow_bench=1.0,
        returns=Returns(
            absences={about: Absences(count=0, same=0, others=0) for about in CLASSES},
            losses=1,
            delays_s=(2.5,),
        ),
    )


def run(task: EpisodeTask) -> EpisodeResult:
    """An episode whose score tells its seed."""
    return EpisodeResult(
        scenario=task.scenario, seed=task.seed, scores=scores(following_rate=1 / (1 + task.seed))
    )


def fail_at_seed_3(task: EpisodeTask) -> EpisodeResult:
    if task.seed == 3:
        raise ZeroDivisionError("nothing to divide by")
    return run(task)


def killed(task: EpisodeTask) -> EpisodeResult:
    os.kill(os.getpid(), signal.SIGKILL)
    return run(task)
