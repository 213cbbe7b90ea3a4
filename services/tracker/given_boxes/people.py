"""Detected people, as a detector sends them, to the tracks of a message."""

from __future__ import annotations

import numpy as np

from heel.schemas import Blobs, Track
from heel.services.tracker.given_boxes.appearance import describe
from heel.services.tracker.given_boxes.box_tracker import BoxTracker
from heel.services.tracker.given_boxes.carry import CameraStep
from heel.services.tracker.given_boxes.settings import (
    AppearanceSettings,
    BoxTrackerSettings,
    LifeSettings,
    MemorySettings,
)
from heel.services.tracker.given_boxes.track import TrackOutput

PEOPLE_SETTINGS = BoxTrackerSettings(
    life=LifeSettings(
        shown_score=0.85, birth_score=0.5, hidden_score=0.4, coast_s=0.15, least_height=0.08
    ),
    memory=MemorySettings(trust=0.75),
    appearance=AppearanceSettings(most_against_present=3.0, reassure=1.0),
)
"""A robot would rather see somebody who is doubtful than lose them for a frame."""


class PeopleTracker:
    """`BoxTracker` on blobs messages of kind "people": boxes, scores and the pixels under them."""

    def __init__(
        self,
        image_size: tuple[int, int],
        next_id: int = 1,
        settings: BoxTrackerSettings = PEOPLE_SETTINGS,
    ) -> None:
        """Start with nobody.

        Args:
            image_size: (width, height) of the frames, pixels.
            next_id: the first id to give out.
            settings: all numbers.
        """
        self._tracker = BoxTracker(settings, image_size, next_id)
        self._t_s = 0.0

    @property
    def next_id(self) -> int:
        """The id that the next newcomer gets."""
        return self._tracker.next_id

    def update(self, blobs: Blobs, dt_s: float) -> list[Track]:
        """Take one frame; everybody who is confirmed and near, by id.

        Args:
            blobs: of kind "people".
            dt_s: seconds since the frame before, > 0.
        """
        self._t_s += dt_s
        found = self._tracker.update(
            np.array([blob.box_xyxy for blob in blobs.blobs]).reshape(-1, 4),
            np.array([1.0 if blob.score is None else blob.score for blob in blobs.blobs]),
            self._t_s,
            describe([blob.patch.array() for blob in blobs.blobs]),
            None if blobs.camera_motion is None else CameraStep.told(blobs.camera_motion),
        )
        known = sorted((output for output in found if output.track_id), key=lambda o: o.track_id)
        return [_track(output) for output in known]


def _track(output: TrackOutput) -> Track:
    left, top, right, bottom = output.box.tolist()
    speed_x, speed_y = output.velocity_pxps.tolist()
    return Track(
        id=output.track_id,
        state=output.state.value,
        box_xyxy=(left, top, right, bottom),
        velocity_pxps=(speed_x, speed_y),
        area_px=(right - left) * (bottom - top),
        span_px=right - left,
        identity_confidence=output.identity_confidence,
        runner_up_confidence=output.runner_up_confidence,
        occluded_by=output.occluded_by,
        missed_frames=output.missed_frames,
        shown=output.shown,
    )
