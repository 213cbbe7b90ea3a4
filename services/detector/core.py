"""The detector: one frame in, its blobs out. No transport, no clock, deterministic."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, Pointed, SettingsError, Tracks
from heel.services.detector.auto.detector import AutoDetector
from heel.services.detector.background_detector import BackgroundDetector
from heel.services.detector.ego.foreground import EgoForeground
from heel.services.detector.interface import Factory, Frame, FrameDetector, added_detector
from heel.services.detector.mixture.foreground import MixtureForeground
from heel.services.detector.mog2.foreground import Mog2Foreground
from heel.services.detector.neural.detector import NeuralDetector
from heel.services.detector.settings import DetectorSettings


class Detector:
    """The detector that the settings name.

    Usage:
        detector = Detector(DetectorSettings())
        blobs = detector.detect(frame, image, source_size, feedback=None)
    """

    def __init__(
        self, settings: DetectorSettings, clock: Callable[[], float] | None = None
    ) -> None:
        """Make it.

        Args:
            settings: of the detector.
            clock: seconds, where what is found may depend on the time it takes (live, with a
                budget); None: on the frames alone.

        Raises:
            SettingsError: it is not known, or its model cannot be used.
        """
        self.settings = settings
        self._detector = _made(settings, clock)

    def detect(
        self,
        frame: FrameId,
        image: NDArray[np.uint8],
        source_size: tuple[int, int],
        feedback: Tracks | None,
        pointed: Pointed | None = None,
    ) -> Blobs:
        """Find the blobs of one frame and learn from it.

        A new size, stream or epoch starts over.

        Args:
            frame: which frame this is.
            image: (H, W, 3) uint8 BGR, any size from 1x1.
            source_size: width and height before capture scaled the frame, pixels.
            feedback: tracks of frame `seq - settings.feedback_lag_frames` or older, None when
                there are none; tracks of another scene are ignored.
            pointed: where a user pointed at somebody who is not tracked, since the frame before.
        """
        return self._detector.detect(Frame(frame, image, source_size, feedback, pointed))


_BUILT_IN: dict[str, Factory] = {
    "auto": AutoDetector,
    "mixture": partial(BackgroundDetector, MixtureForeground),
    "mog2": partial(BackgroundDetector, Mog2Foreground),
    "ego": partial(BackgroundDetector, EgoForeground),
}


def _made(settings: DetectorSettings, clock: Callable[[], float] | None) -> FrameDetector:
    name = settings.detector
    if name == "onnx" or (name == "auto" and settings.model is not None):
        return NeuralDetector(settings, clock)
    if settings.model is not None and name in ("mixture", "mog2", "ego"):
        raise SettingsError(f"detector {name} takes no model: leave out --model, or use onnx")
    factory = _BUILT_IN.get(name) or added_detector(name, [*_BUILT_IN, "onnx"])
    return factory(settings)
