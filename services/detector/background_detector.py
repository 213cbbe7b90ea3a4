"""Detection by a background: working size, foreground, blobs with their pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from heel.schemas import Blobs, CameraMotion, Evidence, FrameId, Tracks
from heel.schemas.blobs import MAX_BLOBS
from heel.services.detector.camera_motion import MotionEstimate
from heel.services.detector.geometry import WorkSize
from heel.services.detector.interface import Frame
from heel.services.detector.packing import pack
from heel.services.detector.regions import Foreground
from heel.services.detector.settings import DetectorSettings

SceneKey = tuple[str, int, int, int]
"""Stream, epoch, width, height."""
Model = Callable[[WorkSize, DetectorSettings], Foreground]


@dataclass(frozen=True, slots=True)
class _Scene:
    """All that has to start over when the stream, the epoch or the size changes."""

    key: SceneKey
    size: WorkSize
    foreground: Foreground
    reason: str


class BackgroundDetector:
    """Foreground against a learned background, one model a scene."""

    def __init__(self, model: Model, settings: DetectorSettings) -> None:
        """Use this model of the background."""
        self._make = model
        self._settings = settings
        self._scene: _Scene | None = None

    def detect(self, frame: Frame) -> Blobs:
        """Find the blobs of one frame and learn its background."""
        scene = self._scene_of(frame)
        small = scene.size.shrink(frame.image)
        seen = scene.foreground.look(small, frame.id, self._protecting(scene, frame.feedback))
        kept = seen.regions[:MAX_BLOBS]
        state: Literal["learning", "valid"] = "learning" if seen.learning else "valid"
        reason = seen.reason or (scene.reason if seen.learning else "")
        return Blobs(
            **frame.id.model_dump(include=set(FrameId.model_fields)),
            width=scene.size.frame_width,
            height=scene.size.frame_height,
            source_width=frame.source_size[0],
            source_height=frame.source_size[1],
            blobs=pack(kept, small, scene.size),
            blobs_left_out=len(seen.regions) - len(kept),
            evidence=None if seen.evidence is None else Evidence.from_array(seen.evidence),
            camera_motion=camera_motion(seen.motion, scene.size),
            detector=scene.foreground.name,
            background="invalid" if seen.evidence is None else state,
            background_reason=reason,
            protected_seq=seen.protected_seq,
        )

    def _scene_of(self, frame: Frame) -> _Scene:
        height, width = frame.image.shape[:2]
        key = (frame.id.stream, frame.id.epoch, width, height)
        if self._scene is None or key != self._scene.key:
            size = WorkSize.of_frame(width, height, self._settings.work_width_px)
            reason = _reason(self._scene.key if self._scene else None, key)
            self._scene = _Scene(key, size, self._make(size, self._settings), reason)
        return self._scene

    def _protecting(self, scene: _Scene, feedback: Tracks | None) -> Tracks | None:
        if feedback is None or not self._settings.protect:
            return None
        of = (feedback.stream, feedback.epoch, feedback.width, feedback.height)
        return feedback if of == scene.key else None


def camera_motion(motion: MotionEstimate | None, size: WorkSize) -> CameraMotion | None:
    """A motion of working pixels in frame pixels."""
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
