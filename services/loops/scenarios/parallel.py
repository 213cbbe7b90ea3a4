"""Many episodes on several processes; the results do not depend on how many."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from heel.schemas.errors import HeelError
from heel.services.loops.scenarios.results import EpisodeResult
from heel.services.runtime.process import PARENT_VARIABLE, die_with_parent

_SILENCE_S = 600.0
"""Without the end of any episode for so long, the run is given up: one takes a minute or two."""
_KILL_S = 5.0
"""Time in which workers end by themselves before they are killed; chosen by hand."""
_POLL_S = 0.01
"""Between two looks whether they have ended."""
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class EpisodeTask:
    """One episode to be run.

    Attributes:
        out: folder for its picture, None for none.
        video: whether a film of it goes there, too.
    """

    scenario: str
    seed: int
    out: Path | None = None
    video: bool = False

    @property
    def name(self) -> str:
        """For its files."""
        return f"{self.scenario}-{self.seed}"


Run = Callable[[EpisodeTask], EpisodeResult]


def spread(
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    out: Path | None = None,
    video: bool = False,
) -> list[EpisodeTask]:
    """The scenarios in turn, until there are enough; each round has the next seed."""
    return [
        EpisodeTask(scenarios[index % len(scenarios)], seed + index // len(scenarios), out, video)
        for index in range(episodes)
    ]


def run_all(
    run: Run, tasks: Sequence[EpisodeTask], jobs: int, on_done: Callable[[], None]
) -> list[EpisodeResult]:
    """Run every task; results in the order of the tasks.

    Args:
        run: a function at module level, or a `functools.partial` of one.
        tasks: what to run.
        jobs: processes at the same time; 1 runs here.
        on_done: called after each episode.

    Raises:
        HeelError: an episode failed (it names scenario and seed), a process died, or no episode
            has ended for ten minutes. Those not yet started are given up.
    """
    if jobs == 1:
        return list(_one_by_one(run, tasks, on_done))
    with workers(min(jobs, len(tasks))) as pool:
        futures = [pool.submit(_named, run, task) for task in tasks]
        _await(futures, on_done)
        return [future.result() for future in futures]


@contextmanager
def workers(count: int, prepare: Callable[[], None] | None = None) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with the block, and with this process, however that ends.

    Args:
        count: of the processes.
        prepare: called first in each; a function at module level.

    Raises:
        HeelError: one was killed.
    """
    for name in _ONE_THREAD:
        # Linear algebra on a few numbers only loses by threads that compete with the other jobs.
        os.environ[name] = "1"
    # Also where this process was started by another one of Heel: the workers are its own.
    os.environ[PARENT_VARIABLE] = str(os.getpid())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, context, initializer=_start_worker, initargs=(prepare,))
    try:
        yield pool
    except BrokenProcessPool as error:
        raise HeelError(
            "a process was killed, probably for want of memory: run fewer --jobs"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        _end_workers()


def _end_workers() -> None:
    """Nothing to lose: either all are idle, or one hangs or has failed."""
    for process in multiprocessing.active_children():
        process.kill()
    # The pool's thread reaps them at the same time: a join here that comes second returns before
    # that thread has struck the process off the list.
    deadline_s = time.monotonic() + _KILL_S
    while multiprocessing.active_children() and time.monotonic() < deadline_s:
        time.sleep(_POLL_S)


def _start_worker(prepare: Callable[[], None] | None) -> None:
    """Ends with its parent, however that ends; Ctrl-C is the parent's to handle."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if prepare is not None:
        prepare()


def _one_by_one(
    run: Run, tasks: Sequence[EpisodeTask], on_done: Callable[[], None]
) -> Iterator[EpisodeResult]:
    for task in tasks:
        yield _named(run, task)
        on_done()


def _await(futures: list[Future[EpisodeResult]], on_done: Callable[[], None]) -> None:
    pending = set(futures)
    while pending:
        done, pending = wait(pending, timeout=_SILENCE_S, return_when=FIRST_COMPLETED)
        if not done:
            raise HeelError(
                f"no episode ended within {_SILENCE_S:g} s: run fewer --jobs, or one --scenario to "
                "find the one that hangs"
            )
        for future in done:
            future.result()
            on_done()


def _named(run: Run, task: EpisodeTask) -> EpisodeResult:
    """Run one episode; whatever fails is said with scenario and seed."""
    try:
        return run(task)
    except Exception as error:
        said = str(error) if isinstance(error, HeelError) else f"{type(error).__name__}: {error}"
        raise HeelError(f"scenario {task.scenario}, seed {task.seed}: {said}") from error
