"""Detected people, as a detector sends them, to the tracks of a message."""

from __future__ import annotations

import numpy as np

from heel.schemas import Blobs, Track
from heel.services.tracker.boxes.box_tracker import BoxTracker
from heel.services.tracker.people.appearance import describe
from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.people.tuning import ROBOT, tuned
from heel.services.tracker.report import tracks_of
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace import Trace


class DetectedPeople:
    """`BoxTracker` on blobs messages of kind "people": boxes, scores and the pixels under them."""

    def __init__(
        self,
        image_size: tuple[int, int],
        next_id: int = 1,
        settings: TrackerSettings | None = None,
        trace: Trace | None = None,
    ) -> None:
        """Start without tracks.

        Args:
            image_size: (width, height) of the frames, pixels.
            next_id: the first id to give out.
            settings: of reports and of the use of appearance; defaults if None.
            trace: takes what is decided.
        """
        tuning = tuned(ROBOT, settings or TrackerSettings())
        self._tracker = BoxTracker(tuning, image_size, next_id, trace)
        self._identify = settings is None or settings.identify
        self._t_s = 0.0

    @property
    def next_id(self) -> int:
        """The id that the next newcomer gets."""
        return self._tracker.next_id

    @property
    def withheld(self) -> str:
        """Why people are not shown, see `PeopleTracker.withheld`."""
        return self._tracker.withheld

    def interrupt(self, next_id: int) -> None:
        """As `PeopleTracker.interrupt`."""
        self._tracker.interrupt(next_id)

    def update(self, blobs: Blobs, dt_s: float) -> list[Track]:
        """Take one frame; all confirmed tracks that are not lost, by id.

        Args:
            blobs: of kind "people".
            dt_s: seconds since the frame before, > 0.
        """
        self._t_s += dt_s
        reports = self._tracker.update(
            np.array([blob.box_xyxy for blob in blobs.blobs]).reshape(-1, 4),
            np.array([1.0 if blob.score is None else blob.score for blob in blobs.blobs]),
            self._t_s,
            describe([blob.patch.array() for blob in blobs.blobs]) if self._identify else None,
            None if blobs.camera_motion is None else CameraStep.told(blobs.camera_motion),
            np.array([blob.proven for blob in blobs.blobs], bool),
        )
        return tracks_of(reports)
