"""What the page can do to the robot: choose a target, stop it, resume.

Called from the HTTP side. A stop has a thread of its own, so that it never waits behind a
follower that takes its time to answer a choice.
"""

from __future__ import annotations

import secrets
import threading
import time
from contextlib import ExitStack, suppress
from typing import Any, TypeVar

from zenoh.handlers import FifoChannel

from heel.schemas import (
    EStop,
    HeelError,
    Manual,
    ManualGrant,
    ManualRequest,
    Message,
    Target,
    TargetRequest,
    decode,
    encode,
    keys,
)
from heel.services.runtime import qos
from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY, refusal
from heel.services.runtime.latched import LatchedAnswers
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.stop_socket import drives_here
from heel.services.web.estop import PageStop, Part
from heel.services.web.settings import WebServiceSettings
from heel.services.web.worker import BusyError, Worker

_MAX_WAITING = 8
"""Requests of a kind that may wait; more are refused as busy. Chosen by hand."""
_HERE_S = 0.5
"""Seconds that a drive on this machine has to answer; it takes milliseconds."""

M = TypeVar("M", bound=Message)


class TargetRefusedError(HeelError):
    """The follower said no, and why."""


class NoFollowerError(HeelError):
    """No answer came."""


class RouterAwayError(HeelError):
    """What was asked for cannot be sent now, and must not be sent later."""


_OLDEST_S = 60.0
"""Age that is told of a wish at most, which may be infinite; any wish is void long before."""
_TARGET_TIMEOUT_S = 1.0
"""Longest wait for the follower's answer to a choice: people click again after more."""


class Control:
    """Target and emergency stop, towards Zenoh.

    Args:
        context: of the running service.
        resources: closes what is opened here.
    """

    def __init__(self, context: ServiceContext[WebServiceSettings], resources: ExitStack) -> None:
        self._session = context.session
        self._producer = context.producer
        self._log = context.log
        self._lock = threading.Lock()
        self._stop = PageStop()
        self._robot = context.robot
        self._others = LatchedAnswers(context.session, keys.FOLLOW_ESTOP, EStop)
        self._estop = resources.enter_context(
            Latched(context.session, keys.FOLLOW_ESTOP, qos.ESTOP, context.producer)
        )
        self.stops = Worker("stop", _MAX_WAITING, resources)
        """Does `stop`; no number of resumes takes a stop's place."""
        self.resumes = Worker("resume", _MAX_WAITING, resources)
        """Does `resume`."""
        self.stops_asked_for = 0
        """How often; a resume that was asked for before the last one does nothing."""
        self.choices = Worker("target", _MAX_WAITING, resources)
        """Does `choose`."""
        self.hands = Worker("manual", _MAX_WAITING, resources)
        """Does `take_by_hand` and `hand_back`."""
        self._wishes = context.publisher(keys.FOLLOW_MANUAL, qos.MANUAL)

    @property
    def connected(self) -> bool:
        """Whether a router, or in peer mode any peer, is connected at present."""
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    def choose(self, request: TargetRequest) -> Target:
        """Ask the follower for a target; blocks until its answer or the timeout.

        Raises:
            TargetRefusedError: the follower's reason.
            NoFollowerError: no answer in time.
            MessageError: the answer is not a target.
        """
        return self._ask(keys.FOLLOW_TARGET, request, Target)

    def take_by_hand(self, who: str) -> ManualGrant:
        """Ask the follower for the robot; raises as `choose`."""
        request = ManualRequest(take=True, source=self._source(who))
        return self._ask(keys.FOLLOW_MANUAL, request, ManualGrant)

    def hand_back(self, who: str) -> ManualGrant:
        """Have the follower follow again; raises as `choose`."""
        request = ManualRequest(take=False, source=self._source(who))
        return self._ask(keys.FOLLOW_MANUAL, request, ManualGrant)

    def wish(self, wish: Manual, age_s: float) -> None:
        """Send what a hand wishes; never waits, and what cannot be sent now is never sent.

        Args:
            wish: of this moment.
            age_s: how old it may be.
        """
        self._wishes.send(wish, min(age_s, _OLDEST_S))

    def _ask(self, key: str, request: Message, kind: type[M]) -> M:
        replies = self._session.get(
            key,
            FifoChannel(8),
            target=EVERYBODY,
            consolidation=EVERY_ANSWER,
            payload=encode(request),
            encoding=request.encoding(),
            timeout=_TARGET_TIMEOUT_S,
        )
        refused: str | None = None
        for reply in replies:
            if reply.ok is not None:
                return decode(kind, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
            refused = refusal(reply) or refused
        if refused is None:
            raise NoFollowerError(
                f"no answer from the follower within {_TARGET_TIMEOUT_S:g} s: is it running?"
            )
        raise TargetRefusedError(refused)

    def stop_is_asked_for(self) -> None:
        """A stop is wanted: from now on no resume that was asked for before it counts."""
        with self._lock:
            self.stops_asked_for += 1

    def stop(self, who: str) -> None:
        """Engage the emergency stop; it is said again until the robot confirms it."""
        message = EStop(
            engaged=True, source=self._source(who), t_ns=time.time_ns(), id=secrets.token_hex(8)
        )
        with self._lock:
            self._stop.engage(message, time.monotonic())
        self._estop.set(message)
        self._log.warning("STOP by %s", who)
        # A drive on this machine hears it whatever becomes of the router.
        for answer in drives_here(self._robot, message, _HERE_S):
            if answer.state is not None:
                self.robot_says("drive", answer.state.estop)

    def resume(self, who: str, stops_before: int) -> None:
        """Release the emergency stop.

        Args:
            who: the client that asks.
            stops_before: `stops_asked_for` when they did.

        Raises:
            RouterAwayError: a resume must not take effect at some later time, nor for half the
                robot.
        """
        if not self.connected:
            raise RouterAwayError("the router is away: resume when it is back")
        with self._lock:
            if self.stops_asked_for != stops_before:
                raise RouterAwayError("STOP was pressed meanwhile: resume again if that is meant")
            if part := self._stop.silent(time.monotonic()):
                raise RouterAwayError(f"the {part} does not answer: nothing is released")
            releases = self._stop.releases(self._source(who))
            for release in releases:
                self._stop.hear(release, time.monotonic())
        for release in releases:
            self._estop.set(release)
        self._log.warning("resume by %s", who)

    def look_after_stop(self, now_s: float) -> None:
        """Ask which stops are held, and repeat one that is not confirmed; returns at once."""
        asked_s = self._others.asked_s
        answers = self._others.poll(now_s)
        with self._lock:
            if answers is not None:
                self._stop.hear_answers(answers, asked_s)
            self._stop.settle(now_s)
            self._estop.keep(self._stop.told)
            due = self._stop.repeat_due(now_s)
        if due:
            # Busy with other stops: then one is on its way anyway.
            with suppress(BusyError):
                self.stops.submit(self._repeat)

    def hear(self, estop: EStop) -> None:
        """Take note of a message on `follow/estop` and answer with it from now on."""
        with self._lock:
            self._stop.hear(estop, time.monotonic())
            self._estop.keep(self._stop.told)

    def robot_says(self, part: Part, stopped: bool) -> None:
        """Take note of the robot's own word."""
        with self._lock:
            self._stop.says(part, stopped, time.monotonic())

    def stop_status(self, now_s: float) -> dict[str, Any]:
        """What the page shows of the emergency stop."""
        with self._lock:
            pending_s = self._stop.pending_s(now_s)
            return {
                "engaged": self._stop.engaged(now_s),
                "source": self._stop.source,
                "pending_s": None if pending_s is None else round(pending_s, 2),
            }

    def _repeat(self) -> None:
        # Confirmed or released meanwhile: a stop that is late must not undo a resume.
        with self._lock:
            message = self._stop.pending()
        if message is not None:
            self._estop.set(message)

    def _source(self, who: str) -> str:
        return f"{self._producer} {who}"[:96]
