"""What two linked routers of a building pass on, and how long a stop takes across them.

One router each for two parts of a building, the second linked to the first through a relay of this
program that counts bytes. A robot (camera, follower, drive) is on either; everything that looks or
stops is a client of the second router.

Example run: python -m benchmarks.linked_routers --write docs/records/scale.md
"""

from __future__ import annotations

import os
import select
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import zenoh

from benchmarks.common import Write, publish, wait_for
from benchmarks.scale import Listener, client, robots, router_process
from heel.schemas import DriveState, EStop, decode, encode, keys
from heel.services.runtime import robots as many
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
FAR, NEAR = "far", "near"
"""Names of the robot on the first router, and of the one on the second, where the clients are."""
_START_S = 120.0
"""Longest start of all processes, on a busy machine; chosen by hand."""
_STEADY = 20
"""Messages of each service before the measurement begins; chosen by hand."""
_STOP_S = 2.0
"""Longest way of a stop; one that takes longer counts as lost. Chosen by hand."""
_SETTLE_S = 1.0
"""Seconds after a subscription before its bytes are counted; chosen by hand."""
_CHUNK = 1 << 16


class Relay(threading.Thread):
    """Passes every connection on to a port of loopback, and counts bytes of both directions."""

    def __init__(self, port: int) -> None:
        super().__init__(name="relay", daemon=True)
        self._to = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.count = 0
        """Bytes that came from the first router, towards the second."""
        self._over = threading.Event()

    def run(self) -> None:
        """Until `close`."""
        while not self._over.is_set():
            try:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._to))
            except OSError:
                return
            threading.Thread(target=self._pass_on, args=(near, far), daemon=True).start()

    def _pass_on(self, near: socket.socket, far: socket.socket) -> None:
        with near, far:
            while not self._over.is_set():
                for ready in select.select((near, far), (), (), 0.2)[0]:
                    data = ready.recv(_CHUNK)
                    if not data:
                        return
                    if ready is far:
                        self.count += len(data)
                        near.sendall(data)
                    else:
                        far.sendall(data)

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._listener.close()


def kbytes_s(relay: Relay, seconds: float, listen: Callable[[], ExitStack]) -> float:
    """Kilobytes a second that cross the link while somebody listens."""
    with listen():
        time.sleep(_SETTLE_S)
        before, begun_s = relay.count, time.monotonic()
        time.sleep(seconds)
        return (relay.count - before) / (time.monotonic() - begun_s) * 1e-3


def subscribed(session: zenoh.Session, *wanted: str) -> ExitStack:
    """Listen to some keys until the stack is closed."""
    stack = ExitStack()
    for key in wanted:
        stack.callback(session.declare_subscriber(key, lambda _sample: None).undeclare)
    return stack


def stop_ms(session: zenoh.Session, robot: str, trials: int) -> list[float]:
    """From the stop that is sent to the drive's word that it stands, as both are seen here."""
    told = threading.Condition()
    state: list[DriveState] = []

    def hear(sample: zenoh.Sample) -> None:
        with told:
            state[:] = [decode(DriveState, sample.payload.to_bytes(), str(sample.encoding))]
            told.notify_all()

    def until(engaged: bool) -> bool:
        with told:
            return told.wait_for(lambda: bool(state) and state[0].estop is engaged, _STOP_S)

    subscriber = session.declare_subscriber(f"{robot}/{keys.ROBOT_DRIVE}", hear)
    publisher = session.declare_publisher(
        f"{robot}/{keys.FOLLOW_ESTOP}", express=True, priority=zenoh.Priority.REAL_TIME
    )
    took_ms: list[float] = []
    for number in range(1, trials + 1):
        stop = EStop(engaged=True, source="benchmark", t_ns=time.time_ns(), id=f"{number:04x}")
        begun_s = time.monotonic()
        publisher.put(encode(stop), encoding=stop.encoding())
        took_ms.append(1e3 * (time.monotonic() - begun_s) if until(True) else float("inf"))
        release = stop.model_copy(update={"engaged": False, "t_ns": time.time_ns()})
        publisher.put(encode(release), encoding=release.encoding())
        until(False)
    subscriber.undeclare()  # type: ignore[no-untyped-call]
    publisher.undeclare()  # type: ignore[no-untyped-call]
    return took_ms


@contextmanager
def building(fps: float) -> Iterator[tuple[zenoh.Session, Relay]]:
    """Two linked routers with a robot on each; a client of the second one, and the link."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        first, _ = stack.enter_context(router_process(folder / "first.log"))
        relay = Relay(int(first.rpartition(":")[2]))
        stack.callback(relay.close)
        relay.start()
        second, _ = stack.enter_context(
            router_process(folder / "second.log", "--connect", f"tcp/127.0.0.1:{relay.port}")
        )
        session = stack.enter_context(client(second))
        with ExitStack() as starting:
            listener = Listener(session, starting)
            pids = stack.enter_context(robots((FAR,), fps, first, folder))
            pids |= stack.enter_context(robots((NEAR,), fps, second, folder))

            def steady() -> bool | None:
                sent = [listener.health.get(one) for one in pids]
                return all(one is not None and one.sent >= _STEADY for one in sent) or None

            wait_for(steady, _START_S, "not all services send")
        yield session, relay


@app.command()
def main(
    seconds: Annotated[float, typer.Option(help="of each count of bytes")] = 6.0,
    fps: Annotated[float, typer.Option(help="of every camera")] = 8.0,
    trials: Annotated[int, typer.Option(help="stops of each kind")] = 50,
    write: Write = None,
) -> None:
    """Print what crosses the link, and how long stops take."""
    with building(fps) as (session, relay):
        rows = [
            ("nobody", kbytes_s(relay, seconds, ExitStack)),
            ("`heel status --all`, or the page of robots",
             kbytes_s(relay, seconds, lambda: subscribed(session, *many.TOPICS.values()))),
            ("one robot's page, without its picture",
             kbytes_s(relay, seconds, lambda: subscribed(
                 session, *(f"{FAR}/{key}" for key in (
                     keys.tracks("front"), keys.FOLLOW_STATE, keys.FOLLOW_COMMAND,
                     keys.ROBOT_DRIVE, keys.ALL_HEALTH))))),
        ]  # fmt: skip
        stops = {name: stop_ms(session, name, trials) for name in (NEAR, FAR)}
    lines = ["| who listens at the other router | kB/s over the link |", "|---|---|"]
    lines += [f"| {who} | {rate:.1f} |" for who, rate in rows]
    lines += ["", "| a stop goes | stops | lost | ms, median | ms, 95 % | ms, most |",
              "|---|---|---|---|---|---|"]  # fmt: skip
    for way, name in (("by one router", NEAR), ("across both", FAR)):
        known = [one for one in stops[name] if np.isfinite(one)]
        lines.append(
            f"| {way} | {trials} | {trials - len(known)} | {np.median(known):.1f} | "
            f"{np.percentile(known, 95):.1f} | {max(known):.1f} |"
        )
    told = (f"{len(os.sched_getaffinity(0))} cores, two robots at {fps:g} frames/s, "
            f"{seconds:g} s for each count of bytes.\n\n")  # fmt: skip
    publish(told + "\n".join(lines) + "\n", write, "linked")


if __name__ == "__main__":
    run_app(app)
