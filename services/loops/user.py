"""The simulated user, who chooses the person to follow: looks at the picture and clicks."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from heel.schemas import HeelError, SimTruth, Target, TargetRequest

_FIRST_CLICK_S = 1.0
"""Until the first picture is taken in; chosen by hand."""
_AGAIN_S = 0.5
"""Until a click is repeated; chosen by hand."""
_LEAST_VISIBLE = 0.5
"""Share of the target's box that is to be seen when the user clicks on it; chosen by hand."""
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""


Choose = Callable[[TargetRequest], object]
"""Asks the follower, which has the tracks of the picture that is looked at; may refuse by
`HeelError`."""


@dataclass(frozen=True, slots=True)
class View:
    """What stands before a user.

    Attributes:
        now_s: simulated time, seconds.
        shown: the target that the page shows as chosen, or waited for.
        truth: what the newest picture really shows.
        people: index of the person in it by track id.
    """

    now_s: float
    shown: Target
    truth: SimTruth
    people: dict[int, int]


class Chooser(Protocol):
    """A user before the page."""

    def act(self, view: View, choose: Choose) -> None:
        """Look, and choose if it is time to."""


class User:
    """Clicks on the target until the page shows it as chosen, and from then on only when asked to.

    Where the first picture shows nobody to click on, the robot is asked to follow the nearest
    person that it finds.
    """

    def __init__(self) -> None:
        """Nobody is chosen yet."""
        self._due_s = _FIRST_CLICK_S
        self._looked = False

    def act(self, view: View, choose: Choose) -> None:
        """As `Chooser.act`; a world without a target is only looked at."""
        people, shown = view.truth.people, view.shown
        target = next((i for i, one in enumerate(people) if one.role == "target"), None)
        if target is None:
            return
        if shown.track_id is not None and view.people.get(shown.track_id) == target:
            self._due_s = math.inf
        elif shown.mode == "none" and "choose again" in shown.reason and math.isinf(self._due_s):
            self._due_s = view.now_s
        person = people[target]
        looking = shown.mode in ("point", "nearest") and shown.track_id is None
        if view.now_s < self._due_s or looking:
            return
        first, self._looked = not self._looked, True
        if first and not any(one.visible > 0 for one in people):
            # A refusal is shown on the page, and one asks again by a click.
            with suppress(HeelError):
                choose(TargetRequest(mode="nearest"))
            return
        if person.box_xyxy is None or person.visible < _LEAST_VISIBLE:
            return
        self._due_s = view.now_s + _AGAIN_S
        left, top, right, bottom = person.box_xyxy
        click = TargetRequest(
            mode="point", x_px=(left + right) / 2, y_px=top + _DOWN * (bottom - top)
        )
        # A refusal is shown on the page, and one clicks again.
        with suppress(HeelError):
            choose(click)
