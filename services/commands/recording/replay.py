"""`heel replay`: a recording sent again on the robot's bus, in its own time or another."""

from __future__ import annotations

import sys
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Self

import typer

from heel.schemas import (
    CameraInfo,
    FrameId,
    Header,
    HeelError,
    MessageError,
    SettingsError,
    Tracks,
    decode,
    keys,
)
from heel.services.commands.robot import TIMEOUT_S, RobotFlags, for_robot, session_with
from heel.services.recordings.wire import WireMessage

if TYPE_CHECKING:
    import zenoh

    from heel.services.runtime.publishing import Latched
    from heel.services.runtime.qos import Delivery

SEEN = ("image", "jpeg", "info", "blobs", "tracks", "events", "odometry", "range", "truth", "world")
"""What is sent unless topics are named: what cameras, sensors and perception said. What follower
and drive said is left out, so that a recording moves no robot and releases no stop by accident."""
_PICTURES = ("image", "jpeg")
_OF_PICTURES = frozenset({"blobs", "tracks", "events"})
"""What others make of the pictures anew in a lossless replay."""
_NEVER = {
    "taken": "it says when a frame was taken, by the clock of then: every frame would be too old",
    "progress": "it is credit for frames of then",
}
_MOVING = frozenset({"command", "estop", "manual"})
_TRACKS_S = 20.0
"""Longest wait [s] for tracks of frames that were sent, as of a lossless capture."""
_TURN_S = 0.05
"""Longest wait [s] for tracks before it is looked whether to end."""
_ELSEWHERE = "0"
"""Host that a replayed camera names where it has JPEGs only: receivers take those of a camera on
another host."""


@dataclass(frozen=True)
class Selection:
    """Which topics are sent.

    Attributes:
        names: of `keys.TOPICS`.
    """

    names: tuple[str, ...]

    def topic_of(self, key: str) -> str | None:
        """The name of a key's topic, None if it is not sent."""
        for name in self.names:
            if fits(keys.TOPICS[name], key):
                return name
        return None


def selection(named: str | None) -> Selection:
    """The topics that a user names, separated by commas.

    Raises:
        SettingsError: there is no such topic, or it is never sent again.
    """
    if named is None:
        return Selection(SEEN)
    names = tuple(part.strip() for part in named.split(",") if part.strip())
    for name in names:
        if name in _NEVER:
            raise SettingsError(f"topic {name!r} is not sent again: {_NEVER[name]}")
        if name not in keys.TOPICS:
            known = ", ".join(one for one in keys.TOPICS if one not in _NEVER)
            raise SettingsError(f"no topic is called {name[:80]!r}; known: {known}")
    return Selection(names)


class Window:
    """Which frames are on their way: as many as a lossless capture lets be.

    Args:
        frames: of one camera that may be sent without tracks of them.
    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._sent: dict[str, deque[tuple[int, int]]] = defaultdict(deque)

    def has_room(self, camera: str) -> bool:
        """Whether a further frame of a camera may go out."""
        return self.on_the_way(camera) < self._frames

    def on_the_way(self, camera: str) -> int:
        """Frames of a camera without tracks so far."""
        return len(self._sent[camera])

    def send(self, frame: FrameId) -> None:
        """A frame goes out."""
        self._sent[frame.stream].append((frame.epoch, frame.seq))

    def done(self, frame: FrameId) -> None:
        """Tracks of a frame have come: it is done with, and so are those before it."""
        sent = self._sent[frame.stream]
        if (frame.epoch, frame.seq) in sent:
            while sent.popleft() != (frame.epoch, frame.seq):
                pass


def fits(pattern: str, key: str) -> bool:
    """Whether a key is one of a pattern's, in which `*` stands for one chunk."""
    wanted, chunks = pattern.split("/"), key.split("/")
    return len(wanted) == len(chunks) and all(
        one in ("*", chunk) for one, chunk in zip(wanted, chunks, strict=True)
    )


def due(
    messages: Iterable[WireMessage], chosen: Selection, rate: float
) -> Iterator[tuple[float, str, WireMessage]]:
    """What is sent, each with the seconds since the start at which it is due, and its topic.

    Args:
        messages: of a recording, in its order.
        chosen: the topics.
        rate: seconds of the recording per second.
    """
    first_ns: int | None = None
    for message in messages:
        if (topic := chosen.topic_of(message.key)) is None:
            continue
        first_ns = message.logged_ns if first_ns is None else first_ns
        yield max(0.0, (message.logged_ns - first_ns) * 1e-9 / rate), topic, message


def for_lossless(chosen: Selection, named: bool) -> Selection:
    """The topics of a lossless replay: without what is made of its pictures anew.

    Raises:
        SettingsError: a user has named some of those, or no pictures.
    """
    made = _OF_PICTURES & set(chosen.names)
    if named and made:
        raise SettingsError(
            f"--lossless waits for tracks that others make: leave {', '.join(sorted(made))} out"
        )
    names = tuple(name for name in chosen.names if name not in _OF_PICTURES)
    if not set(_PICTURES) & set(names):
        raise SettingsError("--lossless waits at pictures: name image or jpeg among --topics")
    return Selection(names)


def as_replayed(message: WireMessage, raw: bool) -> CameraInfo:
    """What a replayed camera says of itself: that frames are raw ones, or JPEGs of another host.

    Raises:
        MessageError: it is no such message.
    """
    info = decode(CameraInfo, message.payload, message.encoding)
    # Whoever works losslessly would wait for depth, which is not sent between the frames.
    return info.model_copy(update={"host": "" if raw else _ELSEWHERE, "depth": False})


@for_robot
def replay(
    robot: RobotFlags,
    file: Annotated[Path, typer.Argument(help="recording of `heel record`", metavar="FILE")],
    topics: Annotated[
        str | None,
        typer.Option(
            help="which ones, by the last words of their keys, comma separated; the others may be "
            f"live [default: {','.join(SEEN)}]",
            metavar="A,B",
        ),
    ] = None,
    rate: Annotated[
        float, typer.Option(help="seconds of the recording per second", min=0.01, max=100.0)
    ] = 1.0,
    lossless: Annotated[
        bool,
        typer.Option(
            "--lossless",
            help="as fast as detector and tracker (--delivery lossless) work, and no frame is "
            "left out: each waits for tracks of those before it",
        ),
    ] = False,
) -> None:
    """Send a recording again on the robot's bus: the same bytes, stamps and intervals.

    Commands and emergency stops are sent only if they are named.
    """
    from heel.services.recordings.reading import Recording, wire_messages
    from heel.services.runtime.stop_signals import stop_signals

    chosen = selection(topics)
    if lossless:
        chosen = for_lossless(chosen, topics is not None)
    if moving := _MOVING & set(chosen.names):
        sys.stderr.write(f"heel: {', '.join(sorted(moving))}: what drives here obeys it\n")
    recording = Recording(file)
    with stop_signals(TIMEOUT_S) as stop, session_with(robot.find()) as session:
        with ExitStack() as stack:
            sender = _Sender(session, stack, "lossless" if lossless else "live")
            gate = stack.enter_context(_Gate(session, stop)) if lossless else None
            started_s, late_s, sent = time.monotonic(), 0.0, 0
            for at_s, topic, message in due(wire_messages(recording), chosen, rate):
                go = gate.wait(topic, message) if gate else _wait(stop, started_s + at_s)
                if not go:
                    break
                late_s = max(late_s, time.monotonic() - started_s - at_s)
                sender.send(topic, message, recording.session.get("frames") == "raw")
                sent += 1
            if gate is not None:
                gate.finish()
    seconds = time.monotonic() - started_s
    late = "" if lossless else f", at most {late_s * 1e3:.0f} ms late"
    typer.echo(f"sent {sent} messages in {seconds:.1f} s{late}")
    if not sent:
        raise SettingsError(f"{file}: nothing of {', '.join(chosen.names)} in it")


class _Gate:
    """Lets a frame go out once there are tracks of those before it. Use as a context manager.

    Args:
        session: the command's.
        stop: ends every wait.
    """

    def __init__(self, session: zenoh.Session, stop: threading.Event) -> None:
        from heel.services.runtime import qos
        from heel.services.runtime.inbox import Inbox

        self._stop = stop
        self._window = Window(qos.LOSSLESS_WINDOW_FRAMES)
        self._inbox = Inbox(session)
        self._inbox.subscribe(
            "tracks", keys.TOPICS["tracks"], qos.TRACKS.for_delivery("lossless")
        )  # fmt: skip
        self._cameras: set[str] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._inbox.__exit__(*error)

    def wait(self, topic: str, message: WireMessage) -> bool:
        """Until a message may go out; False if the command is to end.

        Raises:
            HeelError: tracks of the frames before did not come.
        """
        if topic not in _PICTURES or not message.encoding.startswith("image/"):
            return not self._stop.is_set()
        try:
            frame = decode(Header, message.attachment or b"").frame_id()
        except MessageError as error:
            sys.stderr.write(f"heel: {message.key}: {error}\n")
            return not self._stop.is_set()
        self._await(lambda: self._window.has_room(frame.stream))
        self._window.send(frame)
        self._cameras.add(frame.stream)
        return not self._stop.is_set()

    def finish(self) -> None:
        """Wait for the tracks of the last frames.

        Raises:
            HeelError: they did not come.
        """
        self._await(lambda: not any(map(self._window.on_the_way, self._cameras)))

    def _await(self, condition: Callable[[], bool]) -> None:
        heard_s = time.monotonic()
        while not condition() and not self._stop.is_set():
            arrival = self._inbox.get(_TURN_S)
            now_s = time.monotonic()
            if arrival is None:
                if now_s - heard_s > _TRACKS_S:
                    raise HeelError(
                        f"no tracks of the frames that were sent within {_TRACKS_S:g} s: start "
                        "`heel detector` and `heel tracker` with --delivery lossless first"
                    )
                continue
            if arrival.encoding == Tracks.encoding():
                with suppress(MessageError):
                    self._window.done(decode(Tracks, arrival.payload, arrival.encoding).frame_id())
                    heard_s = now_s


def _wait(stop: threading.Event, until_s: float) -> bool:
    """Wait for a moment; False if the command is to end."""
    left_s = until_s - time.monotonic()
    return not (stop.wait(left_s) if left_s > 0 else stop.is_set())


class _Sender:
    """Publishers of the topics that are sent, made when they are needed."""

    def __init__(self, session: zenoh.Session, stack: ExitStack, delivery: Delivery) -> None:
        self._session, self._stack, self._delivery = session, stack, delivery
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._infos: dict[str, Latched] = {}

    def send(self, topic: str, message: WireMessage, raw: bool) -> None:
        """Send one message as it was; what cameras say of themselves is kept for who asks."""
        if topic == "info":
            try:
                self._info(message.key, as_replayed(message, raw))
            except MessageError as error:
                sys.stderr.write(f"heel: {message.key}: {error}\n")
            return
        self._publisher(topic, message.key).put(
            message.payload, encoding=message.encoding, attachment=message.attachment
        )

    def _info(self, key: str, info: CameraInfo) -> None:
        from heel.services.runtime import qos
        from heel.services.runtime.publishing import Latched

        if key not in self._infos:
            self._infos[key] = self._stack.enter_context(Latched(self._session, key, qos.INFO))
        self._infos[key].set(info)

    def _publisher(self, topic: str, key: str) -> zenoh.Publisher:
        from heel.services.runtime.qos import BY_TOPIC

        if key not in self._publishers:
            how = BY_TOPIC[topic].for_delivery(self._delivery)
            self._publishers[key] = self._session.declare_publisher(
                key, priority=how.priority, congestion_control=how.congestion, express=how.express
            )
        return self._publishers[key]
