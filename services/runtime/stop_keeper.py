"""The emergency stop in a process that obeys it: heard, asked for, answered for, kept on disk."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TypeVar

from heel.schemas import EStop, HeelError, MessageError, SettingsError, decode, encode, keys
from heel.services.runtime import places, qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import LatchedAnswers, latched_values
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.settings import ServiceSettings
from heel.services.runtime.stop_latch import StopLatch
from heel.services.runtime.stops import HOLDS, HOLDS_NOT, STOP_DETAIL

_ASK_PERIOD_S = 1.0
"""Seconds between two questions to the others that obey the stop; chosen by hand."""
_LOOK_PERIOD_S = 1.0
"""Seconds between two looks whether what was written down is still there; chosen by hand."""
S = TypeVar("S", bound=ServiceSettings)


def stop_of(arrival: Arrival, context: ServiceContext[S]) -> EStop:
    """What a message on `follow/estop` says; one that cannot be read stops the robot."""
    try:
        return decode(EStop, arrival.payload, arrival.encoding)
    except MessageError as error:
        context.statistics.malformed += 1
        context.warn.warning(
            "estop", f"{arrival.key}: {error}: what cannot be read stops the robot",
            arrival.arrived_s,
        )  # fmt: skip
        return EStop(engaged=True, source="a message that cannot be read")


class StopKeeper:
    """Holds the emergency stop on behalf of a service, and agrees about it with the others.

    A message that cannot be read engages it. Others are asked once a second for as long as the
    service runs, since a stop may have gone by while the link was down. An engagement is written
    down (`places.kept_folder`), so that it also outlives the end of all that hold it.

    Args:
        context: of the running service; subscribes to `follow/estop` under the name `estop`.
        resources: closes what is opened here.
        obey: called with every change, engaged or released.
    """

    def __init__(
        self, context: ServiceContext[S], resources: ExitStack, obey: Callable[[bool], None]
    ) -> None:
        self._context = context
        self._obey = obey
        self._latch = StopLatch()
        context.inbox.subscribe("estop", keys.FOLLOW_ESTOP, qos.ESTOP)
        self._answered = resources.enter_context(
            Latched(context.session, keys.FOLLOW_ESTOP, qos.ESTOP, context.producer)
        )
        self._others = LatchedAnswers(context.session, keys.FOLLOW_ESTOP, EStop, _ASK_PERIOD_S)
        self._file = self._place()
        self._saved: EStop | None = None
        self._unwritten = False
        self._looked_s = float("-inf")
        self._tell()

    @property
    def engaged(self) -> bool:
        """Whether the robot has to stand."""
        return self._latch.engaged

    def catch_up(self, held: EStop | None = None) -> None:
        """Before the service starts: look at what was left behind, and ask the others once.

        Args:
            held: an engagement that is known from the one that this process takes over from.
        """
        if (kept := self._kept()) is not None:
            self._latch.restore(kept)
            self._saved = kept
            self._take_over("kept since an earlier run, engaged")
        if held is not None and held.engaged and not self.engaged:
            self._latch.restore(held)
            self._take_over("held by the one before, engaged")
        asked_s = time.monotonic()
        context = self._context
        answers = latched_values(
            context.session, keys.FOLLOW_ESTOP, EStop, context.log, context.stop
        )
        if self._latch.hear_answers(answers, asked_s):
            self._take_over("engaged" if self.engaged else "released")
        self.save()

    def poll(self, now_s: float) -> None:
        """Ask the others now and then; returns at once."""
        asked_s = self._others.asked_s
        answers = self._others.poll(now_s)
        if answers and self._latch.hear_answers(answers, asked_s):
            self._take_over("engaged" if self.engaged else "released")
            self.save()
        if now_s - self._looked_s >= _LOOK_PERIOD_S:
            self._looked_s = now_s
            self._look_after_note()

    def _look_after_note(self) -> None:
        """Write it anew where its folder has gone: with a session, or by a clean-up of `/tmp`."""
        if self._file is None:
            return
        with suppress(SettingsError):
            file = places.kept_folder() / self._file.name
            if file != self._file or (self._saved is not None and not file.exists()):
                self._file, self._saved = file, None
        self.save()

    def hear(self, arrival: Arrival) -> None:
        """Take a message on `follow/estop`."""
        self.take(stop_of(arrival, self._context), arrival.arrived_s)

    def take(self, message: EStop, now_s: float) -> bool:
        """Take a stop or a release, however it came; False if it changes nothing."""
        before = self.engaged
        if not self._latch.hear(message, now_s):
            if before and not message.engaged:
                self._context.warn.warning(
                    "estop-release", "a release that does not name this emergency stop releases "
                    f"nothing (by {message.source})", now_s,
                )  # fmt: skip
            return False
        self._take_over("engaged" if message.engaged else "released")
        return True

    def publish(self) -> None:
        """Say what holds here to all: it did not come over `follow/estop`."""
        if self._latch.told is not None:
            self._answered.set(self._latch.told)

    def save(self) -> None:
        """Write a change down. Not before the wheels know it: a disk may be slow."""
        current = self._latch.current
        if self._file is None or current == self._saved:
            return
        try:
            if current is None:
                self._file.unlink(missing_ok=True)
            else:
                beside = self._file.with_suffix(".new")
                beside.write_bytes(encode(current))
                os.replace(beside, self._file)
            self._saved, self._unwritten = current, False
        except OSError as error:
            self._saved = current
            if self._unwritten:
                return
            self._unwritten = True
            self._context.log.warning(
                "the emergency stop cannot be written to %s (%s): it is forgotten when every "
                "process that holds it has ended", self._file, error.strerror,
            )  # fmt: skip

    def _take_over(self, what: str) -> None:
        told = self._latch.told
        assert told is not None
        self._answered.keep(told)
        self._obey(self._latch.engaged)
        self._tell()
        self._context.log.warning("e-stop %s by %s", what, told.source)

    def _tell(self) -> None:
        # In health, too: who looks after many robots hears no drive's 50 messages a second.
        self._context.statistics.detail(STOP_DETAIL, HOLDS if self.engaged else HOLDS_NOT)

    def _place(self) -> Path | None:
        if self._context.settings.delivery != "live":
            return None
        if (folder := self._folder()) is None:
            return None
        who = f"{self._context.name}-{self._context.settings.instance}"
        run = places.private_run()
        return folder / f"estop-{self._context.robot}-{who}{run and f'-{run}'}"

    def _folder(self) -> Path | None:
        try:
            return places.kept_folder()
        except SettingsError as error:
            self._context.log.warning("%s", error)
        with suppress(SettingsError):
            return places.run_folder()
        self._context.log.warning("no emergency stop is kept beyond this process")
        return None

    def _kept(self) -> EStop | None:
        if self._file is None:
            return None
        try:
            return decode(EStop, self._file.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, HeelError) as error:
            # The note says that the robot is to stand, whatever else is lost.
            self._context.log.warning("%s: %s", self._file, error)
            return EStop(engaged=True, source="a note that cannot be read")
