"""The track of a pointed-at person: the detector knows the person, so that the id stays."""

from __future__ import annotations

import math

from heel.schemas import Blob, Blobs, Track
from heel.schemas.base import BoxXyxy
from heel.services.geometry.boxes import centre, moved
from heel.services.geometry.picture_motion import moved_point
from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.report import Report, faded, tracks_of
from heel.services.tracker.settings import Reporting

_CONFIRM_FRAMES = 3
"""Frames with a blob from which the track counts, as with the other trackers; chosen by hand."""
_SPEED_MEMORY_S = 0.3
"""Seconds: time constant of the low-pass filter of the velocity; long enough for boxes that shake,
short enough for turns; chosen by hand."""


class SoughtTracker:
    """Blobs of which each is the same person; how probably it is, the score says."""

    def __init__(self, next_id: int, reporting: Reporting, identify: bool = True) -> None:
        """Start before the person is seen.

        Args:
            next_id: the id to give out.
            reporting: from which height a person is shown, and for how long unseen.
            identify: whether a person that was forgotten is the same one when found again.
        """
        self._reporting = reporting
        self._identify = identify
        self.next_id = next_id + 1
        self._id = next_id
        self._box: BoxXyxy | None = None
        self._confidence = 0.0
        self._proven = False
        self._velocity = (0.0, 0.0)
        self._seen_frames = self._missed_frames = 0
        self._missed_s = 0.0

    def update(self, blobs: Blobs, dt_s: float) -> list[Track]:
        """Take in one frame: the person's track if it is seen, or was shortly before.

        Args:
            blobs: one blob, or none.
            dt_s: seconds since the frame before, > 0.
        """
        if blobs.blobs:
            self._see(blobs.blobs[0], dt_s)
        else:
            self._miss(blobs, dt_s)
        if self._box is None or self._missed_s > self._reporting.forget_s:
            return []
        return tracks_of([self._report(self._box, blobs.height)])

    def _see(self, blob: Blob, dt_s: float) -> None:
        if self._missed_s > self._reporting.forget_s and not self._identify:
            self._id, self.next_id = self.next_id, self.next_id + 1
            self._seen_frames = 0
        if self._box is None or self._missed_frames:
            self._velocity = (0.0, 0.0)
        else:
            gain = 1.0 - math.exp(-dt_s / _SPEED_MEMORY_S)
            before, now = centre(self._box), centre(blob.box_xyxy)
            speed = [
                old + gain * ((to - at) / dt_s - old)
                for old, at, to in zip(self._velocity, before, now, strict=True)
            ]
            self._velocity = (speed[0], speed[1])
        self._box = blob.box_xyxy
        self._confidence = 1.0 if blob.score is None else blob.score
        self._proven = blob.proven
        self._seen_frames += 1
        self._missed_frames, self._missed_s = 0, 0.0

    def _miss(self, blobs: Blobs, dt_s: float) -> None:
        self._missed_frames += 1
        self._missed_s += dt_s
        if self._box is None or blobs.camera_motion is None:
            return
        before = centre(self._box)
        now = moved_point(CameraStep.told(blobs.camera_motion).matrix, before)
        # Whatever a message says of the camera: a box out of all bounds ends no tracker.
        by_the_frame = abs(now[0]) <= 2 * blobs.width and abs(now[1]) <= 2 * blobs.height
        step = now[0] - before[0], now[1] - before[1]
        self._box = moved(self._box, *step) if by_the_frame else None

    def _report(self, box: BoxXyxy, rows: int) -> Report:
        return Report(
            id=self._id,
            box_xyxy=box,
            velocity_pxps=self._velocity,
            confirmed=self._seen_frames >= _CONFIRM_FRAMES,
            alone=self._missed_frames == 0,
            missed_frames=self._missed_frames,
            in_front=(),
            identity_confidence=faded(self._confidence, self._missed_s),
            runner_up_confidence=0.0,
            shown=self._missed_s <= self._reporting.show_missed_s
            and box[3] - box[1] >= self._reporting.min_height * rows,
            proven=self._proven,
        )
