"""An episode through the real processes, in real time, as the reference for the closed loop."""

from __future__ import annotations

import logging
import tempfile
import threading
from functools import partial
from pathlib import Path

from heel.evaluation.following.log import EpisodeLog
from heel.schemas import FollowState, HeelError, SimTruth
from heel.services.loops.scenarios.episode import StackSettings, play_and_judge
from heel.services.loops.scenarios.parallel import EpisodeTask
from heel.services.loops.scenarios.results import EpisodeResult
from heel.services.loops.scenarios.witness import Moment, Witness
from heel.services.run.world_run import WorldOptions, WorldRun
from heel.services.simulator.scenarios import scenario


def run_in_processes(
    settings: StackSettings, config: Path | None, stop: threading.Event, task: EpisodeTask
) -> EpisodeResult:
    """Run one episode through the real processes and score it; draw it if a folder is given.

    Simulator, tracker, follower and drive run around a router of their own; the simulator's own
    boxes stand for pixels and detector. Must run in a process that
    `heel.services.run.guard.guarded` has made.

    Args:
        settings: as the processes read them from the same `config`.
        config: settings file of the services.
        stop: gives the episode up when set.
        task: which episode; no film is made of it.

    Raises:
        HeelError: a service failed, the simulator fell silent, or the episode was given up.
    """
    return play_and_judge(partial(_play, config, stop), settings, task)


def _play(config: Path | None, stop: threading.Event, task: EpisodeTask) -> EpisodeLog:
    world = scenario(task.scenario, task.seed)
    log = OneEpisode(Witness(world))
    with tempfile.TemporaryDirectory(prefix="heel-") as folder:
        options = WorldOptions(
            Path(folder), task.scenario, task.seed, "simulated-boxes", world.scenario.duration_s,
            ends_at_contact=True, config=config,
        )  # fmt: skip
        WorldRun(options, log, stop, logging.getLogger("heel.scenarios")).run()
    if stop.is_set():
        raise HeelError("stopped before the end of the episode: its scores mean nothing")
    return log.witness.log()


class OneEpisode:
    """A `Recorder` of one episode, for scoring."""

    def __init__(self, witness: Witness) -> None:
        self.witness = witness

    def episode(self) -> None:
        """There is only one."""

    def record(self, truth: SimTruth, state: FollowState | None, people: dict[int, int]) -> None:
        if state is not None:
            self.witness.record(Moment.of_truth(truth), state, people)
