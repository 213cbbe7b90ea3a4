"""What the follower sees in the window: true boxes without identities, or the pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, CameraMotion, FrameId, Tracks
from heel.services.detector.messages import person_blobs
from heel.services.detector.settings import DetectorSettings
from heel.services.loops.panning.truth import InWindow
from heel.services.pipeline import InProcessPipeline
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings

PerceptionName = Literal["true-boxes", "pixels"]

_LEAST_INSIDE = 0.25
"""Share of a person inside the window that a person who draws boxes would mark; chosen by hand."""
_LEAST_PX = 8.0
"""Least side of a box that such a person would draw; chosen by hand."""
_TRUE_SCORE = 0.95
"""Of boxes that are the ground truth's: as sure as a detector gets."""


class WindowPerception(Protocol):
    """Makes tracks of a window."""

    def see(
        self, frame: FrameId, image: NDArray[np.uint8], offset_px: tuple[float, float],
        truth: InWindow,
    ) -> Tracks:  # fmt: skip
        """Tracks of one frame.

        Args:
            frame: which frame this is.
            image: (H, W, 3) uint8 BGR, the window.
            offset_px: where it lies in the recording.
            truth: everybody in it.
        """


class Pixels:
    """Detector and tracker, given nothing but the window's pixels.

    Args:
        settings: of the detector; the tracker has its defaults.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        self._pipeline = InProcessPipeline(settings, TrackerSettings())

    def see(
        self, frame: FrameId, image: NDArray[np.uint8], offset_px: tuple[float, float],
        truth: InWindow,
    ) -> Tracks:  # fmt: skip
        """As `WindowPerception.see`; offset and truth are not looked at."""
        return self._pipeline.step(frame, image, (image.shape[1], image.shape[0]))[1]


class TrueBoxes:
    """Ground truth as a detector of people would send it, and the tracker.

    Boxes are cut at the window's border and carry the window's pixels; identities are left out.
    The motion of the camera is the window's own.
    """

    def __init__(self) -> None:
        self._tracker = Tracker(TrackerSettings())
        self._offset: tuple[float, float] | None = None

    def see(
        self, frame: FrameId, image: NDArray[np.uint8], offset_px: tuple[float, float],
        truth: InWindow,
    ) -> Tracks:  # fmt: skip
        """As `WindowPerception.see`."""
        left, top = offset_px
        before = self._offset or offset_px
        self._offset = offset_px
        height, width = image.shape[:2]
        blobs = Blobs(
            **frame.model_dump(),
            width=width,
            height=height,
            source_width=width,
            source_height=height,
            blobs=_blobs(truth, image),
            kind="people",
            camera_motion=CameraMotion(
                affine=(1.0, 0.0, before[0] - left, 0.0, 1.0, before[1] - top), quality=1.0
            ),
            detector="true-boxes",
        )
        return self._tracker.update(blobs)


def perception(name: PerceptionName, model: Path | None = None) -> WindowPerception:
    """The perception of that name, knowing nobody; `model` is for pixels."""
    return TrueBoxes() if name == "true-boxes" else Pixels(DetectorSettings(model=model))


def _blobs(truth: InWindow, image: NDArray[np.uint8]) -> tuple[Blob, ...]:
    size = truth.boxes_xyxy[:, 2:] - truth.boxes_xyxy[:, :2]
    marked = (truth.inside >= _LEAST_INSIDE) & (size >= _LEAST_PX).all(axis=1)
    boxes = truth.boxes_xyxy[marked]
    # By place: the order of the ground truth would tell who is who.
    people = [((a, b, c, d), _TRUE_SCORE) for a, b, c, d in sorted(boxes.tolist())]
    return tuple(person_blobs(people, image))
