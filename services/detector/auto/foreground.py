"""Foreground by the model that fits what the camera does, changed without starting over."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.blobs import FOREGROUND
from heel.services.detector.auto.standing import RestWatch, StandingWatch
from heel.services.detector.camera_motion import MotionEstimate
from heel.services.detector.ego.foreground import EgoForeground
from heel.services.detector.free_mask import free_mask
from heel.services.detector.geometry import WorkSize
from heel.services.detector.mixture.foreground import MixtureForeground
from heel.services.detector.regions import Seen
from heel.services.detector.settings import DetectorSettings

_FLOODED, _FLOODED_S = 0.6, 0.5
"""More foreground than this share of the picture is no people but a model that does not hold; for
longer than this it is not to be believed any more."""


class AutoForeground:
    """The mixture while the camera stands still, the carried background while it moves.

    Either begins with what the other has learned, so that a change of model floods nothing with
    foreground. Where neither holds (the camera's motion cannot be told, or most of the picture
    would be foreground) nothing is reported as seen, and the message says so.
    """

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        self._size = size
        self._settings = settings
        self._standing: MixtureForeground | None = MixtureForeground(size, settings)
        self._moving: EgoForeground | None = None
        self._watch = StandingWatch()
        self._rest = RestWatch(size.width, size.height)
        self._flooded_ns: int | None = None
        self.name = MixtureForeground.name

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame with the model that fits."""
        moved = self._has_moved(image, frame, feedback)
        if moved is not None and self._standing is not None:
            self._start_moving(self._standing)
        if self._standing is not None:
            seen = self._standing.look(image, frame, feedback)
        else:
            assert self._moving is not None
            seen = self._moving.look(image, frame, feedback, moved)
            if seen.motion is not None and self._rest.update(seen.motion, frame.t_capture_ns):
                self._start_standing(self._moving)
        return self._judged(seen, frame.t_capture_ns)

    def _has_moved(
        self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None
    ) -> MotionEstimate | None:
        if self._standing is None:
            return None
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        free = free_mask(feedback, frame, self._size)
        return self._watch.update(grey, free, frame.t_capture_ns)

    def _start_moving(self, before: MixtureForeground) -> None:
        self._moving = EgoForeground(self._size, self._settings, before.learned)
        self._rest = RestWatch(self._size.width, self._size.height)
        self._standing, self.name = None, EgoForeground.name

    def _start_standing(self, before: EgoForeground) -> None:
        self._standing = MixtureForeground(self._size, self._settings, before.learned)
        self._watch = StandingWatch()
        self._moving, self.name = None, MixtureForeground.name

    def _judged(self, seen: Seen, t_ns: int) -> Seen:
        """What was seen, or nothing where that cannot be people."""
        share = 0.0
        if seen.evidence is not None and not seen.learning:
            share = float(np.count_nonzero(seen.evidence >= FOREGROUND)) / seen.evidence.size
        if share < _FLOODED:
            self._flooded_ns = None
            return seen
        if self._flooded_ns is None:
            self._flooded_ns = t_ns
        elif t_ns - self._flooded_ns > _FLOODED_S * 1e9:
            self._start_over()
        reason = f"{share:.0%} of the picture differs from the background"
        return Seen(None, [], False, seen.protected_seq, seen.motion, reason)

    def _start_over(self) -> None:
        """The light or the scene is another one: nothing that was learned is of use."""
        self._flooded_ns = None
        self._watch = StandingWatch()
        if self._standing is not None:
            self._standing = MixtureForeground(self._size, self._settings)
        else:
            self._moving = EgoForeground(self._size, self._settings)
