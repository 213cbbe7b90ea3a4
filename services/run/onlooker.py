"""Whoever looks at the page of a simulated world, and clicks on the scenario's person."""

from __future__ import annotations

import math

import zenoh
from zenoh.handlers import FifoChannel, Handler

from schemas import SimTruth, TargetRequest, encode, keys

_FIRST_CLICK_S, _AGAIN_S = 1.0, 0.5
_LEAST_VISIBLE = 0.5
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""
_ANSWER_S = 1.0


class Onlooker:
    """Clicks until somebody is chosen, once an episode."""

    def __init__(self) -> None:
        """There is nothing to look at yet."""
        self._due_s = math.inf
        self._asked: Handler[zenoh.Reply] | None = None

    def episode(self) -> None:
        """A new world begins."""
        self._due_s, self._asked = _FIRST_CLICK_S, None

    def look(self, session: zenoh.Session, truth: SimTruth) -> None:
        """Take in a picture, and click if it is time to."""
        self._hear()
        target = next((person for person in truth.people if person.role == "target"), None)
        if truth.t_s < self._due_s or target is None or target.box_xyxy is None:
            return
        if target.visible < _LEAST_VISIBLE:
            return
        self._due_s = truth.t_s + _AGAIN_S
        left, top, right, bottom = target.box_xyxy
        click = TargetRequest(
            mode="point", x_px=(left + right) / 2, y_px=top + _DOWN * (bottom - top)
        )
        self._asked = session.get(
            keys.FOLLOW_TARGET, FifoChannel(1), payload=encode(click), encoding=click.encoding(),
            timeout=_ANSWER_S,
        )  # fmt: skip

    def _hear(self) -> None:
        """An answer that is no refusal ends it."""
        while self._asked is not None and (reply := self._asked.try_recv()) is not None:
            self._due_s = math.inf if reply.ok is not None else self._due_s
            self._asked = None
