"""Services of a live run that are killed, crash or hang are started again, so often and no oftener.

The robot stands meanwhile by itself: what a service that is gone leaves out is stale for those
behind it. What one that comes back knows of before, it has from the run folder.
"""

from __future__ import annotations

import logging
import math
from collections import deque

from heel.schemas import Health, HeelError
from heel.services.run.bounds import MOST_STARTS, WITHIN_S
from heel.services.run.children import Children
from heel.services.run.silence import HUNG_S, Silences

_FROZEN_S = 1.0
"""Time [s] for which a process is stopped (SIGSTOP) before it counts as frozen for good; chosen by
hand: such a process is at no work, however busy the machine is."""
_LOOK_S = 0.1
"""Seconds between two looks at the states of processes; chosen by hand."""
_DONE = 0  # exit code of a service that was told to end, or has nothing more to do
_WRONG_SETTINGS = 2  # exit code of one that a start would not help


class Revival:
    """Looks after the services of one run.

    Args:
        services: those that are started again.
        log: of the run.
    """

    def __init__(self, services: tuple[str, ...], log: logging.Logger) -> None:
        self._services, self._log = services, log
        self._turns = Silences(HUNG_S, *services)
        self._runs = Silences(_FROZEN_S, *services)
        self._starts: dict[str, deque[float]] = {name: deque() for name in services}
        self._looked_s = -math.inf
        self._producers: dict[str, str] = {}
        self._replaced: dict[str, str] = {}
        self.counts: dict[str, int] = {}
        """How often each service has been started again; those that never were are not in it."""

    def heard(self, health: Health, arrived_s: float) -> None:
        """Health of a service came; a loop that hangs is silent, whatever else is sent."""
        if health.producer == self._replaced.get(health.service):
            return  # sent before its end, and read after it
        self._producers[health.service] = health.producer
        turn_s = 0.0 if health.state == "starting" else health.loop_age_s
        self._turns.heard(health.service, arrived_s - turn_s)

    def look(self, children: Children, now_s: float) -> bool:
        """Start again whatever has to be; True if anything was. Call it often.

        Raises:
            HeelError: a service ends or hangs again and again.
        """
        frozen, hung = self._frozen(children, now_s), self._turns.look(now_s)
        news = False
        for name in self._services:
            code = children.exit_code(name)
            if name == frozen and code is None:
                news |= self._again(children, name, f"is frozen for {_FROZEN_S:g} s", now_s)
            elif name == hung and code is None:
                news |= self._again(children, name, f"is silent for {HUNG_S:g} s: it hangs", now_s)
            elif code not in (None, _DONE, _WRONG_SETTINGS):
                news |= self._again(children, name, f"ended with code {code}", now_s)
        return news

    def _frozen(self, children: Children, now_s: float) -> str | None:
        if now_s - self._looked_s < _LOOK_S:
            return None
        self._looked_s = now_s
        for name in self._services:
            if children.is_running(name):
                self._runs.heard(name, now_s)
        return self._runs.look(now_s)

    def _again(self, children: Children, name: str, why: str, now_s: float) -> bool:
        starts = self._starts[name]
        while starts and now_s - starts[0] > WITHIN_S:
            starts.popleft()
        if len(starts) == MOST_STARTS:
            raise HeelError(
                f"{name} {why} once more, after {MOST_STARTS} starts within {WITHIN_S:g} s"
                f"{children.last_words(name)}"
            )
        starts.append(now_s)
        self.counts[name] = self.counts.get(name, 0) + 1
        self._log.warning("%s %s: started again", name, why)
        children.start_again(name)
        self._replaced[name] = self._producers.get(name, "")
        self._turns.forget(name)
        self._runs.forget(name)
        return True
