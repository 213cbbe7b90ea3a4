"""The detector: one frame in, its blobs out. No transport, no clock, deterministic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas import Blobs, CameraMotion, Evidence, FrameId, Tracks
from schemas.blobs import MAX_BLOBS
from services.detector.camera_motion import MotionEstimate
from services.detector.ego.foreground import EgoForeground
from services.detector.geometry import WorkSize
from services.detector.mixture.foreground import MixtureForeground
from services.detector.mog2.foreground import Mog2Foreground
from services.detector.packing import pack
from services.detector.regions import Foreground
from services.detector.settings import DetectorSettings

_MODELS: dict[str, Callable[[WorkSize, DetectorSettings], Foreground]] = {
    "mixture": MixtureForeground,
    "mog2": Mog2Foreground,
    "ego": EgoForeground,
}
SceneKey = tuple[str, int, int, int]
"""Stream, epoch, width, height."""


@dataclass(frozen=True, slots=True)
class _Scene:
    """All that has to start over when the stream, the epoch or the size changes."""

    key: SceneKey
    size: WorkSize
    foreground: Foreground
    reason: str


class Detector:
    """Working size, foreground against a learned background, blobs with their pixels.

    Usage:
        detector = Detector(DetectorSettings())
        blobs = detector.detect(frame, image, source_size, feedback=None)
    """

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
            feedback: tracks of frame `seq - settings.feedback_lag_frames` or older, None when
                there are none; tracks of another scene are ignored.
        """
        scene = self._scene_of(frame, image)
        small = scene.size.shrink(image)
        seen = scene.foreground.look(small, frame, self._protecting(scene, feedback))
        kept = seen.regions[:MAX_BLOBS]
        return Blobs(
            **frame.model_dump(include=set(FrameId.model_fields)),
            width=scene.size.frame_width,
            height=scene.size.frame_height,
            source_width=source_size[0],
            source_height=source_size[1],
            blobs=pack(kept, small, scene.size),
            blobs_left_out=len(seen.regions) - len(kept),
            evidence=Evidence.from_array(seen.evidence),
            camera_motion=_camera_motion(seen.motion, scene.size),
            detector=scene.foreground.name,
            background="learning" if seen.learning else "valid",
            background_reason=scene.reason if seen.learning else "",
            protected_seq=seen.protected_seq,
        )

    def _scene_of(self, frame: FrameId, image: NDArray[np.uint8]) -> _Scene:
        height, width = image.shape[:2]
        key = (frame.stream, frame.epoch, width, height)
        if self._scene is None or key != self._scene.key:
            size = WorkSize.of_frame(width, height, self.settings.work_width_px)
            model = _MODELS[self.settings.background]
            reason = _reason(self._scene.key if self._scene else None, key)
            self._scene = _Scene(key, size, model(size, self.settings), reason)
        return self._scene

    def _protecting(self, scene: _Scene, feedback: Tracks | None) -> Tracks | None:
        if feedback is None or not self.settings.protect:
            return None
        of = (feedback.stream, feedback.epoch, feedback.width, feedback.height)
        return feedback if of == scene.key else None


def _camera_motion(motion: MotionEstimate | None, size: WorkSize) -> CameraMotion | None:
    """The motion in frame pixels."""
    if motion is None:
        return None
    (xx, xy, x), (yx, yy, y) = motion.affine
    aspect = size.scale_x / size.scale_y
    affine = (xx, xy * aspect, x * size.scale_x, yx / aspect, yy, y * size.scale_y)
    return CameraMotion(affine=affine, quality=motion.quality)


def _reason(before: SceneKey | None, now: SceneKey) -> str:
    if before is None:
        return "started"
    if before[2:] != now[2:]:
        return f"size changed from {before[2]}x{before[3]} to {now[2]}x{now[3]}"
    return f"stream restarted: epoch {now[1]} of {now[0]}"
