"""The working size: every frame is brought under a bound before any pixel is looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy

# Under the schema's 2048 pixels a side; two bit planes of this size stay under its byte cap even
# when zlib cannot shrink them.
MAX_WORK_SIDE_PX = 2048
MAX_WORK_PIXELS = 1_000_000


@dataclass(frozen=True, slots=True)
class WorkSize:
    """Frame size and the size at which it is looked at, pixels."""

    frame_width: int
    frame_height: int
    width: int
    height: int

    @classmethod
    def of_frame(cls, frame_width: int, frame_height: int, work_width_px: int) -> WorkSize:
        """The largest size of the same shape within all bounds; never larger than the frame."""
        scale = min(
            1.0,
            work_width_px / frame_width,
            MAX_WORK_SIDE_PX / frame_height,
            math.sqrt(MAX_WORK_PIXELS / (frame_width * frame_height)),
        )
        width, height = (max(1, int(side * scale)) for side in (frame_width, frame_height))
        return cls(frame_width, frame_height, width, height)

    @property
    def scale_x(self) -> float:
        """Frame pixels per working pixel, horizontally."""
        return self.frame_width / self.width

    @property
    def scale_y(self) -> float:
        """Frame pixels per working pixel, vertically."""
        return self.frame_height / self.height

    def shrink(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(frame_height, frame_width, 3) uint8 to (height, width, 3).

        Whole factors by area averaging, what remains, less than 2, by interpolation, which takes a
        sixth of the time of averaging by a fraction.
        """
        whole = min(self.frame_width // self.width, self.frame_height // self.height)
        if whole > 1:
            between = (self.frame_width // whole, self.frame_height // whole)
            image = np.asarray(cv2.resize(image, between, interpolation=cv2.INTER_AREA), np.uint8)
        if image.shape[:2] != (self.height, self.width):
            size = (self.width, self.height)
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.uint8)
        return image

    def to_frame(self, box: tuple[int, int, int, int]) -> BoxXyxy:
        """A working box left, top, width, height as a frame box xyxy."""
        left, top, width, height = box
        return self.box_to_frame((left, top, left + width, top + height))

    def box_to_frame(self, box: BoxXyxy) -> BoxXyxy:
        """A box of working pixels, xyxy, in frame pixels."""
        left, top, right, bottom = box
        return (
            left * self.scale_x, top * self.scale_y, right * self.scale_x, bottom * self.scale_y,
        )  # fmt: skip
