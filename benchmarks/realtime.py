"""Real time on this machine: 768x576 at 25 frames/s, live, through all four processes.

Reports dropped frames, the age of a frame at the first command that rests on it, and the memory
of each service, against what a robot needs: no drops, p99 below 60 ms, 250 MB.

Example run: python -m benchmarks.realtime --runs 5 --seconds 20
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.common import Figure, Json, data_folder, heel_run, median, write_json
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
FRAMES_PER_S = 25
LIMITS = {"dropped": 0.0, "command age p50": 60.0, "command age p99": 60.0}
MEMORY_LIMIT_MB = 250.0


def source() -> str:
    """PETS09-S2L1 where it is at hand (768x576), else the drawn scene at the same size."""
    recording = data_folder() / "PETS09-S2L1"
    return str(recording) if recording.is_dir() else "scene:demo?width=768&height=576"


def figures_of(summary: dict[str, Any]) -> dict[str, tuple[float, str, float]]:
    """Name to value, unit and limit."""
    ages = summary["age_ms"]["command"]
    found = {
        "dropped": (float(sum(summary["dropped"].values())), "frames", LIMITS["dropped"]),
        "command age p50": (ages["median"], "ms", LIMITS["command age p50"]),
        "command age p99": (ages["p99"], "ms", LIMITS["command age p99"]),
    }
    for service, peak_mb in sorted(summary["peak_rss_mb"].items()):
        if service != "run":
            found[f"{service} memory"] = (peak_mb, "MB", MEMORY_LIMIT_MB)
    return found


@app.command()
def main(
    runs: Annotated[int, typer.Option(help="live runs", min=1)] = 5,
    seconds: Annotated[float, typer.Option(help="length of each run")] = 20.0,
    json: Json = None,
) -> None:
    """Run live and report medians over the runs, and the worst run."""
    measured: dict[str, list[tuple[float, str, float]]] = {}
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as out:
            summary = heel_run(
                source(), Path(out), "--live", "--loop", "--fps", str(FRAMES_PER_S),
                "--seconds", str(seconds),
            )  # fmt: skip
        for name, figure in figures_of(summary).items():
            measured.setdefault(name, []).append(figure)
    table = Table("figure", "median", "worst", "limit", "unit", title=source())
    figures = []
    for name, rows in measured.items():
        _, unit, limit = rows[0]
        values = [value for value, _, _ in rows]
        table.add_row(name, f"{median(values):.1f}", f"{max(values):.1f}", f"{limit:g}", unit)
        ratio = median(values) / limit if limit else None
        figures.append(Figure(f"realtime/{name}", median(values), unit, "limit", ratio, runs))
    Console().print(table)
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
