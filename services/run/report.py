"""What a run tells the person who typed it."""

from __future__ import annotations

from rich.console import Console

from heel.services.run.summary import RunSummary, percentiles
from heel.services.runtime.logs import printable


def print_summary(summary: RunSummary, where: str) -> None:
    """Print frames, rate, drops, ages and, in the words given, where the files are."""
    # Paths and reasons are no markup, whatever brackets are in them.
    console = Console(highlight=False, soft_wrap=True, markup=False, emoji=False)
    rate = summary.tracked / summary.wall_s if summary.wall_s > 0 else 0.0
    console.print(
        f"{summary.captured} frames captured, {summary.detected} detected, {summary.tracked} "
        f"tracked in {summary.wall_s:.1f} s ({rate:.1f} frames/s); {printable(summary.ended)}"
    )
    lost = {name: count for name, count in summary.dropped().items() if count}
    if lost:
        console.print("dropped: " + ", ".join(f"{name} {count}" for name, count in lost.items()))
    for hop, ages in summary.ages_ms.items():
        p = percentiles(ages)
        console.print(f"age at {hop}: median {p['median']:.1f} ms, p99 {p['p99']:.1f} ms")
    console.print(printable(where))
