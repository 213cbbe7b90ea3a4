"""Whoever looks at the page of a simulated world, and clicks on the scenario's person."""

from __future__ import annotations

import math

import zenoh
from zenoh.handlers import FifoChannel, Handler

from heel.schemas import SimTruth, Target, TargetRequest, decode, encode, keys

_FIRST_CLICK_S, _AGAIN_S = 1.0, 0.5
_LEAST_VISIBLE = 0.5
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""
_ANSWER_S = 1.0


class Onlooker:
    """Clicks on somebody and waits for what comes of it, until they are chosen; once an episode."""

    def __init__(self) -> None:
        """There is nothing to look at yet."""
        self._due_s = math.inf
        self._looking = False
        self._asked: Handler[zenoh.Reply] | None = None

    def episode(self) -> None:
        """A new world begins."""
        self._due_s, self._looking, self._asked = _FIRST_CLICK_S, False, None

    def look(self, session: zenoh.Session, truth: SimTruth) -> None:
        """Take in a picture, and click, or ask what came of it, if it is time to."""
        self._hear()
        target = next((person for person in truth.people if person.role == "target"), None)
        if truth.t_s < self._due_s or target is None or target.box_xyxy is None:
            return
        if self._looking:
            self._ask(session, truth.t_s, None)
        elif target.visible >= _LEAST_VISIBLE:
            left, top, right, bottom = target.box_xyxy
            self._ask(session, truth.t_s, TargetRequest(
                mode="point", x_px=(left + right) / 2, y_px=top + _DOWN * (bottom - top)
            ))  # fmt: skip

    def _ask(self, session: zenoh.Session, now_s: float, click: TargetRequest | None) -> None:
        self._due_s = now_s + _AGAIN_S
        self._asked = session.get(
            keys.FOLLOW_TARGET, FifoChannel(1), timeout=_ANSWER_S,
            payload=None if click is None else encode(click),
            encoding=None if click is None else click.encoding(),
        )  # fmt: skip

    def _hear(self) -> None:
        """Somebody who is chosen ends it; a point that is still looked at wants patience."""
        while self._asked is not None and (reply := self._answer(self._asked)) is not None:
            self._asked = None
            if reply.ok is None:
                self._looking = False
                continue
            target = decode(Target, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
            self._looking = target.mode == "point" and target.track_id is None
            if target.track_id is not None:
                self._due_s = math.inf

    def _answer(self, asked: Handler[zenoh.Reply]) -> zenoh.Reply | None:
        try:
            return asked.try_recv()
        except zenoh.ZError:
            # Closed and empty: nobody answered in time.
            self._asked = None
            return None
