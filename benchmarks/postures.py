"""Who is not an upright adult, followed with and without ranges and calibration.

    python -m benchmarks.postures                         50 episodes of each robot, as a table
    python -m benchmarks.postures --episodes 200 --write docs/records/scenarios.md

Every scenario of `heel scenarios --postures` in turn, with simulated boxes. A row's figures are,
for each of the four robots, contacts among the episodes, and how near the robot drove to anybody it
could see, from centre to centre (`driven_to_m`): 1 m is promised where ranges or a calibration
exist, 0.6 m where neither does. What people do themselves, who walk by a robot that stands, does
not count.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.common import publish
from heel.services.loops.scenarios.episode import load_stack, run_episode
from heel.services.loops.scenarios.parallel import run_all, spread
from heel.services.loops.scenarios.perception import Senses
from heel.services.loops.scenarios.results import EpisodeResult
from heel.services.simulator.posture_scenarios import POSTURES

ROBOTS = tuple(
    Senses(ranges, calibrated) for ranges in (True, False) for calibrated in (True, False)
)
KNOWN_M, UNKNOWN_M = 1.0, 0.6
_SLACK_M = 0.005


def promised_m(senses: Senses) -> float:
    """What is kept from everybody's centre."""
    return KNOWN_M if senses.ranges or senses.calibrated else UNKNOWN_M


def main(
    episodes: Annotated[int, typer.Option(min=1, help="of each robot")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="of the first worlds")] = 8000,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes [default: one a core]")] = None,
    write: Annotated[Path | None, typer.Option(help="document that gets the table")] = None,
) -> None:
    """Measure, and print the table."""
    tasks = spread(list(POSTURES), episodes, seed)
    results = {}
    for senses in ROBOTS:
        stack = replace(load_stack("simulated boxes", None), senses=senses)
        results[senses] = run_all(
            partial(run_episode, stack), tasks, jobs or os.cpu_count() or 1, lambda: None
        )
        print(f"{senses}: done", file=sys.stderr)
    publish(table(results, seed), write, "postures")


def table(results: Mapping[Senses, Sequence[EpisodeResult]], seed: int) -> str:
    """The rows, as Markdown."""
    count = len(next(iter(results.values())))
    lines = [
        f"{count} episodes of each robot, from seed {seed}:",
        "",
        "| scenario | " + " | ".join(str(senses) for senses in results) + " |",
        "|---|" + "---|" * len(results),
    ]
    for name in [*POSTURES, "**all**"]:
        cells = []
        for senses, episodes in results.items():
            chosen = [one for one in episodes if name in (one.scenario, "**all**")]
            cells.append(_cell(senses, chosen))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cell(senses: Senses, episodes: Sequence[EpisodeResult]) -> str:
    if not episodes:
        return "-"
    touched = sum(one.scores.evt.collision > 0 for one in episodes)
    near = [one.scores.driven_to_m for one in episodes]
    nearer = sum(metres < promised_m(senses) - _SLACK_M for metres in near)
    followed = sum(one.scores.evt.success for one in episodes) / len(episodes)
    text = f"{min(near):.2f} m, SR {followed:.2f}"
    if touched or nearer:
        text += f", {touched} touched, {nearer} nearer"
    return text


if __name__ == "__main__":
    typer.run(main)
