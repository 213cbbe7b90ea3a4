"""A simulated world with all services around it: own router, own children, nothing left behind."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import zenoh

from heel.schemas import (
    EndOfStream,
    FollowState,
    Health,
    HeelError,
    MessageError,
    SimTruth,
    SimWorld,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.run.children import Children, await_present
from heel.services.run.onlooker import Onlooker, Recorder
from heel.services.run.revival import Revival
from heel.services.run.silence import HUNG_S, Silences
from heel.services.runtime import qos
from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY
from heel.services.runtime.chain import page_of
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.registry import Registration, registered
from heel.services.runtime.router import open_private_router

CAMERA = "front"
_POLL_S = 0.1
"""Longest wait for a message [s] before processes and deadlines are looked at; chosen by hand."""
_SILENCE_S = 15.0
"""Longest time without a frame of the simulator [s], once it has sent one; chosen by hand."""
_START_S = 60.0
"""Longest time before its first frame [s], in which it loads what it draws; chosen by hand."""
_LAST_FRAMES_S = 1.0
"""Time before the end of an episode [s] from which the simulator may end: the last frames may be
lost; chosen by hand."""


_ANSWER_S = 1.0
"""How long a click may wait for the follower's answer [s], which the next state tells as well;
chosen by hand."""


@dataclass(frozen=True)
class PageOptions:
    """The live page of a world, whose run `heel status` finds while it lasts.

    Attributes:
        port: on loopback, 0 for any free one.
        on_page: called with the page's address once it is served.
        robot: name by which commands choose this run.
    """

    port: int
    on_page: Callable[[str], None] | None = None
    robot: str = ""


@dataclass(frozen=True)
class WorldOptions:
    """Which world is to be run, and how.

    Attributes:
        logs: folder for the logs of the services.
        episode_s: length of the one episode, seconds; None: there is always another one.
        seconds: end after so long; None: when the episode is over, or never.
        ends_at_contact: end when the robot touches a person.
        page: the live page; None for none.
        truth: file for the truth of every frame, 2 GB a day; None for none.
        revives: start a service again that dies or hangs; else the run ends with it.
        config: settings file of the services.
        detector_flags: flags of the detector process, which runs for pixels only.
    """

    logs: Path
    scenario: str
    seed: int
    perception: Literal["pixels", "simulated-boxes"]
    episode_s: float | None
    seconds: float | None = None
    ends_at_contact: bool = False
    page: PageOptions | None = None
    truth: Path | None = None
    config: Path | None = None
    detector_flags: tuple[str, ...] = ()
    revives: bool = False

    @property
    def services(self) -> tuple[str, ...]:
        """The processes that run beside the simulator."""
        parts: tuple[str, ...] = ("tracker", "follower", "drive")
        parts += ("web",) if self.page is not None else ()
        return (*parts, "detector") if self.perception == "pixels" else parts


class WorldRun:
    """Starts simulator and services, observes them, and ends them.

    Must run in a process that `heel.services.run.guard.guarded` has made.

    Args:
        options: which world.
        recorder: gets every frame.
        stop: ends the run when set.
        log: of the process.
    """

    def __init__(
        self, options: WorldOptions, recorder: Recorder, stop: threading.Event, log: logging.Logger
    ) -> None:
        self._options, self._stop, self._log = options, stop, log
        self._recorder = recorder
        self._note: Registration | None = None
        self._warn = OncePerSecond(log)
        self._page = ""
        self._t_s = 0.0
        self._touched = False
        revived = options.services if options.revives else ()
        self._silences = Silences(HUNG_S, "simulator", *set(options.services).difference(revived))
        self._revival = Revival(revived, log)

    def run(self) -> None:
        """Run until the end of the episode or of the wanted time, or until `stop` is set.

        Raises:
            HeelError: a service failed or hung.
            OSError: the logs cannot be written.
        """
        o = self._options
        with ExitStack() as stack:
            session, endpoint = stack.enter_context(open_private_router())
            inbox = stack.enter_context(Inbox(session))
            self._subscribe(inbox)
            children = stack.enter_context(Children(o.logs))
            if o.page is not None:
                self._note = stack.enter_context(
                    registered(
                        "demo", o.scenario, endpoint, ("simulator", *o.services), self._log,
                        o.page.robot,
                    )
                )  # fmt: skip
            self._start(session, endpoint, children)
            self._tell_processes(children)
            self._look_on(inbox, children, Onlooker(self._recorder, partial(_click, session)))

    def _subscribe(self, inbox: Inbox) -> None:
        # This end writes a record: it keeps more than the newest message.
        for topic, key, how in (
            ("truth", keys.SIM_TRUTH, qos.SIM_TRUTH),
            ("world", keys.SIM_WORLD, qos.SIM_WORLD),
            ("tracks", keys.tracks(CAMERA), qos.TRACKS),
            ("state", keys.FOLLOW_STATE, qos.STATE),
            ("health", keys.ALL_HEALTH, qos.HEALTH),
        ):
            inbox.subscribe(topic, key, how.for_delivery("lossless"))

    def _start(self, session: zenoh.Session, endpoint: str, children: Children) -> None:
        o = self._options
        # None ends with the stream: any client of the router could end them with one message.
        common = ["--connect", endpoint]
        common += ["--config", str(o.config)] if o.config is not None else []
        flags = {
            "drive": ["--driver", "simulated"],
            "web": [] if o.page is None else ["--port", str(o.page.port)],
            "detector": list(o.detector_flags),
        }
        for service in o.services:
            children.start(service, *common, *flags.get(service, ()))
        await_present(session, children, set(o.services), self._stop)
        children.start(
            "simulator", o.scenario, *common, "--seed", str(o.seed), "--perception", o.perception,
            *(["--loop"] if o.episode_s is None else []),
            *(["--no-pictures"] if o.page is None and o.perception != "pixels" else []),
            *(["--truth", str(o.truth)] if o.truth is not None else []),
        )  # fmt: skip

    def _look_on(self, inbox: Inbox, children: Children, onlooker: Onlooker) -> None:
        until_s = math.inf
        longest_s = _START_S
        truth = Silences(longest_s, "truth")
        truth.heard("truth", time.monotonic())
        while not (self._touched or self._stop.is_set()) and time.monotonic() < until_s:
            over = children.over("simulator")
            self._check(children)
            if truth.look(time.monotonic()) is not None and not over:
                raise HeelError(
                    f"the simulator is silent for {longest_s:g} s{children.last_words('simulator')}"
                )
            arrival = inbox.get(0.0 if over else _POLL_S)
            if arrival is None and over:
                return self._check_episode(children)
            if arrival is None:
                continue
            if arrival.topic == "truth":
                if longest_s != _SILENCE_S:
                    longest_s = _SILENCE_S
                    truth = Silences(longest_s, "truth")
                truth.heard("truth", arrival.arrived_s)
                # Counted from the first picture on: how long the start takes is the machine's.
                until_s = min(until_s, arrival.arrived_s + (self._options.seconds or math.inf))
            try:
                self._take(arrival, onlooker)
            except MessageError as error:
                self._warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)

    def _check_episode(self, children: Children) -> None:
        """Check that the simulator has ended with its episode.

        Raises:
            HeelError: it ended before, or episodes follow one another without end.
        """
        if self._options.episode_s is None or self._t_s < self._options.episode_s - _LAST_FRAMES_S:
            raise HeelError(
                f"the simulator ended before its episode did{children.last_words('simulator')}"
            )

    def _check(self, children: Children) -> None:
        """Check that all services run and send; only the simulator may end, with its episode.

        Raises:
            HeelError: one ended or hangs, and is not started again.
        """
        failure, early = children.failure(), children.ended("simulator")
        if self._revival.look(children, time.monotonic()):
            self._tell_processes(children)
            return
        if failure is not None:
            raise failure
        if early is not None:
            raise HeelError(f"{early} ended, and the run with it{children.last_words(early)}")
        hung = self._silences.look(time.monotonic())
        if hung is not None and not children.over(hung):
            raise HeelError(f"{hung} is silent for {HUNG_S:g} s: it hangs or was stopped")

    def _take(self, arrival: Arrival, onlooker: Onlooker) -> None:
        payload, encoding = arrival.payload, arrival.encoding
        if arrival.topic == "truth":
            truth = decode(SimTruth, payload, encoding)
            self._t_s = truth.t_s
            onlooker.truth(truth)
            self._touched = self._options.ends_at_contact and truth.contact > 0
        elif arrival.topic == "world":
            decode(SimWorld, payload, encoding)
            onlooker.episode()
        elif arrival.topic == "state":
            onlooker.state(decode(FollowState, payload, encoding))
        elif arrival.topic == "health":
            health = decode(Health, payload, encoding)
            self._silences.heard(health.service, arrival.arrived_s)
            self._revival.heard(health, arrival.arrived_s)
            self._tell_page(page_of(health))
        elif encoding != EndOfStream.encoding():
            # The end is that of the simulator's process, a child of this one, and no message's.
            onlooker.tracks(decode(Tracks, payload, encoding))

    def _tell_processes(self, children: Children) -> None:
        if self._note is not None:
            self._note.processes_are(children.pids(), children.logs)

    def _tell_page(self, url: str | None) -> None:
        page = self._options.page
        if not url or url == self._page or page is None:
            return
        self._page = url
        if self._note is not None:
            self._note.page_is(url)
        if page.on_page is not None:
            page.on_page(url)


def _click(session: zenoh.Session, request: TargetRequest) -> None:
    """Send a choice as the page does, without waiting for the reply: the next state shows it."""
    session.get(
        keys.FOLLOW_TARGET, _leave_unread, target=EVERYBODY, consolidation=EVERY_ANSWER,
        timeout=_ANSWER_S, payload=encode(request), encoding=request.encoding(),
    )  # fmt: skip


def _leave_unread(reply: zenoh.Reply) -> None:
    """Handler of the reply to a click, see `_click`."""
