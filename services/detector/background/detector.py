"""Detection by a background: working size, foreground, blobs with their pixels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from heel.schemas import Blobs, Evidence
from heel.schemas.blobs import MAX_BLOBS
from heel.services.detector.background.evidence import Foreground
from heel.services.detector.interface import Frame
from heel.services.detector.messages import blobs_message, region_blobs
from heel.services.detector.scene import Scenes, WorkSize
from heel.services.detector.settings import DetectorSettings


class BackgroundDetector:
    """Foreground against a learned background, one model a scene."""

    def __init__(
        self, make: Callable[[WorkSize, DetectorSettings], Foreground], settings: DetectorSettings
    ) -> None:
        """Find foreground by what `make` makes for each scene."""
        self._protect = settings.protect
        self._scenes = Scenes(settings.work_width_px, lambda size: make(size, settings))

    def detect(self, frame: Frame) -> Blobs:
        """Find the blobs of one frame and learn its background."""
        scene = self._scenes.of(frame.scene)
        small = scene.size.shrink(frame.image)
        feedback = scene.key.matching(frame.feedback) if self._protect else None
        seen = scene.state.look(small, frame.id, feedback)
        kept = seen.regions[:MAX_BLOBS]
        state: Literal["learning", "valid"] = "learning" if seen.learning else "valid"
        return blobs_message(
            frame, scene.size, scene.state.name, region_blobs(kept, small, scene.size), seen.motion,
            blobs_left_out=len(seen.regions) - len(kept),
            evidence=None if seen.evidence is None else Evidence.from_array(seen.evidence),
            background="invalid" if seen.evidence is None else state,
            background_reason=seen.reason or (scene.reason if seen.learning else ""),
            protected_seq=seen.protected_seq,
        )  # fmt: skip
