"""What the simulated world costs, without pictures: CPU time a simulated second.

One thread: the world 50 times a second, the boxes of its people, ranges and truth 20 times a
second, the robot driving ahead. CPU time, so that what else the machine does counts little.

Example run: python -m benchmarks.simulator --json simulator.json
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.common import Figure, Json, median, write_json
from heel.schemas import FrameId
from heel.services.runtime.command_line import run_app
from heel.services.simulator.boxes import SimulatedDetector
from heel.services.simulator.scenarios import SCENARIOS, scenario
from heel.services.simulator.state import CameraMount

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
PARTS = ("world", "boxes", "ranges", "truth")
_STEPS, _FRAMES, _TICKS = 2, 5, 100
"""Ticks are 0.01 s: the world moves every second one, and every fifth is a frame."""


def measure(name: str, seed: int, seconds: int) -> dict[str, float]:
    """CPU milliseconds a simulated second of each part."""
    world = scenario(name, seed)
    mount = CameraMount()
    detector = SimulatedDetector(mount, seed)
    spent = dict.fromkeys(PARTS, 0.0)

    def timed(part: str, work: Callable[[], object]) -> None:
        begun_s = time.thread_time()
        work()
        spent[part] += time.thread_time() - begun_s

    for tick in range(seconds * _TICKS):
        if tick % _STEPS == 0:
            timed("world", partial(world.step, 0.02, 0.7, 0.0))
        if tick % _FRAMES == 0:
            seq = tick // _FRAMES
            frame = FrameId(stream="cam", epoch=0, seq=seq, index=seq, t_capture_ns=0)
            if world.camera_on:
                timed("boxes", partial(detector.detect, world, frame))
            timed("ranges", partial(world.ranges, seq))
            timed("truth", partial(world.truth, seq, mount))
    return {part: 1000.0 * value / seconds for part, value in spent.items()}


@app.command()
def main(
    runs: Annotated[int, typer.Option(help="episodes of each scenario", min=1)] = 3,
    seconds: Annotated[int, typer.Option(help="of each episode", min=1, max=30)] = 15,
    only: Annotated[list[str] | None, typer.Option(help="these scenarios instead of all")] = None,
    json: Json = None,
) -> None:
    """Print the CPU time of world, boxes, ranges and truth by scenario."""
    table = Table("scenario", *(f"{part} ms/s" for part in PARTS), "times real time")
    figures = []
    for name in only or SCENARIOS:
        costs = [measure(name, seed, seconds) for seed in range(runs)]
        parts = [median([cost[part] for cost in costs]) for part in PARTS]
        factor = 1000.0 / median([sum(cost.values()) for cost in costs])
        table.add_row(name, *(f"{part:.1f}" for part in parts), f"{factor:.1f}")
        figures.append(
            Figure(f"simulator/{name}", factor, "simulated s/CPU s", "real time", factor, runs)
        )
    table.add_section()
    slowest = min(figure.value for figure in figures)
    table.add_row("slowest", *("" for _ in PARTS), f"{slowest:.1f}")
    Console().print(table)
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
