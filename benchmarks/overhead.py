"""The paper's Figure 8: what separating the stages costs, over whole recordings.

Wall time from the first frame to the last tracks, through four processes over Zenoh, divided by
the same cores called one after the other in one process. The paper pays 1.0064 for ROS.

Example run: python -m benchmarks.overhead --runs 5 --json overhead.json
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.common import Figure, heel_run, interleaved, median, name_of, recordings, write_json
from services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def measure(recording: str, runs: int) -> tuple[float, float, int]:
    """Median wall seconds through processes and in one process, and the number of frames."""
    frames = 0

    def through_processes() -> float:
        nonlocal frames
        with tempfile.TemporaryDirectory() as out:
            summary = heel_run(recording, Path(out), "--lossless")
        frames = int(summary["frames"]["tracked"])
        return float(summary["wall_s"])

    def in_process() -> float:
        with tempfile.TemporaryDirectory() as out:
            return float(heel_run(recording, Path(out), "--in-process")["wall_s"])

    separate, together = interleaved(runs, through_processes, in_process)
    return median(separate), median(together), frames


@app.command()
def main(
    runs: Annotated[int, typer.Option(help="runs of each, interleaved", min=1)] = 5,
    recording: Annotated[
        list[str] | None, typer.Option(help="measure on these sources instead")
    ] = None,
    json: Annotated[Path | None, typer.Option(help="write the figures here")] = None,
) -> None:
    """Compare the processes with the in-process pipeline on six recordings."""
    table = Table("recording", "frames", "processes s", "in process s", "ratio")
    figures = []
    for source in recordings(recording):
        separate_s, together_s, frames = measure(source, runs)
        ratio = separate_s / together_s
        table.add_row(name_of(source), str(frames), f"{separate_s:.2f}", f"{together_s:.2f}",
                      f"{ratio:.3f}")  # fmt: skip
        figures.append(
            Figure(f"overhead/{name_of(source)}", separate_s, "s", "in-process", ratio, runs)
        )
    ratios = [figure.ratio for figure in figures if figure.ratio is not None]
    table.add_section()
    table.add_row("median", "", "", "", f"{median(ratios):.3f}")
    table.add_row("the paper, ROS", "", "", "", "1.006")
    Console().print(table)
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
