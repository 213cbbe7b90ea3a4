"""Time to stop: from a fault to wheels that stand and go on standing.

Starts router, capture, detector, tracker, follower and drive as real processes on free loopback
ports, lets the robot follow a drawn person, and brings each fault about again and again. For the
emergency stop something stands in for capture, detector and tracker. A trial counts only if the
wheels turned at that moment. The wheels are those that the drive's driver is
told (`record`, CLOCK_MONOTONIC).

Example run: python -m benchmarks.time_to_stop --trials 20 --write docs/records/stopping.md
"""

from __future__ import annotations

import math
import random
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.common import Figure, Json, median, write_json
from benchmarks.stopping.fault import Fault
from benchmarks.stopping.faults import all_faults
from benchmarks.stopping.rig import Rig
from benchmarks.stopping.rows import Row, write_table
from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_NEVER_S = 5.0
_ATTEMPTS = 5


def measure(rig: Rig, fault: Fault, trials: int, rng: random.Random) -> Row:
    """Bring one fault about so many times.

    Raises:
        HeelError: the robot does not drive, so that nothing can be measured.
    """
    times_ms: list[float] = []
    for _ in range(trials * _ATTEMPTS):
        time_ms = _trial(rig, fault, rng)
        if time_ms is not None:
            times_ms.append(time_ms)
        if len(times_ms) == trials:
            return Row(fault.name, fault.bound_ms, tuple(times_ms))
    raise HeelError(f"{fault.name}: the robot stood still at most faults: nothing to measure")


def _trial(rig: Rig, fault: Fault, rng: random.Random) -> float | None:
    """Milliseconds from the fault to the stop; None if the robot stood by itself just then."""
    rig.await_driving()
    # Faults come at any phase of frames and commands.
    time.sleep(rng.uniform(0.0, 0.1))
    turned = rig.stands_since_ns() is None
    called_ns = time.monotonic_ns()
    try:
        fault_ns = fault.inject(rig) or called_ns
        stands_ns = _watch(rig, fault)
        if fault.afterwards is not None:
            fault.afterwards(rig)
            # A drive that starts or ends tells its wheels to stand, which is no motion.
            stands_ns = stands_ns if _only_stood(rig, stands_ns) else None
    finally:
        fault.lift(rig)
    if not turned or (stands_ns is not None and stands_ns < fault_ns):
        return None
    if fault.in_ms is not None:
        return fault.in_ms(rig, fault_ns)
    return math.inf if stands_ns is None else (stands_ns - fault_ns) / 1e6


def _only_stood(rig: Rig, since_ns: int | None) -> bool:
    """Whether nothing has moved since a time."""
    if since_ns is None:
        return False
    return not any(v or w for t, v, w in rig.wheels() if t >= since_ns)


def _watch(rig: Rig, fault: Fault) -> int | None:
    """Since when the robot stands, some time after the fault; None if it goes on driving."""
    time.sleep(fault.bound_ms / 1e3 + fault.watch_s)
    deadline_s = time.monotonic() + _NEVER_S
    while (stands_ns := rig.stands_since_ns()) is None and time.monotonic() < deadline_s:
        time.sleep(0.02)
    return stands_ns


def table_of(rows: list[Row]) -> Table:
    """One line per fault."""
    table = Table("fault", "trials", "median", "p95", "p99", "max", "bound", title="ms to zero")
    for row in rows:
        *cells, bound = row.cells()
        table.add_row(*cells, bound if row.worst_ms <= row.bound_ms else f"{bound}  MISSED")
    return table


def figures_of(rows: list[Row]) -> list[Figure]:
    """Median, p95, p99 and maximum of every row against its bound."""
    return [
        Figure(f"time-to-stop/{row.name} {name}", value, "ms", "bound",
               value / row.bound_ms, len(row.times_ms))
        for row in rows
        for name, value in (
            ("median", median(row.times_ms)), ("p95", row.percentile_ms(95)),
            ("p99", row.percentile_ms(99)), ("max", row.worst_ms),
        )
    ]  # fmt: skip


@app.command()
def main(
    trials: Annotated[int, typer.Option(help="trials of every fault", min=1)] = 20,
    only: Annotated[str, typer.Option(help="faults whose name holds one of these, A,B")] = "",
    seed: Annotated[int, typer.Option(help="of the moments at which faults come")] = 1,
    json: Json = None,
    write: Annotated[Path | None, typer.Option(help="put the rows into this document")] = None,
    logs: Annotated[Path | None, typer.Option(help="keep the services' logs here")] = None,
) -> None:
    """Bring every fault about and print the times to a robot that stands."""
    words = [word.strip() for word in only.split(",")]
    faults = [fault for fault in all_faults() if any(word in fault.name for word in words)]
    if not faults:
        names = ", ".join(fault.name for fault in all_faults())
        raise SettingsError(f"--only {only}: no such fault; there are {names}")
    # Ended from outside, it still takes its processes along, also those that it has frozen.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    rng = random.Random(seed)
    rows = []
    for perception in (True, False):
        some = [fault for fault in faults if fault.perception == perception]
        if not some:
            continue
        with tempfile.TemporaryDirectory() as temporary:
            with Rig((logs or Path(temporary)) / ("all" if perception else "robot"),
                     perception) as rig:  # fmt: skip
                for fault in some:
                    rows.append(measure(rig, fault, trials, rng))
                    times = ", ".join(f"{t:.0f}" for t in rows[-1].times_ms)
                    typer.echo(f"{fault.name}: {times}", err=True)
    Console().print(table_of(rows))
    write_json(figures_of(rows), json)
    if write is not None:
        write_table(rows, [fault.name for fault in all_faults()], write)
    missed = [row.name for row in rows if row.worst_ms > row.bound_ms]
    if missed:
        raise HeelError(f"too slow: {', '.join(missed)}")


if __name__ == "__main__":
    run_app(app)
