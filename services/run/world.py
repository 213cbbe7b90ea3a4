"""A simulated world with all services around it: own router, own children, nothing left behind."""

from __future__ import annotations

import json
import logging
import math
import os
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
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
    Tracks,
    decode,
    keys,
)
from heel.services.run.children import Children
from heel.services.run.following import FollowingFigures, FollowingTally
from heel.services.run.onlooker import Onlooker
from heel.services.run.presence import await_present
from heel.services.run.silence import HUNG_S, Silences
from heel.services.runtime import qos
from heel.services.runtime.chain import page_of
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.registry import Registration, registered
from heel.services.runtime.router import open_private_router

CAMERA = "front"
_POLL_S = 0.1
_SILENCE_S, _START_S = 15.0, 60.0
"""Longest silence of a simulator, once it has spoken and before."""
_LAST_FRAMES_S = 1.0
"""An episode is over with its last frame, which may be lost."""


@dataclass(frozen=True)
class WorldOptions:
    """What `heel demo` was asked to show.

    Attributes:
        seconds: end after so long; None: when the episode is over, or never.
        on_page: told the page's address once it is served.
    """

    out: Path
    scenario: str
    seed: int
    perception: Literal["pixels", "simulated-boxes"]
    seconds: float | None
    web_port: int
    on_page: Callable[[str], None] | None
    episode_s: float | None = None
    """Length of the one episode; None: there is always another one."""
    keep_truth: bool = True
    """Write the truth of every frame: 2 GB a day."""
    detector_flags: tuple[str, ...] = ()
    """Flags of the detector process, which runs for pixels only."""


class WorldRun:
    """Starts simulator and stack, looks on, and ends them."""

    def __init__(self, options: WorldOptions, stop: threading.Event, log: logging.Logger) -> None:
        self._options, self._stop, self._log = options, stop, log
        self._note: Registration | None = None
        self._warn = OncePerSecond(log)
        self._tally = FollowingTally()
        self._page_told = False
        self._t_s = 0.0
        self._silences = Silences(
            HUNG_S, "simulator", "detector", "tracker", "follower", "drive", "web"
        )
        self._onlooker = Onlooker()

    def run(self) -> FollowingFigures:
        """Run until the end of the episode, of the asked time, or until told to stop.

        Raises:
            HeelError: a service failed or hung, or the folder cannot be written to.
        """
        o = self._options
        try:
            o.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _cannot_write(o.out, error) from None
        with ExitStack() as stack:
            session, endpoint = stack.enter_context(open_private_router())
            inbox = stack.enter_context(Inbox(session))
            self._subscribe(inbox)
            children = stack.enter_context(Children(o.out / "logs"))
            parts: tuple[str, ...] = ("tracker", "follower", "drive", "simulator", "web")
            parts += ("detector",) if o.perception == "pixels" else ()
            self._note = stack.enter_context(
                registered("demo", o.scenario, endpoint, parts, self._log)
            )
            self._start(session, endpoint, children)
            self._look_on(session, inbox, children)
        figures = self._tally.figures
        self._write({"perception": o.perception, **asdict(figures)})
        return figures

    def _write(self, record: dict[str, object]) -> None:
        whole = self._options.out / f".following.json.{os.getpid()}"
        try:
            with whole.open("x", encoding="utf-8") as file:
                file.write(json.dumps(record, indent=2) + "\n")
            whole.replace(self._options.out / "following.json")
        except OSError as error:
            whole.unlink(missing_ok=True)
            raise _cannot_write(self._options.out, error) from None

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
        # None ends with the stream: anybody who reaches the router could end them with one message.
        common = ["--connect", endpoint]
        wanted = {"tracker", "follower", "drive", "web"}
        children.start("tracker", *common)
        children.start("follower", *common)
        children.start("drive", *common, "--driver", "simulated")
        children.start("web", "--connect", endpoint, "--port", str(o.web_port))
        if o.perception == "pixels":
            children.start("detector", *common, *o.detector_flags)
            wanted.add("detector")
        await_present(session, children, wanted, self._stop)
        children.start(
            "simulator", o.scenario, "--connect", endpoint, "--seed", str(o.seed),
            "--perception", o.perception, *(["--loop"] if o.episode_s is None else []),
            *(["--truth", str(o.out / "truth.jsonl")] if o.keep_truth else []),
        )  # fmt: skip

    def _look_on(self, session: zenoh.Session, inbox: Inbox, children: Children) -> None:
        until_s = math.inf
        longest_s = _START_S
        truth = Silences(longest_s, "truth")
        truth.heard("truth", time.monotonic())
        while not self._stop.is_set() and time.monotonic() < until_s:
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
                self._take(session, arrival)
            except MessageError as error:
                self._warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)

    def _check_episode(self, children: Children) -> None:
        """The simulator ends with its episode, not before.

        Raises:
            HeelError: it did, or there is always another episode.
        """
        if self._options.episode_s is None or self._t_s < self._options.episode_s - _LAST_FRAMES_S:
            raise HeelError(
                f"the simulator ended before its episode did{children.last_words('simulator')}"
            )

    def _check(self, children: Children) -> None:
        """All are there and speak; only the simulator may end, when its episode does.

        Raises:
            HeelError: one ended or hangs.
        """
        if (failure := children.failure()) is not None:
            raise failure
        if (early := children.ended("simulator")) is not None:
            raise HeelError(f"{early} ended, and the demo with it{children.last_words(early)}")
        hung = self._silences.look(time.monotonic())
        if hung is not None and not children.over(hung):
            raise HeelError(f"{hung} is silent for {HUNG_S:g} s: it hangs or was stopped")

    def _take(self, session: zenoh.Session, arrival: Arrival) -> None:
        payload, encoding = arrival.payload, arrival.encoding
        if arrival.topic == "truth":
            truth = decode(SimTruth, payload, encoding)
            self._t_s = truth.t_s
            self._tally.truth(truth)
            self._onlooker.look(session, truth)
        elif arrival.topic == "world":
            decode(SimWorld, payload, encoding)
            self._tally.episode()
            self._onlooker.episode()
        elif arrival.topic == "state":
            self._tally.state(decode(FollowState, payload, encoding))
        elif arrival.topic == "health":
            health = decode(Health, payload, encoding)
            self._silences.heard(health.service, arrival.arrived_s)
            self._tell_page(page_of(health))
        elif encoding != EndOfStream.encoding():
            # The end is told by the simulator's process, which is ours, and by no message.
            self._tally.tracks(decode(Tracks, payload, encoding))

    def _tell_page(self, url: str | None) -> None:
        if url and not self._page_told and self._options.on_page is not None:
            self._page_told = True
            if self._note is not None:
                self._note.page_is(url)
            self._options.on_page(url)


def _cannot_write(out: Path, error: OSError) -> HeelError:
    return HeelError(
        f"--out {out}: {error.strerror}: give a folder that can be written to, on a disk with room"
    )
