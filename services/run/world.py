"""A simulated world with all services around it: own router, own children, nothing left behind."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import zenoh

from schemas import (
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
from services.run.children import Children
from services.run.following import FollowingFigures, FollowingTally
from services.run.onlooker import Onlooker
from services.run.presence import await_present
from services.runtime import qos
from services.runtime.inbox import Arrival, Inbox
from services.runtime.logs import OncePerSecond
from services.runtime.registry import Registration, registered
from services.runtime.router import open_private_router

CAMERA = "front"
_POLL_S = 0.1
_SILENCE_S = 15.0


@dataclass(frozen=True)
class WorldOptions:
    """What `heel demo` was asked to show.

    Attributes:
        seconds: end after so long; None: when the episode is over, or never if `loop`.
        on_page: told the page's address once it is served.
    """

    out: Path
    scenario: str
    seed: int
    perception: Literal["pixels", "simulated-boxes"]
    loop: bool
    seconds: float | None
    web_port: int
    on_page: Callable[[str], None]
    detector_flags: tuple[str, ...] = ()
    """Flags of the detector process, which runs for pixels only."""


class WorldRun:
    """Starts simulator and stack, looks on, and ends them."""

    def __init__(self, options: WorldOptions, stop: threading.Event, log: logging.Logger) -> None:
        self._options, self._stop, self._log = options, stop, log
        self._note: Registration | None = None
        self._warn = OncePerSecond(log)
        self._tally = FollowingTally()
        self._ended = self._page_told = False
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
            raise HeelError(
                f"--out {o.out}: {error.strerror}: give a folder that can be written to"
            ) from None
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
        record = {"perception": o.perception, **asdict(figures)}
        (o.out / "following.json").write_text(json.dumps(record, indent=2) + "\n")
        return figures

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
        common = ["--connect", endpoint, "--exit-at-end"]
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
            "--perception", o.perception, "--truth", str(o.out / "truth.jsonl"),
            *(["--loop"] if o.loop else []),
        )  # fmt: skip

    def _look_on(self, session: zenoh.Session, inbox: Inbox, children: Children) -> None:
        heard_s = time.monotonic()
        until_s = heard_s + (self._options.seconds or float("inf"))
        while not (self._ended or self._stop.is_set()) and time.monotonic() < until_s:
            if (failure := children.failure()) is not None:
                raise HeelError(failure)
            if time.monotonic() - heard_s > _SILENCE_S:
                raise HeelError(
                    f"the simulator is silent for {_SILENCE_S:g} s: see {self._options.out}/logs"
                )
            arrival = inbox.get(_POLL_S)
            if arrival is None:
                continue
            if arrival.topic == "truth":
                heard_s = arrival.arrived_s
            try:
                self._take(session, arrival)
            except MessageError as error:
                self._warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)

    def _take(self, session: zenoh.Session, arrival: Arrival) -> None:
        payload, encoding = arrival.payload, arrival.encoding
        if arrival.topic == "truth":
            truth = decode(SimTruth, payload, encoding)
            self._tally.truth(truth)
            self._onlooker.look(session, truth)
        elif arrival.topic == "world":
            decode(SimWorld, payload, encoding)
            self._tally.episode()
            self._onlooker.episode()
        elif arrival.topic == "state":
            self._tally.state(decode(FollowState, payload, encoding))
        elif arrival.topic == "health":
            self._tell_page(decode(Health, payload, encoding).details.get("url"))
        elif encoding == EndOfStream.encoding():
            # Between episodes there is none: the simulator ends its stream once, at the end.
            self._ended = True
        else:
            self._tally.tracks(decode(Tracks, payload, encoding))

    def _tell_page(self, url: str | None) -> None:
        if url and not self._page_told:
            self._page_told = True
            if self._note is not None:
                self._note.page_is(url)
            self._options.on_page(url)
