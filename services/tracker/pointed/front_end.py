"""The person that a user pointed at: the detector knows who it is, so that the id stays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.schemas import Blob, Blobs
from heel.services.tracker.people import kalman
from heel.services.tracker.people.front_end import UNSEEN, Scene
from heel.services.tracker.people.geometry import FloatArray, boxes_to_measurements
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.track import Track
from heel.services.tracker.settings import Reporting

_EPSILON_S = 1e-6
"""Slack of comparisons of times [s], below any frame's."""
_CONFIRM_HITS = 3
"""Boxes from which the person counts, as with the other front ends; chosen by hand."""
_NOISE = 0.1
"""Factor on the variance of a box, which the detector has fitted to the person's colours and
filtered. Where boxes shake by 1 % of their height, the velocity errs by 0.10 heights/s at 0.1, 0.22
at 0.01 and 0.53 at 0, and the box differs from the measured one by 0.5 % of the height."""


class PointedFrontEnd:
    """At most one box a frame, always of the same person; how probably it is, the score says."""

    pictures = True
    """It is known otherwise than by place who the person is, as where descriptors are taken."""
    detection_rate = 0.0
    """Being missed says nothing against a person whom the detector goes on looking for."""
    doubt = ""

    def __init__(self, reporting: Reporting, rows: int, identify: bool = True) -> None:
        """Start before the person is seen.

        Args:
            reporting: from which height a person is shown, and for how long unseen.
            rows: of the picture.
            identify: whether a person that was forgotten is the same one when found again.
        """
        self._reporting = reporting
        self._identify = identify
        self._least_px = reporting.min_height * rows
        self._blob: Blob | None = None
        self._person: Track | None = None

    def settle(self) -> None:
        """Nothing waits."""

    def measure(self, frame: Blobs, scene: Scene) -> Measured:
        """The box is of the track that there is."""
        self._blob = blob = frame.blobs[0] if frame.blobs else None
        if blob is None or not scene.tracks:
            return Measured()
        value, variance = _measured(blob)
        told = Measurement(
            scene.tracks[0], value[0], variance[0], proven=blob.proven, told=_score(blob)
        )  # fmt: skip
        return Measured([told])

    def take_stock(self, tracks: list[Track], measured: Measured, t_s: float) -> list[Track]:
        """A box without a track starts one, which goes on as the person of before."""
        if self._blob is None or measured.singles:
            return tracks
        value, variance = _measured(self._blob)
        mean, covariance = kalman.update(*kalman.initial_state(value), value, variance)
        born = Track.born(mean[0], covariance[0], 1.0, t_s)
        born.proven = self._blob.proven
        if self._person is not None and self._identify:
            born.hits = self._person.hits + 1
            born.confirmed = self._person.confirmed
            born.become(self._person, 1.0)
        born.confidence = _score(self._blob)
        self._person = born
        return [*tracks, born]

    def ready(self, tracks: Sequence[Track]) -> list[Track]:
        """A person seen several times."""
        return [one for one in tracks if not one.confirmed and one.hits >= _CONFIRM_HITS]

    def parted(self, newcomer: Track, tracks: Sequence[Track]) -> list[Track]:
        """None: there is one person alone."""
        return []

    def hides(self, track: Track, t_s: float, at_side: bool) -> str:
        """A person is shown that is seen, or was shortly before, and is large enough."""
        if t_s - track.seen_s > self._reporting.show_missed_s + _EPSILON_S:
            return UNSEEN
        if not track.confirmed:
            return "seen too seldom so far"
        return "smaller than tracker.min_height" if track.height_px() < self._least_px else ""


def _measured(blob: Blob) -> tuple[FloatArray, FloatArray]:
    """The box as one measurement, (1, 4), and its variance, (1, 4)."""
    value = boxes_to_measurements(np.array([blob.box_xyxy]))
    return value, _NOISE * kalman.measurement_variance(value)


def _score(blob: Blob) -> float:
    return 1.0 if blob.score is None else blob.score
