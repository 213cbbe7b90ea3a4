"""What a take-over costs: frames without an answer, seconds, and people under another id.

Two trackers, of which one stands by, work on two people that walk to and fro; a follower follows
one of them. The work goes to and fro by the message that `heel swap` sends, then the one that works
is killed (SIGKILL) and started again to stand by. Likewise two detectors, on a drawn scene.

Frames are counted by their numbers: those between the last answer of one and the first of the
other. Seconds are between these two answers, as a receiver gets them.

Example run: python -m benchmarks.swaps --swaps 50 --kills 10
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
import typer
import zenoh

from heel.schemas import (
    Blobs,
    FollowState,
    Handover,
    Health,
    HeelError,
    Message,
    MessageError,
    Stamp,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.run.children import Child, start_python
from heel.services.runtime import qos
from heel.services.runtime.chain import STANDBY
from heel.services.runtime.command_line import run_app
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.router import open_private_router
from heel.services.runtime.succession import READY
from tests.unit.tracker import drawn_detections as drawn

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
Service = Literal["tracker", "detector"]
M = TypeVar("M", bound=Message)
_SCENE = "scene:pacing?width=320&height=240&fps={fps:g}"
_START_S = 120.0
"""Longest wait [s] for a process, also on a busy machine."""
_BETWEEN_S = 0.6
"""Seconds after a take-over in which ids are looked at; chosen by hand: half a second of frames."""
_MOST_FRAMES_PLANNED = 3
"""The goal of a planned take-over."""
_MOST_S_KILLED = 1.0
"""The goal after SIGKILL."""
_MARKS = "<!-- measured -->", "<!-- end of measured -->"


@dataclass
class Heard:
    """Answers as a receiver gets them, and what services tell of themselves."""

    answers: list[tuple[str, int, float]] = field(default_factory=list)
    """Sender, number of the frame, monotonic time."""
    people: list[tuple[float, frozenset[int]]] = field(default_factory=list)
    states: list[tuple[float, FollowState]] = field(default_factory=list)
    health: dict[str, Health] = field(default_factory=dict)

    def is_ready(self, name: str) -> bool:
        """Whether one that stands by can take over without a loss."""
        told = self.health.get(name)
        return told is not None and told.details.get(STANDBY, "").startswith(READY)

    def leader(self) -> str:
        """Who has answered last: service and instance."""
        return self.answers[-1][0].partition("@")[0] if self.answers else ""


@dataclass
class Row:
    """One take-over after the other."""

    name: str
    frames: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    other_ids: int = 0
    not_followed: int = 0

    def cells(self, goal: str) -> str:
        """A row of the table."""
        frames, seconds = np.array(self.frames), np.array(self.seconds)
        return (
            f"| {self.name} | {len(frames)} | {np.median(frames):.0f} | {frames.max()} "
            f"| {1e3 * np.median(seconds):.0f} | {1e3 * seconds.max():.0f} | {self.other_ids} "
            f"| {self.not_followed} | {goal} |"
        )


def walking(seq: int, fps: float) -> Blobs:
    """Two people that walk to and fro, for ever."""

    def to_and_fro(first: float, speed: float) -> Callable[[float], tuple[float, float]]:
        def where(t_s: float) -> tuple[float, float]:
            way = (first + speed * t_s) % 800.0
            return 120.0 + min(way, 800.0 - way), 400.0

        return where

    people = [
        drawn.Person(drawn.GREEN, to_and_fro(0.0, 40.0)),
        drawn.Person(drawn.RED, to_and_fro(500.0, 25.0)),
    ]
    return drawn.message(people, seq, fps)


class Bench:
    """The processes of one measurement, in a run folder and with a router of their own."""

    def __init__(self, service: Service, fps: float, stack: ExitStack) -> None:
        self._service, self._fps, self._stack = service, fps, stack
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="heel-swaps-"))
        self._logs = Path(folder)
        self._environment = {**os.environ, VARIABLE: folder}
        self.session, self._endpoint = stack.enter_context(open_private_router())
        self.heard = Heard()
        stream = keys.tracks("front") if service == "tracker" else keys.blobs("front")
        for key, take in (
            (stream, self._hear), (keys.tracks("front"), self._hear_tracks),
            (keys.ALL_HEALTH, self._hear_health), (keys.FOLLOW_STATE, self._hear_state),
        ):  # fmt: skip
            stack.callback(self.session.declare_subscriber(key, take).undeclare)
        self.children: dict[str, Child] = {}
        stack.callback(self._end)

    def begin(self) -> None:
        """Start everything, and wait until the one that stands by is ready."""
        self.start(self._service, "a")
        self.start(self._service, "b", "--standby")
        self.start("follower", "main", "--target", "nearest")
        if self._service == "detector":
            self.start("tracker", "main")
            self.start("capture", "main", _SCENE.format(fps=self._fps), "--loop")
        else:
            over = threading.Event()
            source = threading.Thread(target=self._send, args=(over,), daemon=True)
            source.start()
            self._stack.callback(source.join)
            self._stack.callback(over.set)
        self.await_ready()
        states = self.heard.states
        if self._service == "tracker":
            self.until(
                lambda: bool(states) and states[-1][1].state == "following", "a person followed"
            )

    def start(self, service: str, instance: str, *flags: str) -> None:
        """Start a process."""
        words = ("-m", f"heel.services.{service}", *flags, "--instance", instance, "--connect",
                 self._endpoint, "--log-format", "json")  # fmt: skip
        words += ("--model", "none") if service == "detector" else ()
        with (self._logs / f"{service}-{instance}.log").open("ab") as log:
            child = Child(service, start_python(words, log, self._environment))
        self.children[f"{service}/{instance}"] = child

    def await_ready(self) -> None:
        """Until the one that does not work could take over."""

        def ready() -> bool:
            leader = self.heard.leader()
            return leader != "" and self.heard.is_ready(self._other(leader))

        self.until(ready, f"a {self._service} in step")

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait.

        Raises:
            HeelError: it did not come.
        """
        deadline_s = time.monotonic() + _START_S
        while not condition():
            if time.monotonic() > deadline_s:
                raise HeelError(f"{what}: not within {_START_S:g} s")
            time.sleep(0.01)

    def hand_over(self, row: Row) -> None:
        """One planned take-over."""
        before, ids = self.heard.leader(), self._ids()
        successor = self.heard.health[self._other(before)].producer
        request = Handover(successor=successor)
        begun = len(self.heard.answers)
        key = keys.handover("front", self._service)
        for reply in self.session.get(key, payload=encode(request), timeout=2.0):
            if reply.ok is None:
                raise HeelError("the one that works refuses to hand over")
        self._measure(row, before, begun, ids)

    def kill(self, row: Row) -> None:
        """SIGKILL the one that works; afterwards it stands by."""
        before, ids = self.heard.leader(), self._ids()
        begun = len(self.heard.answers)
        child = self.children[before]
        child.process.kill()
        child.process.wait()
        self._measure(row, before, begun, ids)
        self.heard.health.pop(before, None)
        self.start(self._service, before.partition("/")[2], "--standby")

    def _measure(self, row: Row, before: str, begun: int, ids: frozenset[int]) -> None:
        self.until(lambda: self.heard.leader() == self._other(before), "an answer of the other")
        time.sleep(_BETWEEN_S)
        answers = self.heard.answers[begun - 1 :]
        first = next(k for k, one in enumerate(answers) if one[0].startswith(self._other(before)))
        last = max(k for k in range(first) if answers[k][0].startswith(before))
        row.frames.append(max(0, answers[first][1] - answers[last][1] - 1))
        row.seconds.append(answers[first][2] - answers[last][2])
        row.other_ids += self._ids() != ids
        since_s = answers[last][2]
        others = [
            f"{state.state} after {at_s - since_s:.2f} s: {state.reason}"
            for at_s, state in self.heard.states
            if at_s >= since_s and state.state != "following"
        ]
        row.not_followed += bool(others)
        if others:
            typer.echo(f"{self._service}, {before}: {others[0]}", err=True)

    def _ids(self) -> frozenset[int]:
        """Who is in sight; where people come and go by themselves, who is followed."""
        if self._service == "tracker":
            return self.heard.people[-1][1]
        states = self.heard.states
        return frozenset({states[-1][1].target.track_id or 0} if states else ())

    def _other(self, name: str) -> str:
        return f"{self._service}/{'b' if name.endswith('/a') else 'a'}"

    def _send(self, over: threading.Event) -> None:
        out = StreamPublisher(
            self.session, keys.blobs("front"), qos.BLOBS, "live", "detector/main@00000001"
        )
        begun_s, seq = time.monotonic(), 0
        while not over.wait(max(0.0, begun_s + seq / self._fps - time.monotonic())):
            out.send(walking(seq, self._fps), 0.0)
            seq += 1

    def _hear(self, sample: zenoh.Sample) -> None:
        kind: type[Blobs | Tracks] = Tracks if self._service == "tracker" else Blobs
        if sample.attachment is not None:
            stamp = decode(Stamp, sample.attachment.to_bytes())
            message = decode(kind, sample.payload.to_bytes())
            self.heard.answers.append((stamp.producer, message.seq, time.monotonic()))

    def _hear_tracks(self, sample: zenoh.Sample) -> None:
        if (tracks := _read(Tracks, sample)) is not None:
            shown = frozenset(track.id for track in tracks.tracks if track.shown)
            self.heard.people.append((time.monotonic(), shown))

    def _hear_health(self, sample: zenoh.Sample) -> None:
        if (health := _read(Health, sample)) is not None:
            self.heard.health[f"{health.service}/{health.instance}"] = health

    def _hear_state(self, sample: zenoh.Sample) -> None:
        if (state := _read(FollowState, sample)) is not None:
            self.heard.states.append((time.monotonic(), state))

    def _end(self) -> None:
        for child in self.children.values():
            child.process.terminate()
        for child in self.children.values():
            try:
                child.process.wait(3.0)
            except subprocess.TimeoutExpired:
                child.process.kill()
                child.process.wait()


def _read(kind: type[M], sample: zenoh.Sample) -> M | None:
    try:
        return decode(kind, sample.payload.to_bytes())
    except MessageError:
        return None


@contextmanager
def bench(service: Service, fps: float) -> Iterator[Bench]:
    """All processes, ready."""
    with ExitStack() as stack:
        made = Bench(service, fps, stack)
        made.begin()
        yield made


@app.command()
def main(
    swaps: Annotated[int, typer.Option(help="planned take-overs of each", min=1)] = 50,
    kills: Annotated[int, typer.Option(help="kills of each", min=0)] = 10,
    fps: Annotated[float, typer.Option(help="frames a second", min=1)] = 25.0,
    only: Annotated[str, typer.Option(help="tracker or detector")] = "tracker,detector",
    write: Annotated[Path | None, typer.Option(help="page for the table", metavar="FILE")] = None,
) -> None:
    """Measure take-overs; prints a table."""
    lines = [
        "| take-over | of them | frames, median | max | ms, median | max | other ids "
        "| not followed throughout | goal |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    services: tuple[Service, ...] = ("tracker", "detector")
    for service in services:
        if service not in only:
            continue
        planned, killed = Row(f"{service}, planned"), Row(f"{service}, SIGKILL")
        with bench(service, fps) as made:
            for row, count, take_over in (
                (planned, swaps, made.hand_over), (killed, kills, made.kill),
            ):  # fmt: skip
                for _ in range(count):
                    made.await_ready()
                    take_over(row)
        lines.append(planned.cells(f"<= {_MOST_FRAMES_PLANNED} frames, same ids"))
        if killed.frames:
            lines.append(killed.cells(f"<= {1e3 * _MOST_S_KILLED:.0f} ms, same ids"))
    table = "\n".join(lines)
    typer.echo(table)
    if write is not None:
        head, _, rest = write.read_text(encoding="utf-8").partition(_MARKS[0])
        tail = rest.partition(_MARKS[1])[2]
        write.write_text(f"{head}{_MARKS[0]}\n{table}\n{_MARKS[1]}{tail}", encoding="utf-8")


if __name__ == "__main__":
    run_app(app)
