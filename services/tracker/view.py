"""A blobs message as the tracker reads it: sightings in a fixed order, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas import Blobs
from schemas.base import BoxXyxy
from schemas.blobs import FOREGROUND
from services.tracker import boxes


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One blob: box in frame pixels, pixels (H, W, 3) uint8 BGR at working size."""

    box: BoxXyxy
    pixels: NDArray[np.uint8]


class View:
    """One frame as seen by the detector."""

    def __init__(self, blobs: Blobs) -> None:
        """Unpack a message.

        Raises:
            MessageError: the evidence map does not unpack.
        """
        found = [
            Sighting(blob.box_xyxy, blob.patch.array())
            for blob in blobs.blobs
            if boxes.area(blob.box_xyxy) > 0
        ]
        # Whatever order they were sent in, they are looked at in one.
        self.sightings = sorted(found, key=lambda sighting: sighting.box)
        self.width, self.height = blobs.width, blobs.height
        self._foreground: NDArray[np.bool_] | None = None
        if blobs.evidence is not None:
            self._foreground = blobs.evidence.array() == FOREGROUND

    def foreground_points(self, box: BoxXyxy) -> NDArray[np.float64] | None:
        """Centres of the foreground pixels in `box`, (N, 2) x and y; None without evidence.

        Each stands for `pixel_area_px` square pixels of the frame.
        """
        if self._foreground is None:
            return None
        rows, columns = self._slices(box)
        y, x = np.nonzero(self._foreground[rows, columns])
        scale_x, scale_y = self._scales()
        return np.column_stack(
            [(x + columns.start + 0.5) * scale_x, (y + rows.start + 0.5) * scale_y]
        )

    @property
    def pixel_area_px(self) -> float:
        """Frame pixels per pixel of the evidence map."""
        scale_x, scale_y = self._scales()
        return scale_x * scale_y

    def mask(self, sighting: Sighting) -> NDArray[np.bool_] | None:
        """The foreground under a sighting's pixels, of their size; None without evidence."""
        if self._foreground is None:
            return None
        rows, columns = self._slices(sighting.box)
        crop = self._foreground[rows, columns].astype(np.uint8)
        height, width = sighting.pixels.shape[:2]
        if crop.size == 0:
            return None
        return np.asarray(cv2.resize(crop, (width, height), interpolation=cv2.INTER_NEAREST) > 0)

    def _scales(self) -> tuple[float, float]:
        if self._foreground is None:
            return 1.0, 1.0
        rows, columns = self._foreground.shape
        return self.width / columns, self.height / rows

    def _slices(self, box: BoxXyxy) -> tuple[slice, slice]:
        assert self._foreground is not None
        scale_x, scale_y = self._scales()
        limit_y, limit_x = self._foreground.shape
        left, right = (int(np.clip(round(x / scale_x), 0, limit_x)) for x in (box[0], box[2]))
        top, bottom = (int(np.clip(round(y / scale_y), 0, limit_y)) for y in (box[1], box[3]))
        return slice(top, bottom), slice(left, right)
