"""Regions of foreground, or, once a user has pointed at somebody else, the box of that person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs
from heel.schemas.follow import Pointed
from heel.services.detector.auto.foreground import AutoForeground
from heel.services.detector.background_detector import BackgroundDetector, SceneKey
from heel.services.detector.geometry import WorkSize
from heel.services.detector.interface import Frame
from heel.services.detector.pointed.detector import PointedAt
from heel.services.detector.pointed.message import people_message
from heel.services.detector.regions import smoothed
from heel.services.detector.settings import DetectorSettings


@dataclass(frozen=True, slots=True)
class _Scene:
    key: SceneKey
    size: WorkSize
    pointed: PointedAt


class AutoDetector:
    """A background while it shows who is wanted, else the colours of whoever was pointed at.

    Who stands from the start is background, and a robot that drives close behind somebody sees the
    floor move otherwise than the walls, so that no background can be carried along. A point at
    which nobody is tracked says where to look all the same.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        """With nothing known of the scene."""
        self._settings = settings
        self._background = BackgroundDetector(AutoForeground, settings)
        self._scene: _Scene | None = None

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame, of kind `people` while somebody pointed at is looked for."""
        scene = self._scene_of(frame)
        if frame.pointed is None and not scene.pointed.somebody:
            return self._background.detect(frame)
        smooth = smoothed(scene.size.shrink(frame.image), self._settings.blur_px)
        if frame.pointed is not None:
            self._point(scene, smooth, frame.pointed)
        if not scene.pointed.somebody:
            return self._background.detect(frame)
        sighting, motion = scene.pointed.look(smooth, frame.id.t_capture_ns)
        return people_message(frame, scene.size, sighting, motion, scene.pointed.count)

    def _point(self, scene: _Scene, smooth: NDArray[np.uint8], pointed: Pointed) -> None:
        of = (pointed.frame.stream, pointed.frame.epoch, pointed.width, pointed.height)
        if of != scene.key:
            return
        x, y = pointed.x_px / scene.size.scale_x, pointed.y_px / scene.size.scale_y
        if scene.pointed.point(smooth, x, y):
            # Whatever it has learned is of another view by the time it is needed again.
            self._background = BackgroundDetector(AutoForeground, self._settings)

    def _scene_of(self, frame: Frame) -> _Scene:
        height, width = frame.image.shape[:2]
        key = (frame.id.stream, frame.id.epoch, width, height)
        if self._scene is None or key != self._scene.key:
            size = WorkSize.of_frame(width, height, self._settings.work_width_px)
            self._scene = _Scene(key, size, PointedAt())
        return self._scene
