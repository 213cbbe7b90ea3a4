"""The person who chooses whom the robot follows: looks at the picture and clicks."""

from __future__ import annotations

import math
from collections.abc import Callable

from schemas import HeelError, SimTruth, Target, TargetRequest

_FIRST_CLICK_S = 1.0
_AGAIN_S = 0.5
_LEAST_VISIBLE = 0.5
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""


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
        truth: SimTruth,
        people_by_track: dict[int, int],
    ) -> None:
        """Look at the newest picture, and click if it is time to.

        Args:
            now_s: simulated time.
            choose: asks the follower, which has the tracks of this picture; refuses by HeelError.
            truth: what the picture shows.
            people_by_track: who its tracks are on.
        """
        person = truth.people[self._target]
        if now_s < self._due_s or person.box_xyxy is None or person.visible < _LEAST_VISIBLE:
            return
        self._due_s = now_s + _AGAIN_S
        left, top, right, bottom = person.box_xyxy
        click = TargetRequest(
            mode="point", x_px=(left + right) / 2, y_px=top + _DOWN * (bottom - top)
        )
        try:
            chosen = choose(click).track_id
        except HeelError:
            # Nobody is tracked there yet: the page says so, and one clicks again.
            return
        if chosen is not None and people_by_track.get(chosen) == self._target:
            self._due_s = math.inf
