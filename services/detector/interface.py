"""What a detector is: a class with `detect(frame) -> Blobs`, found by its name.

A package of one's own adds a detector by an entry point of the group `heel.detectors`, see
examples/red_detector.py. A detector that is to run as a process of its own needs nothing but
`heel.schemas`, see examples/own_detector.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, Pointed, Tracks
from heel.services.detector.scene import SceneKey


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame and what goes with it.

    Attributes:
        id: which frame this is.
        image: (H, W, 3) uint8 BGR, any size from 1x1.
        source_size: width and height before capture scaled the frame, pixels.
        feedback: tracks of frame `seq - settings.feedback_lag_frames` or older, None when there
            are none; they may be of another scene.
        pointed: where a user pointed, since the frame before, at a person that is not tracked;
            None for nowhere. May be of another scene.
    """

    id: FrameId
    image: NDArray[np.uint8]
    source_size: tuple[int, int]
    feedback: Tracks | None
    pointed: Pointed | None = None

    @property
    def scene(self) -> SceneKey:
        """Which scene it shows."""
        height, width = self.image.shape[:2]
        return SceneKey(self.id.stream, self.id.epoch, width, height)


class FrameDetector(Protocol):
    """Finds people, or pieces of them, frame by frame; deterministic, without a clock."""

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame; a new stream, epoch or size starts over."""
        ...
