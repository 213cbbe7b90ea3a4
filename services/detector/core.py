"""The detector: one frame in, its blobs out. No transport, no clock, deterministic."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas import Blobs, Evidence, FrameId, Tracks
from schemas.blobs import MAX_BLOBS
from services.detector.components import find_regions
from services.detector.geometry import WorkSize
from services.detector.gmm import BackgroundModel
from services.detector.packing import pack
from services.detector.protection import Protection
from services.detector.settings import DetectorSettings

SceneKey = tuple[str, int, int, int]
"""Stream, epoch, width, height."""


@dataclass(slots=True)
class _Scene:
    """All that has to start over when the stream, the epoch or the size changes."""

    key: SceneKey
    size: WorkSize
    model: BackgroundModel
    protection: Protection
    reason: str
    frames: int = 0


class Detector:
    """GMM, shadow removal, morphology, components, true-blob test.

    Usage:
        detector = Detector(DetectorSettings())
        blobs = detector.detect(frame, image, source_size, feedback=None)
    """

    name = "mog2"

    def __init__(self, settings: DetectorSettings) -> None:
        self.settings = settings
        self._scene: _Scene | None = None

    def detect(
        self,
        frame: FrameId,
        image: NDArray[np.uint8],
        source_size: tuple[int, int],
        feedback: Tracks | None,
    ) -> Blobs:
        """Find the blobs of one frame and learn its background.

        A new size, stream or epoch starts over with an empty background.

        Args:
            frame: which frame this is.
            image: (H, W, 3) uint8 BGR, any size from 1x1.
            source_size: width and height before capture scaled the frame, pixels.
            feedback: tracks of frame `seq - settings.feedback_lag_frames`, None when there are
                none; tracks of another scene are ignored.
        """
        scene = self._scene_of(frame, image)
        scene.frames += 1
        learning = scene.frames <= self.settings.learning_frames
        small = scene.size.shrink(image)
        protected = None if learning else self._protected(scene, frame, feedback)
        labels = scene.model.classify(self._blurred(small), protected)
        if self.settings.median_px:
            labels = np.asarray(cv2.medianBlur(labels, self.settings.median_px), np.uint8)
        regions = find_regions(labels, scene.size, self.settings)
        kept = regions[:MAX_BLOBS]
        return Blobs(
            **frame.model_dump(include=set(FrameId.model_fields)),
            width=scene.size.frame_width,
            height=scene.size.frame_height,
            source_width=source_size[0],
            source_height=source_size[1],
            blobs=pack(kept, small, scene.size),
            blobs_left_out=len(regions) - len(kept),
            evidence=Evidence.from_array(labels),
            detector=self.name,
            background="learning" if learning else "valid",
            background_reason=scene.reason if learning else "",
            protected_seq=feedback.seq if feedback is not None and protected is not None else None,
        )

    def _scene_of(self, frame: FrameId, image: NDArray[np.uint8]) -> _Scene:
        height, width = image.shape[:2]
        key = (frame.stream, frame.epoch, width, height)
        if self._scene is None or key != self._scene.key:
            settings = self.settings
            size = WorkSize.of_frame(width, height, settings.work_width_px)
            self._scene = _Scene(
                key,
                size,
                BackgroundModel(
                    settings.history_frames, settings.variance_threshold, settings.shadow_ratio
                ),
                Protection(size, settings.protect_margin, settings.protect_still_s),
                _reason(self._scene.key if self._scene else None, key),
            )
        return self._scene

    def _protected(
        self, scene: _Scene, frame: FrameId, feedback: Tracks | None
    ) -> NDArray[np.bool_] | None:
        if feedback is None or not self.settings.protect:
            return None
        if (feedback.stream, feedback.epoch, feedback.width, feedback.height) != scene.key:
            return None
        return scene.protection.mask(feedback, frame.t_capture_ns)

    def _blurred(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        size = self.settings.blur_px
        return np.asarray(cv2.GaussianBlur(image, (size, size), 0), np.uint8) if size else image


def _reason(before: SceneKey | None, now: SceneKey) -> str:
    if before is None:
        return "started"
    if before[2:] != now[2:]:
        return f"size changed from {before[2]}x{before[3]} to {now[2]}x{now[3]}"
    return f"stream restarted: epoch {now[1]} of {now[0]}"
