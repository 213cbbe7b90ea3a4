"""An eye on a simulated robot: whom it follows by truth, how fast it drives, and who is there."""

from __future__ import annotations

import json
import logging
import math
import threading
import time
from collections import deque
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self

import zenoh

from heel.schemas import (
    DriveState,
    FollowState,
    Health,
    MessageError,
    SimTruth,
    SimWorld,
    Stamp,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.loops.judge import acted_upon
from heel.services.run.onlooker import Onlooker
from heel.services.runtime.session import open_session
from heel.services.runtime.settings import ZenohSettings

_START_S = 60.0
"""Longest wait [s] for the router, also on a busy machine."""
_KEPT_MOMENTS = 2000
"""Frames that are looked back at: a minute at 30 frames/s."""
_ANSWER_S = 1.0
"""How long a click may wait for its answer [s]."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What was seen in one frame.

    Attributes:
        at_s: monotonic time.
        t_s: simulated time.
        state: of the follower.
        target_id: chosen id, None if nobody is chosen.
        role: of the person that the robot acts upon, by truth; None if upon nobody.
        asks: whether the follower asks to be told again whom to follow.
        linear_mps: true speed of the robot.
        away_m: from the robot to the target, by truth; nan without a target.
    """

    at_s: float
    t_s: float
    state: str
    target_id: int | None
    role: str | None
    asks: bool
    linear_mps: float
    away_m: float = math.nan


class Watch:
    """Hears everything that is published of one robot; use as a context manager.

    Args:
        endpoint: of its router.
        clicks: whether to choose the person as a user does; else somebody else does.
    """

    def __init__(self, endpoint: str, clicks: bool) -> None:
        self._endpoint, self._clicks = endpoint, clicks
        self._lock = threading.Lock()
        self._state: FollowState | None = None
        self._resources = ExitStack()
        self.moments: deque[Moment] = deque(maxlen=_KEPT_MOMENTS)
        self.producers: dict[str, tuple[str, float]] = {}
        """Of each service that has told of itself: its process, and when it was first heard."""
        self.drive: tuple[str, str, float] = "", "", 0.0
        """Who sends to the wheels, its state, and since when this one is heard."""
        self.episodes = 0
        self.page = ""
        """Address of the page."""

    def __enter__(self) -> Self:
        connect = ZenohSettings(connect=(self._endpoint,), connect_timeout_s=_START_S)
        session = open_session(connect, logging.getLogger("faults"), threading.Event().wait)
        assert session is not None
        self._resources.enter_context(session)
        self._onlooker = Onlooker(self, partial(_click, session) if self._clicks else _no_click)
        for key, kind in (
            (keys.SIM_WORLD, SimWorld), (keys.SIM_TRUTH, SimTruth),
            (keys.FOLLOW_STATE, FollowState), (keys.tracks("front"), Tracks),
            (keys.ALL_HEALTH, Health), (keys.ROBOT_DRIVE, DriveState),
        ):  # fmt: skip
            session.declare_subscriber(key, partial(self._hear, kind))
        return self

    def __exit__(self, *_: object) -> None:
        self._resources.close()

    def episode(self) -> None:
        """As `Recorder.episode`."""
        self.episodes += 1

    def record(self, truth: SimTruth, state: FollowState | None, people: dict[int, int]) -> None:
        """As `Recorder.record`."""
        if state is None:
            return
        whom = acted_upon(state, people)
        role = None if whom is None or whom >= len(truth.people) else truth.people[whom].role
        target = state.target
        self.moments.append(
            Moment(time.monotonic(), truth.t_s, state.state, target.track_id, role,
                   "choose again" in target.reason, truth.linear_mps, _away_m(truth))
        )  # fmt: skip

    def since(self, at_s: float) -> list[Moment]:
        """What was seen since then."""
        with self._lock:
            return [moment for moment in self.moments if moment.at_s >= at_s]

    def _hear(self, kind: Any, sample: zenoh.Sample) -> None:
        try:
            message = decode(kind, sample.payload.to_bytes(), str(sample.encoding))
        except MessageError:
            return  # the end of a stream
        with self._lock:
            self._take(message, sample)

    def _take(self, message: object, sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        if isinstance(message, SimWorld):
            self._onlooker.episode()
        elif isinstance(message, SimTruth):
            self._onlooker.truth(message)
        elif isinstance(message, FollowState):
            self._state = message
            self._onlooker.state(message)
        elif isinstance(message, Tracks):
            self._onlooker.tracks(message)
        elif isinstance(message, DriveState) and sample.attachment is not None:
            stamp = decode(Stamp, sample.attachment.to_bytes())
            sender, _, since_s = self.drive
            since_s = since_s if sender == stamp.producer else now_s
            self.drive = stamp.producer, message.state, since_s
        elif isinstance(message, Health):
            if self.producers.get(message.service, ("", 0.0))[0] != message.producer:
                self.producers[message.service] = message.producer, now_s
            if message.service == "web":
                self.page = message.details.get("url", self.page)


def fastest_mps(truth: Path, from_s: float, to_s: float) -> float | None:
    """Highest true speed between two simulated times of the last episode, from the truth's file.

    The simulator writes it itself: it goes on where nothing is heard of it.
    """
    fastest: float | None = None
    with truth.open("rb") as stream:
        stream.seek(max(0, truth.stat().st_size - (4 << 20)))
        stream.readline()
        for line in stream:
            if line.startswith(b'{"sim-world"'):
                fastest = None  # another episode, whose time begins anew
            with suppress(ValueError, KeyError):
                row = json.loads(line)["sim-truth"]
                if from_s <= row["t_s"] <= to_s:
                    fastest = max(fastest or 0.0, abs(row["linear_mps"]))
    return fastest


def _click(session: zenoh.Session, request: TargetRequest) -> None:
    """Choose as the page does; the next state shows whether it was."""
    session.get(
        keys.FOLLOW_TARGET, _leave_unread, timeout=_ANSWER_S, payload=encode(request),
        encoding=request.encoding(),
    )  # fmt: skip


def _leave_unread(reply: zenoh.Reply) -> None:
    """Handler of the reply to a click."""


def _no_click(request: TargetRequest) -> None:
    """Where somebody else chooses."""


def _away_m(truth: SimTruth) -> float:
    for one in truth.people:
        if one.role == "target":
            return math.hypot(one.pose.x_m - truth.robot.x_m, one.pose.y_m - truth.robot.y_m)
    return math.nan
