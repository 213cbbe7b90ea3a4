"""What a detector is: a class with `detect(frame) -> Blobs`, found by its name.

A package of one's own adds a detector by an entry point of the group `heel.detectors` that names a
callable of `DetectorSettings`; `heel detector --detector NAME` then uses it. A detector that is to
run as a process of its own needs nothing but `schemas`, see examples/own_detector.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, Pointed, SettingsError, Tracks
from heel.services.detector.settings import DetectorSettings

GROUP = "heel.detectors"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame and what goes with it.

    Attributes:
        id: which frame this is.
        image: (H, W, 3) uint8 BGR, any size from 1x1.
        source_size: width and height before capture scaled the frame, pixels.
        feedback: tracks of frame `seq - settings.feedback_lag_frames` or older, None when there
            are none; they may be of another scene.
        pointed: where a user pointed, since the frame before, and nobody was tracked; None for
            nowhere. May be of another scene.
    """

    id: FrameId
    image: NDArray[np.uint8]
    source_size: tuple[int, int]
    feedback: Tracks | None
    pointed: Pointed | None = None


class FrameDetector(Protocol):
    """Finds people, or pieces of them, frame by frame; deterministic, without a clock."""

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame; a new stream, epoch or size starts over."""
        ...


Factory = Callable[[DetectorSettings], FrameDetector]


def added_detector(name: str, built_in: list[str]) -> Factory:
    """The detector that another package has added under this name.

    Raises:
        SettingsError: there is none, or it cannot be imported.
    """
    added = {entry.name: entry for entry in entry_points(group=GROUP)}
    if name not in added:
        known = ", ".join(sorted({*built_in, *added}))
        raise SettingsError(f"detector {name!r} is not known: use one of {known}")
    try:
        factory: Factory = added[name].load()
    except (ImportError, AttributeError) as error:
        raise SettingsError(f"detector {name!r} ({added[name].value}): {error}") from error
    return factory
