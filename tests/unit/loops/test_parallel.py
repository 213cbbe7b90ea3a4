"""Many episodes: the same results whatever the processes, and failures that name their episode."""

from __future__ import annotations

import multiprocessing

import pytest
from made_episodes import fail_at_seed_3, killed, run

from heel.schemas import HeelError
from heel.services.loops.scenarios.parallel import EpisodeTask, run_all, spread
from heel.services.runtime.process import PARENT_VARIABLE

NAMES = ["straight", "turns", "pillar"]


def test_scenarios_take_turns_and_each_round_has_the_next_seed() -> None:
    tasks = spread(NAMES, 7, seed=5, out=None)

    assert [(task.scenario, task.seed) for task in tasks] == [
        ("straight", 5), ("turns", 5), ("pillar", 5),
        ("straight", 6), ("turns", 6), ("pillar", 6),
        ("straight", 7),
    ]  # fmt: skip


def test_results_do_not_depend_on_the_number_of_processes() -> None:
    tasks = spread(NAMES, 8, seed=0, out=None)
    ended: list[int] = []

    alone = run_all(run, tasks, 1, lambda: ended.append(1))
    together = run_all(run, tasks, 2, lambda: ended.append(2))

    assert alone == together == [run(task) for task in tasks]
    assert (ended.count(1), ended.count(2)) == (8, 8)


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_episode_that_crashes_is_named(jobs: int) -> None:
    tasks = [EpisodeTask("pillar", seed) for seed in range(5)]

    with pytest.raises(HeelError, match="scenario pillar, seed 3: ZeroDivisionError: nothing to"):
        run_all(fail_at_seed_3, tasks, jobs, lambda: None)

    assert not multiprocessing.active_children()


def test_processes_run_where_this_one_was_itself_started_by_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(PARENT_VARIABLE, "1")
    tasks = spread(NAMES, 2, seed=0)

    assert run_all(run, tasks, 2, lambda: None) == [run(task) for task in tasks]


def test_a_process_that_is_killed_is_an_error() -> None:
    with pytest.raises(HeelError, match="run fewer --jobs"):
        run_all(killed, [EpisodeTask("pillar", seed) for seed in range(2)], 2, lambda: None)
