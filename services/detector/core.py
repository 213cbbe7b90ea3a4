"""The detector: one frame in, its blobs out. No transport, no clock, deterministic."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, HeelError, Pointed, SettingsError, Tracks
from heel.services.detector.auto import AutoDetector
from heel.services.detector.background.detector import BackgroundDetector
from heel.services.detector.background.foreground import MovingForeground, StandingForeground
from heel.services.detector.interface import (
    Frame,
    FrameDetector,
    KeepsState,
    added_detector,
    added_names,
)
from heel.services.detector.mog2 import Mog2Foreground
from heel.services.detector.neural.detector import NeuralDetector
from heel.services.detector.settings import BUILT_IN, DetectorSettings


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
            pointed: where a user pointed, since the frame before, at a person without a track.
        """
        return self._detector.detect(Frame(frame, image, source_size, feedback, pointed))

    def snapshot(self) -> bytes | None:
        """What another detector with the same settings can go on from; None: it begins anew.

        It is the person pointed at that is kept. Networks keep nothing, backgrounds are learned.
        """
        return self._detector.snapshot() if isinstance(self._detector, KeepsState) else None

    def restore(self, snapshot: bytes) -> None:
        """Go on from a snapshot, a moment later.

        Raises:
            HeelError: it is none of this detector; nothing has changed then.
        """
        if not isinstance(self._detector, KeepsState):
            raise HeelError(f"detector {self.settings.method} keeps no state: it begins anew")
        self._detector.restore(snapshot)


def _made(settings: DetectorSettings, clock: Callable[[], float] | None) -> FrameDetector:
    match settings.method:
        case "onnx":
            return NeuralDetector(settings, clock)
        case "auto":
            return AutoDetector(settings)
        case "mixture":
            return BackgroundDetector(StandingForeground, settings)
        case "ego":
            return BackgroundDetector(MovingForeground, settings)
        case "mog2":
            return BackgroundDetector(Mog2Foreground, settings)
        case name:
            return _added(name, settings)


def _added(name: str, settings: DetectorSettings) -> FrameDetector:
    factory = added_detector(name)
    if factory is None:
        known = ", ".join(sorted({*BUILT_IN, *added_names()}))
        raise SettingsError(f"detector {name!r} is not known: use one of {known}")
    options = getattr(factory, "Options", None)
    made: FrameDetector = (
        factory(settings) if options is None else factory(settings, options(**settings.options))
    )
    return made
