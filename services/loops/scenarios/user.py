"""The person who chooses whom the robot follows: looks at the picture and clicks."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from heel.schemas import HeelError, SimTruth, Target, TargetRequest

_FIRST_CLICK_S = 1.0
_AGAIN_S = 0.5
_LEAST_VISIBLE = 0.5
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""


class Chooser(Protocol):
    """Somebody before the page."""

    def act(
        self,
        now_s: float,
        choose: Callable[[TargetRequest], Target],
        shown: Target,
        truth: SimTruth,
        people_by_track: dict[int, int],
    ) -> None:
        """Look at the newest picture, and choose if it is time to; arguments as `User.act`."""


class User:
    """Clicks on the target until the page shows that person as chosen, and then never again.

    Args:
        target: index of the person to be followed.
    """

    def __init__(self, target: int) -> None:
        self._target = target
        self._due_s = _FIRST_CLICK_S

    def act(
        self,
        now_s: float,
        choose: Callable[[TargetRequest], Target],
        shown: Target,
        truth: SimTruth,
        people_by_track: dict[int, int],
    ) -> None:
        """Look at the newest picture, and click if it is time to.

        Args:
            now_s: simulated time.
            choose: asks the follower, which has the tracks of this picture; refuses by HeelError.
            shown: whom the page shows as chosen, or waited for.
            truth: what the picture shows.
            people_by_track: who its tracks are on.
        """
        if shown.track_id is not None and people_by_track.get(shown.track_id) == self._target:
            self._due_s = math.inf
        person = truth.people[self._target]
        looking = shown.mode == "point" and shown.track_id is None
        if now_s < self._due_s or looking or person.box_xyxy is None:
            return
        if person.visible < _LEAST_VISIBLE:
            return
        self._due_s = now_s + _AGAIN_S
        left, top, right, bottom = person.box_xyxy
        click = TargetRequest(
            mode="point", x_px=(left + right) / 2, y_px=top + _DOWN * (bottom - top)
        )
        # A refusal is shown on the page, and one clicks again.
        with suppress(HeelError):
            choose(click)
