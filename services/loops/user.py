"""The simulated user, who chooses whom the robot follows: looks at the picture and clicks."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from heel.schemas import HeelError, SimTruth, Target, TargetRequest

_FIRST_CLICK_S, _AGAIN_S = 1.0, 0.5
"""Until the first picture is taken in, and until a click is repeated; both chosen by hand."""
_LEAST_VISIBLE = 0.5
"""Share of the target's box that is to be seen when the user clicks on it; chosen by hand."""
_DOWN = 0.4
"""Share of the box above the click: one clicks on the chest."""


class Chooser(Protocol):
    """A user before the page.

    Only what both know is passed: what the page shows, and what the picture really shows.
    """

    def act(
        self,
        now_s: float,
        choose: Callable[[TargetRequest], object],
        shown: Target,
        truth: SimTruth,
        people: dict[int, int],
    ) -> None:
        """Look at the newest picture, and choose if it is time to.

        Args:
            now_s: simulated time, seconds.
            choose: asks the follower, which has the tracks of this picture; may refuse by
                HeelError.
            shown: the target that the page shows as chosen, or waited for.
            truth: what the picture shows.
            people: index of the person by track id, of this picture's tracks.
        """


class User:
    """Clicks on the target until the page shows that person as chosen, and then never again."""

    def __init__(self) -> None:
        """Nobody is chosen yet."""
        self._due_s = _FIRST_CLICK_S

    def act(
        self,
        now_s: float,
        choose: Callable[[TargetRequest], object],
        shown: Target,
        truth: SimTruth,
        people: dict[int, int],
    ) -> None:
        """As `Chooser.act`; a world without a target is only looked at."""
        target = next((i for i, one in enumerate(truth.people) if one.role == "target"), None)
        if target is None:
            return
        if shown.track_id is not None and people.get(shown.track_id) == target:
            self._due_s = math.inf
        person = truth.people[target]
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
