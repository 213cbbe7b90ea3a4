"""Tracking of people by given boxes: one call per frame, boxes in, tracks with identities out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.boxes.frame import FrameBoxes, checked
from heel.services.tracker.boxes.front_end import BoxFrontEnd
from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import FILE, Tuning
from heel.services.tracker.report import Report
from heel.services.tracker.trace import Trace


class BoxTracker:
    """The people of a scene, measured by boxes alone."""

    def __init__(
        self,
        tuning: Tuning = FILE,
        image_size: tuple[int, int] | None = None,
        next_id: int = 1,
        trace: Trace | None = None,
    ) -> None:
        """Start without tracks; arguments as of `PeopleTracker`."""
        front = BoxFrontEnd(tuning, *(image_size or (0, 0))[::-1])
        self._people: PeopleTracker[FrameBoxes] = PeopleTracker(
            front, tuning, image_size, next_id, trace
        )

    @property
    def next_id(self) -> int:
        """The id that the next newcomer gets."""
        return self._people.next_id

    @property
    def withheld(self) -> str:
        """Why people are not shown, see `PeopleTracker.withheld`."""
        return self._people.withheld

    def interrupt(self, next_id: int) -> None:
        """As `PeopleTracker.interrupt`."""
        self._people.interrupt(next_id)

    def update(
        self,
        boxes: FloatArray,
        scores: FloatArray,
        t_s: float,
        looks: FloatArray | None = None,
        camera: CameraStep | None = None,
        proven: NDArray[np.bool_] | None = None,
    ) -> list[Report]:
        """Take one frame's boxes and return every track that is not lost.

        Args:
            boxes: (N, 4) xyxy pixels, in any order; those thinner than a pixel are left out.
            scores: (N,), any scale, more is surer.
            t_s: time of the frame in seconds, not before the last frame's.
            looks: (N, D) appearance descriptors of `appearance.describe`, or None without pictures.
            camera: motion of the picture since the frame before, where that is known.
            proven: (N,) whether a box is known to be on a person, not a thing; all if None.

        Raises:
            HeelError: a box or score is not finite, a box has no area, or time runs backwards.
        """
        return self._people.update(checked(boxes, scores, looks, proven), t_s, camera)
