"""`python -m benchmarks.importing`: what `import heel` costs, beside Python's own start.

Interleaved runs of `python -c STATEMENT` in processes of their own; medians.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections import defaultdict
from typing import Annotated

import typer

STATEMENTS = {
    "python alone": "pass",
    "import heel": "import heel",
    "messages": "import heel; heel.decode",
    "tracking": "import heel; heel.open",
}
"""What is measured, by the name of its row."""
PROMISED_S = 0.3
"""Longest `import heel` on any machine that runs Heel live; a bare interpreter takes a tenth."""


def main(
    runs: Annotated[int, typer.Option(help="runs of each statement", min=1)] = 11,
) -> None:
    """Print medians; exit code 1 if `import heel` takes longer than is promised."""
    seconds: dict[str, list[float]] = defaultdict(list)
    for _ in range(runs):
        for name, statement in STATEMENTS.items():
            started_s = time.perf_counter()
            subprocess.run([sys.executable, "-c", statement], check=True)
            seconds[name].append(time.perf_counter() - started_s)
    for name, taken in seconds.items():
        typer.echo(f"{name:<14}{statistics.median(taken):6.3f} s")
    if statistics.median(seconds["import heel"]) > PROMISED_S:
        typer.echo(f"import heel takes longer than {PROMISED_S:g} s")
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
