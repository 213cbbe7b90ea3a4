"""People found by a network, whole frame by whole frame."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas import Blob, Blobs, FrameId, Patch, SettingsError
from schemas.blobs import MAX_BLOBS
from services.detector.background_detector import camera_motion
from services.detector.camera_motion import EgoMotion
from services.detector.free_mask import free_mask
from services.detector.geometry import WorkSize
from services.detector.interface import Frame
from services.detector.neural.model import Detections, PersonModel
from services.detector.regions import smoothed
from services.detector.settings import DetectorSettings

_PATCH_ROWS = 96
"""Patches are reduced to at most this height: enough for the colours of clothes."""


class NeuralDetector:
    """One box a person, with a score, and how the camera has moved."""

    def __init__(self, settings: DetectorSettings) -> None:
        """Load the network.

        Raises:
            SettingsError: there is none, or it cannot be used.
        """
        if settings.model is None:
            raise SettingsError("detector onnx needs --model FILE: an ONNX network, see the README")
        self._model = PersonModel(Path(settings.model))
        self._settings = settings
        self._scene: tuple[str, int, int, int] | None = None
        self._ego = EgoMotion()

    def detect(self, frame: Frame) -> Blobs:
        """Find the people of one frame."""
        height, width = frame.image.shape[:2]
        size = WorkSize.of_frame(width, height, self._settings.work_width_px)
        scene = (frame.id.stream, frame.id.epoch, width, height)
        if scene != self._scene:
            self._scene, self._ego = scene, EgoMotion()
        found = self._model.detect(frame.image, self._settings.model_score)
        small = smoothed(size.shrink(frame.image), self._settings.blur_px)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        feedback = frame.feedback
        if feedback is not None and (feedback.width, feedback.height) != (width, height):
            feedback = None
        motion = self._ego.update(grey, free_mask(feedback, frame.id, size))
        return Blobs(
            **frame.id.model_dump(include=set(FrameId.model_fields)),
            width=width,
            height=height,
            source_width=frame.source_size[0],
            source_height=frame.source_size[1],
            blobs=_blobs(found, frame.image),
            blobs_left_out=max(0, len(found.boxes) - MAX_BLOBS),
            kind="people",
            camera_motion=camera_motion(motion, size),
            detector="onnx",
        )


def _blobs(found: Detections, image: NDArray[np.uint8]) -> tuple[Blob, ...]:
    blobs = []
    for box, score in list(zip(found.boxes.tolist(), found.scores.tolist(), strict=True)):
        left, top, right, bottom = box
        blobs.append(
            Blob(
                box_xyxy=(left, top, right, bottom),
                area_px=(right - left) * (bottom - top),
                centroid=((left + right) / 2, (top + bottom) / 2),
                patch=Patch.from_array(_patch(image, box)),
                score=min(1.0, score),
            )
        )
    return tuple(blobs[:MAX_BLOBS])


def _patch(image: NDArray[np.uint8], box: list[float]) -> NDArray[np.uint8]:
    rows, columns = image.shape[:2]
    left, top = min(int(box[0]), columns - 1), min(int(box[1]), rows - 1)
    right, bottom = max(left + 1, round(box[2])), max(top + 1, round(box[3]))
    pixels = image[top:bottom, left:right]
    if pixels.shape[0] <= _PATCH_ROWS:
        return pixels
    width = max(1, round(pixels.shape[1] * _PATCH_ROWS / pixels.shape[0]))
    return np.asarray(
        cv2.resize(pixels, (width, _PATCH_ROWS), interpolation=cv2.INTER_AREA), np.uint8
    )
