"""The paper's Figure 8: what separating the stages costs, over whole recordings.

Wall time from the first frame to the last tracks, through four processes over Zenoh, divided by
the same cores called one after the other in one process. The paper pays 1.0064 for ROS. Below it
stands who uses the processor, start-up included: the busiest process bounds the ratio from below.

Example run: python -m benchmarks.overhead --runs 5 --json overhead.json
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.common import (
    Figure,
    Json,
    heel_run,
    interleaved,
    median,
    name_of,
    recordings,
    write_json,
)
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


SERVICES = ("capture", "detector", "tracker", "follower", "run")


@dataclass(frozen=True)
class Overhead:
    """Medians of one recording; seconds."""

    frames: int
    separate_s: float
    together_s: float
    cpu_s: dict[str, float]
    together_cpu_s: float


def measure(recording: str, runs: int) -> Overhead:
    """Run a recording through processes and in one process, in turn."""
    frames = 0
    cpu_s: dict[str, list[float]] = {name: [] for name in SERVICES}
    together_cpu_s: list[float] = []

    def through_processes() -> float:
        nonlocal frames
        with tempfile.TemporaryDirectory() as out:
            summary = heel_run(recording, Path(out), "--lossless")
        frames = int(summary["frames"]["tracked"])
        for name in SERVICES:
            cpu_s[name].append(float(summary["cpu_s"][name]))
        return float(summary["wall_s"])

    def in_process() -> float:
        with tempfile.TemporaryDirectory() as out:
            summary = heel_run(recording, Path(out), "--in-process")
        together_cpu_s.append(float(summary["cpu_s"]["run"]))
        return float(summary["wall_s"])

    separate, together = interleaved(runs, through_processes, in_process)
    shares = {name: median(values) for name, values in cpu_s.items()}
    return Overhead(frames, median(separate), median(together), shares, median(together_cpu_s))


@app.command()
def main(
    runs: Annotated[int, typer.Option(help="runs of each, interleaved", min=1)] = 5,
    recording: Annotated[
        list[str] | None, typer.Option(help="measure on these sources instead")
    ] = None,
    json: Json = None,
) -> None:
    """Compare the processes with the in-process pipeline on six recordings."""
    table = Table("recording", "frames", "processes s", "in process s", "ratio")
    shares = Table("processor s of", *SERVICES, "all", "in process")
    figures = []
    for source in recordings(recording):
        found = measure(source, runs)
        ratio = found.separate_s / found.together_s
        table.add_row(name_of(source), str(found.frames), f"{found.separate_s:.2f}",
                      f"{found.together_s:.2f}", f"{ratio:.3f}")  # fmt: skip
        used_s = [*found.cpu_s.values(), sum(found.cpu_s.values()), found.together_cpu_s]
        shares.add_row(name_of(source), *(f"{value_s:.2f}" for value_s in used_s))
        figures.append(
            Figure(f"overhead/{name_of(source)}", found.separate_s, "s", "in-process", ratio, runs)
        )
    ratios = [figure.ratio for figure in figures if figure.ratio is not None]
    table.add_section()
    table.add_row("median", "", "", "", f"{median(ratios):.3f}")
    table.add_row("the paper, ROS", "", "", "", "1.006")
    Console().print(table, shares)
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
