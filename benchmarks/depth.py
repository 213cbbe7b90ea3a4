"""How well distances by depth are, beside those by boxes, in the simulated world.

    python -m benchmarks.depth                            one episode of each kind, as tables
    python -m benchmarks.depth --episodes 3 --write docs/records/depth.md

Closed loops with simulated boxes, which err as a detector's do, and rendered depth, which errs as a
stereo camera's does (`services/simulator/depth_sensor.py`). Of every tracked person within 1 to 4 m
the distance by each of three ways is compared, four times a second, with the true one, from the
camera to the middle of the body: by depth, by the box with the camera's mounting known, and by the
box alone. Then episodes of the same loop without a ring of range sensors, with and without depth.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.common import publish
from heel.schemas import FrameId, Pointed, Tracks
from heel.services.drive.core import Drive
from heel.services.follower.core import Follower
from heel.services.geometry.camera import camera_from_info
from heel.services.geometry.person import locate_person
from heel.services.loops.judge import people_by_track
from heel.services.loops.scenarios.episode import StackSettings, load_stack, run_episode
from heel.services.loops.scenarios.loop import ClosedLoop
from heel.services.loops.scenarios.parallel import EpisodeTask, run_all, spread, workers
from heel.services.loops.scenarios.perception import Senses, SimulatedBoxes, camera_info
from heel.services.loops.scenarios.pixels import Camera
from heel.services.loops.scenarios.results import make_report
from heel.services.simulator.posture_scenarios import POSTURES
from heel.services.simulator.scenarios import SCENARIOS, scenario
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World
from heel.services.tracker.depth_places import with_depth

NEAREST_M, FARTHEST_M = 1.0, 4.0
GOAL = 0.05
"""Of the distance: what 95 of 100 errors are to be within."""
LEAST_VISIBLE = 0.5
"""Share of a person that is seen; who is hidden more is not measured by anybody."""
EVERY = 5
"""Frames of which one is measured, four a second: those between say the same."""
EPISODE_S = 600.0
"""Longest wait for an episode: each takes some tens of seconds."""
WAYS = ("by depth", "by box, mounted", "by box alone")


@dataclass(frozen=True, slots=True)
class Sample:
    """One person in one frame: true distance, and those told, None where there is none."""

    true_m: float
    told_m: tuple[float | None, ...]
    sigma_m: float | None


class Compared:
    """A perception that notes what each way tells of its people."""

    def __init__(
        self, boxes: SimulatedBoxes, seen: Camera, world: World, mount: CameraMount
    ) -> None:
        self._boxes, self._seen, self._world, self._mount = boxes, seen, world, mount
        self._cameras = [camera_from_info(camera_info(mount, known)) for known in (True, False)]
        self.samples: list[Sample] = []

    def see(self, frame: FrameId) -> Tracks:
        """Tracks without depth; of some frames those near are noted."""
        tracks = self._boxes.see(frame)
        if frame.seq % EVERY == 0:
            assert self._cameras[0] is not None
            self._note(frame, with_depth(tracks, self._seen.depth_mm(), self._cameras[0]))
        return tracks

    def _note(self, frame: FrameId, tracks: Tracks) -> None:
        truth, robot = self._world.truth(frame.seq, self._mount), self._world.robot
        pairs = people_by_track(truth, tracks)
        for track in tracks.tracks:
            index = pairs.get(track.id)
            if index is None or track.state != "tracked" or not track.shown:
                continue
            person = self._world.people[index]
            true_m = math.hypot(person.x_m - robot.x_m, person.y_m - robot.y_m)
            visible = truth.people[index].visible
            if NEAREST_M <= true_m <= FARTHEST_M and visible >= LEAST_VISIBLE:
                placed = [
                    None if camera is None else locate_person(track.box_xyxy, camera)
                    for camera in self._cameras
                ]
                told = tuple(None if place is None else place.distance_m for place in placed)
                self.samples.append(
                    Sample(true_m, (track.distance_m, *told), track.distance_sigma_m)
                )

    def point(self, pointed: Pointed) -> None:
        """Nothing hangs on it."""
        self._boxes.point(pointed)


def samples_of(stack: StackSettings, task: EpisodeTask) -> list[Sample]:
    """All that an episode shows of people near."""
    world, mount = scenario(task.scenario, task.seed), CameraMount()
    with Camera(world, mount) as camera:
        boxes = SimulatedBoxes(world, mount, stack.tracker)
        compared = Compared(boxes, camera, world, mount)
        cores = Follower(stack.follower), Drive(stack.drive)
        ClosedLoop(world, mount, compared, *cores, senses=Senses(), ranges=None).run()
    return compared.samples


def accuracy(samples: Sequence[Sample]) -> str:
    """The rows of one table, as Markdown."""
    lines = [
        "| | told of | error p50 | error p95 | mean | at 1 to 2 m, p95 | 2 to 3 m | 3 to 4 m |",
        "|---|---|---|---|---|---|---|---|",
    ]
    true_m = np.array([sample.true_m for sample in samples])
    for way, name in enumerate(WAYS):
        told = np.array([sample.told_m[way] or np.nan for sample in samples])
        errors = told / true_m - 1
        there = np.isfinite(errors)
        cells = [
            f"{np.mean(there):.1%}",
            *_percentiles(errors[there]),
            f"{errors[there].mean():+.1%}",
        ]
        for low_m in (1.0, 2.0, 3.0):
            within = there & (true_m >= low_m) & (true_m < low_m + 1)
            cells.append(_percentiles(errors[within])[1] if within.any() else "")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    off = [
        abs(sample.told_m[0] - sample.true_m) / sample.sigma_m
        for sample in samples if sample.told_m[0] is not None and sample.sigma_m
    ]  # fmt: skip
    within = float(np.mean(np.array(off) < 2))
    return "\n".join(lines) + f"\n\nWithin two of the stated standard deviations: {within:.1%}.\n"


def _percentiles(errors: np.ndarray) -> tuple[str, str]:
    half, most = np.percentile(np.abs(errors), (50, 95))
    return f"{half:.1%}", f"{most:.1%}"


def kinds(group: Mapping[str, object], episodes: int) -> list[str]:
    """Names of scenarios: all, or evenly so many of them as there are episodes."""
    names = list(group)
    return names[:: max(1, len(names) // episodes)]


def closed_loops(episodes: int, seed: int, jobs: int) -> str:
    """How robots without a ring follow, as Markdown."""
    lines = [
        "| robot | followed (SR) | contacts (CR) | nearest to anybody, m |",
        "|---|---|---|---|",
    ]
    for senses in (Senses(ranges=False), Senses(ranges=False, depth=True)):
        stack = replace(load_stack("simulated boxes", None), senses=senses)
        tasks = spread(kinds(SCENARIOS, episodes), episodes, seed)
        results = run_all(partial(run_episode, stack), tasks, jobs, lambda: None)
        report = make_report(results, seed, stack.mode, 1.0, senses=senses)
        print(f"{senses}: done", file=sys.stderr)
        scores = report.overall
        lines.append(
            f"| {senses} | {scores.sr:.0%} | {scores.cr:.0%} | {scores.min_distance_m:.2f} |"
        )
    return "\n".join(lines) + "\n"


def main(
    episodes: Annotated[int, typer.Option(min=1, help="of each table")] = len(SCENARIOS),
    seed: Annotated[int, typer.Option(min=0, help="of the first worlds")] = 31000,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes [default: one a core]")] = None,
    write: Annotated[Path | None, typer.Option(help="document that gets the tables")] = None,
) -> None:
    """Measure, and print the tables."""
    stack, many = load_stack("simulated boxes", None), jobs or os.cpu_count() or 1
    for name, group in (("upright", SCENARIOS), ("postures", POSTURES)):
        tasks = spread(kinds(group, episodes), episodes, seed)
        with workers(min(many, len(tasks))) as pool:
            found = [pool.submit(samples_of, stack, task) for task in tasks]
            samples = [sample for one in found for sample in one.result(EPISODE_S)]
        text = f"{len(samples)} people in frames of {episodes} episodes from seed {seed}:\n\n"
        publish(text + accuracy(samples), write, name)
    publish(closed_loops(episodes, seed, many), write, "loops")


if __name__ == "__main__":
    typer.run(main)
