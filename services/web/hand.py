"""Driving by hand from a browser: how old its wishes are, by what it repeats of ours. Pure.

A link that stalls delivers wishes late, one behind the other, and a browser has another clock. So
each wish repeats the newest number that the browser was sent: it is at most as old as that number.
"""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from dataclasses import dataclass

from heel.services.web.requests import BadRequestError

WISH_TTL_S = 0.3
"""Seconds that a wish holds: six of those that the page sends while it is held, so that a hiccup of
a wireless network does not stop the robot. Chosen by hand."""
_KEPT = 64
"""Numbers that are remembered: three seconds of wishes; older ones are too old anyway."""
_KEYS = {"beat", "held", "forward", "left"}


@dataclass(frozen=True, slots=True)
class Wish:
    """What a browser sends, as `schemas.manual.Manual` has it."""

    beat: int
    held: bool
    forward: float
    left: float


def read_wish(text: str) -> Wish:
    """Read `{"beat": 12, "held": true, "forward": 0.5, "left": 0}`.

    Raises:
        BadRequestError: anything else.
    """
    wrong = BadRequestError(
        'send {"beat": number, "held": true or false, "forward": -1 to 1, "left": -1 to 1}'
    )
    try:
        said = json.loads(text)
    # Deep nesting exhausts the parser's stack.
    except (ValueError, RecursionError):
        raise wrong from None
    if not isinstance(said, dict) or said.keys() != _KEYS or type(said["beat"]) is not int:
        raise wrong
    shares = [said["forward"], said["left"]]
    if type(said["held"]) is not bool or any(type(one) not in (int, float) for one in shares):
        raise wrong
    if not all(math.isfinite(one) and -1 <= one <= 1 for one in shares):
        raise wrong
    return Wish(said["beat"], said["held"], float(shares[0]), float(shares[1]))


class Beats:
    """Numbers that are sent to a browser, and when."""

    def __init__(self) -> None:
        self._sent_s: OrderedDict[int, float] = OrderedDict()
        self._next = 0

    def next(self, now_s: float) -> int:
        """A number that is sent now."""
        number, self._next = self._next, self._next + 1
        self._sent_s[number] = now_s
        while len(self._sent_s) > _KEPT:
            self._sent_s.popitem(last=False)
        return number

    def age_s(self, number: int, now_s: float) -> float:
        """How old a wish may be that repeats a number; infinite for one that is not known."""
        sent_s = self._sent_s.get(number)
        return math.inf if sent_s is None else max(0.0, now_s - sent_s)
