"""A detector as a plug-in, with options of its own: whatever is red is a person.

`pip install ./examples`, then: heel detector --detector red --options redness=60,least_px=100
"""

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from heel.schemas import Blobs
from heel.services.detector.interface import Frame
from heel.services.detector.messages import blobs_message, person_blobs
from heel.services.detector.scene import Scenes
from heel.services.detector.settings import DetectorSettings


class RedDetector:
    """One box around everything red."""

    class Options(BaseModel):
        """Found by Heel: unknown names and values out of range are refused with these texts."""

        model_config = ConfigDict(extra="forbid")

        redness: int = Field(
            80, ge=1, le=255, description="least excess of red over green and blue, grey levels"
        )
        least_px: int = Field(50, ge=1, description="least red pixels of a person")

    def __init__(self, settings: DetectorSettings, options: Options) -> None:
        """Called once; a new stream, epoch or size is for `detect` to notice."""
        self._options = options
        self._scenes = Scenes(settings.work_width_px, lambda _size: None)

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame, in its pixels."""
        blue, green, red = cv2.split(frame.image)
        excess = cv2.subtract(red, cv2.max(blue, green))
        mask = np.asarray(excess >= self._options.redness, np.uint8)
        people = []
        if np.count_nonzero(mask) >= self._options.least_px:
            x, y, width, height = cv2.boundingRect(mask)
            people = [((float(x), float(y), float(x + width), float(y + height)), 0.9)]
        size = self._scenes.of(frame.scene).size
        blobs = person_blobs(people, frame.image)
        return blobs_message(frame, size, "red", blobs, None, kind="people")
