"""Services on another host, over a good link and a bad one: frames a second, and ages of commands.

Two network namespaces on this machine are the hosts (`benchmarks.links`). The robot has router and
camera, 768x576 at 25 frames/s; what is elsewhere is started with the flag of the guide and nothing
else, by TCP or by UDP. `command age` is from the follower to whoever obeys, over the link where the
two are apart.

Example run: python -m benchmarks.remote --write docs/records/remote.md
"""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Annotated

import typer

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, Figure, Json, Write, publish, write_json
from benchmarks.links.hosts import Host, Hosts, LinkModel, two_hosts
from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
PORT = 7447
SERVICES = ("capture", "detector", "tracker", "follower", "drive")
SOURCE = "scene:demo?width=768&height=576"
LINKS = {
    "1 Gbit/s": LinkModel(delay_ms=0.2, rate_mbit=1000.0),
    "20 Mbit/s": LinkModel(delay_ms=1.0, rate_mbit=20.0),
    "20 Mbit/s, 50 ms, 1 % lost": LinkModel(delay_ms=25.0, rate_mbit=20.0, loss=0.01),
}
LAYOUTS = {
    "detector": ("detector",),
    "detector, tracker, follower, page": ("detector", "tracker", "follower", "web"),
    "detector, drive, page": ("detector", "drive", "web"),
}
MOST_AGE_MS = 150.0
_UP_S = 180.0
_SETTLE_S = 3.0


PROTOCOLS = ("tcp", "udp")
"""By which services elsewhere reach the router."""


@dataclass(frozen=True)
class Row:
    """What one layout did over one link."""

    elsewhere: str
    protocol: str
    link: str
    frames_hz: float
    """Frames that the detector worked on."""
    command_ms: tuple[float, float, float]
    """Age of commands: p50, p99, and the greatest."""
    commands_hz: float
    out_mbit: float
    """From the robot to the other host."""
    back_mbit: float


@contextmanager
def stack(
    hosts: Hosts, elsewhere: tuple[str, ...], protocol: str, source: str, folder: Path
) -> Iterator[None]:
    """The whole robot, some of it on the other host; every service is up.

    Raises:
        HeelError: one is not.
    """
    wide = [_endpoint(hosts.here, one) for one in PROTOCOLS]
    with ExitStack() as resources:
        _start(
            resources, hosts.here, folder, "router", "--insecure", "--listen",
            ",".join((f"tcp/127.0.0.1:{PORT}", *wide)),
        )  # fmt: skip
        for service in (*SERVICES, *(one for one in elsewhere if one not in SERVICES)):
            host = hosts.there if service in elsewhere else hosts.here
            words = [source, "--loop"] if service == "capture" else []
            where = ["--connect", _endpoint(hosts.here, protocol)] if service in elsewhere else []
            _start(resources, host, folder, service, *words, *where)
        deadline_s = time.monotonic() + _UP_S
        for service in (*SERVICES, *elsewhere):
            log = folder / f"{service}.log"
            while " is up" not in log.read_text():
                if time.monotonic() > deadline_s:
                    raise HeelError(f"{service} is not up within {_UP_S:g} s: {log.read_text()}")
                time.sleep(0.1)
        yield


def _endpoint(router: Host, protocol: str) -> str:
    return f"{protocol}/{router.address}:{PORT}"


def _start(resources: ExitStack, host: Host, folder: Path, service: str, *words: str) -> None:
    log: IO[bytes] = resources.enter_context((folder / f"{service}.log").open("wb"))
    process = subprocess.Popen(
        host.command(sys.executable, "-P", "-m", "heel", service, *words),
        cwd=REPOSITORY, env=os.environ | NAMED_NETWORKS, stdin=subprocess.DEVNULL,
        stdout=log, stderr=log,
    )  # fmt: skip
    resources.callback(process.wait, _UP_S)
    resources.callback(process.terminate)


def measure(
    hosts: Hosts, name: str, protocol: str, link: str, seconds: float, source: str = SOURCE
) -> Row:
    """One layout over one link.

    Raises:
        HeelError: a service does not start, or nothing arrives.
    """
    elsewhere = LAYOUTS[name]
    with tempfile.TemporaryDirectory(prefix="heel-") as folder:
        hosts.change(LINKS["1 Gbit/s"])
        with stack(hosts, elsewhere, protocol, source, Path(folder)):
            hosts.change(LINKS[link])
            time.sleep(_SETTLE_S)
            before, started_s = hosts.passed_bytes(), time.monotonic()
            obeying = hosts.there if "drive" in elsewhere else hosts.here
            obeys_by = _endpoint(hosts.here, protocol if "drive" in elsewhere else "tcp")
            heard = [
                _probe(hosts.here, _endpoint(hosts.here, "tcp"), seconds),
                _probe(obeying, obeys_by, seconds),
            ]
            said = [json.loads(one.communicate(timeout=seconds + _UP_S)[0]) for one in heard]
            after, took_s = hosts.passed_bytes(), time.monotonic() - started_s
    ages_ms = sorted(1e3 * age_s for age_s in said[1].get("command", []))
    frames = len(said[0].get("blobs", []))
    if not ages_ms:
        raise HeelError(f"{name} by {protocol} over {link}: no command arrived")
    out, back = (8e-6 * (late - early) / took_s for late, early in zip(after, before, strict=True))
    return Row(
        name, protocol, link, frames / seconds,
        (_percentile(ages_ms, 0.5), _percentile(ages_ms, 0.99), ages_ms[-1]),
        len(ages_ms) / seconds, out, back,
    )  # fmt: skip


def _probe(host: Host, endpoint: str, seconds: float) -> subprocess.Popen[str]:
    return subprocess.Popen(
        host.command(sys.executable, "-m", "benchmarks.links.probe", endpoint, str(seconds)),
        cwd=REPOSITORY, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip


def _percentile(ordered: list[float], share: float) -> float:
    return ordered[min(len(ordered) - 1, math.ceil(share * len(ordered)) - 1)]


def table_of(rows: list[Row]) -> str:
    """Markdown, one line a row."""
    lines = [
        "| elsewhere | by | link | frames/s | command age p50 | p99 | max, ms | commands/s | "
        "robot to there | back, Mbit/s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.elsewhere} | {row.protocol} | {row.link} | {row.frames_hz:.1f} | "
        f"{row.command_ms[0]:.0f} | {row.command_ms[1]:.0f} | {row.command_ms[2]:.0f} | "
        f"{row.commands_hz:.0f} | "
        f"{row.out_mbit:.1f} | {row.back_mbit:.1f} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def _name(row: Row) -> str:
    return f"{row.elsewhere} by {row.protocol} over {row.link}"


@app.command()
def main(
    seconds: Annotated[float, typer.Option(help="of each row", min=1)] = 30.0,
    only: Annotated[
        str, typer.Option(help="rows of which this is a part: ELSEWHERE by PROTOCOL over LINK")
    ] = "",
    source: Annotated[str, typer.Option(help="what the camera sees")] = SOURCE,
    json: Json = None,
    write: Write = None,
) -> None:
    """Print frames, ages and bandwidth of every layout over every link."""
    rows = []
    with two_hosts(LINKS["1 Gbit/s"]) as hosts:
        for name, link, protocol in itertools.product(LAYOUTS, LINKS, PROTOCOLS):
            if only in f"{name} by {protocol} over {link}":
                rows.append(measure(hosts, name, protocol, link, seconds, source))
                typer.echo(table_of(rows[-1:]).splitlines()[-1], err=True)
    publish(table_of(rows), write, "remote")
    write_json(
        [Figure(f"remote/{_name(row)}: command age p99", row.command_ms[1], "ms",
                "bound", row.command_ms[1] / MOST_AGE_MS, 1) for row in rows], json,
    )  # fmt: skip
    old = [_name(row) for row in rows if row.command_ms[1] > MOST_AGE_MS]
    if old:
        raise HeelError(f"commands older than {MOST_AGE_MS:g} ms: {'; '.join(old)}")


if __name__ == "__main__":
    run_app(app)
