"""What a network is shown of a picture: the picture and, in the room that is left, a small copy.

A picture that is not of the form of the network's input leaves part of it free, at the same cost.
Small networks see people best who take up a fourth or a third of the input, not those who fill it:
of rendered people 1.75 to 2 m away, 70 % of the height of 640x480, YOLOX-nano found 65 % with a
score of 0.3, and with the copy 99 %; from 1.5 to 1.75 m 24 %, and with it all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.neural.heads import Floats
from heel.services.geometry.boxes import clipped

PAD_GREY = 114
_GAP_PX = 8
"""Between picture and copy: the network's finest cell."""
_LEAST_COPY_SHARE = 0.2
"""Of the input's side: in a smaller copy nobody is found."""
_LARGE_SHARE = 0.45
"""Of the picture's height: whoever is smaller is seen better in the picture than in the copy."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where on the sheet the picture is: upper left corner and size, pixels, and scale."""

    left: int
    top: int
    width: int
    height: int
    scale: float

    def inside(self, centre: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
        """Which of the points (N, 2) lie in it."""
        low = np.array([self.left, self.top])
        high = low + np.array([self.width, self.height])
        return np.asarray(((centre >= low) & (centre < high)).all(axis=1))

    def to_picture(self, boxes: Floats) -> Floats:
        """Boxes (N, 4) of the sheet in pixels of the picture."""
        offset = np.array([self.left, self.top, self.left, self.top], np.float32)
        return (boxes - offset) / np.float32(self.scale)


class Sheet:
    """Lays pictures of one size out on the network's input.

    Args:
        input_size: width and height of the input, pixels.
        picture_size: width and height of the pictures, pixels.
    """

    def __init__(self, input_size: tuple[int, int], picture_size: tuple[int, int]) -> None:
        self._input, self._picture = input_size, picture_size
        self._whole = self._placed(0, 0, *input_size)
        self._copy = self._free_place()

    def lay_out(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The network's input, (H, W, 3) uint8 BGR, for a picture of the same form."""
        sheet = np.full((self._input[1], self._input[0], 3), PAD_GREY, np.uint8)
        _put(sheet, picture, self._whole, cv2.INTER_LINEAR)
        if self._copy is not None:
            _put(sheet, picture, self._copy, cv2.INTER_AREA)
        return sheet

    def read(self, boxes: Floats, scores: Floats) -> tuple[Floats, Floats]:
        """Boxes and scores on the sheet as such of the picture, clipped to it.

        Args:
            boxes: (N, 4) xyxy, pixels of the sheet.
            scores: (N,).
        """
        centre = (boxes[:, :2] + boxes[:, 2:]) / 2
        if self._copy is None:
            return self._clipped(self._whole.to_picture(boxes)), scores
        on_copy = self._copy.inside(centre)
        copied = self._copy.to_picture(boxes[on_copy])
        large = copied[:, 3] - copied[:, 1] >= _LARGE_SHARE * self._picture[1]
        on_whole = self._whole.inside(centre)
        found = np.concatenate([self._whole.to_picture(boxes[on_whole]), copied[large]])
        return self._clipped(found), np.concatenate([scores[on_whole], scores[on_copy][large]])

    def _clipped(self, boxes: Floats) -> Floats:
        columns, rows = self._picture
        return clipped(boxes, (columns, rows))

    def _placed(self, left: int, top: int, width: int, height: int) -> _Place:
        """As large as fits into this room."""
        columns, rows = self._picture
        scale = min(width / columns, height / rows)
        wide = min(width, max(1, round(columns * scale)))
        high = min(height, max(1, round(rows * scale)))
        return _Place(left, top, wide, high, scale)

    def _free_place(self) -> _Place | None:
        """Below the picture or beside it; None where too little is free."""
        below, beside = self._whole.height + _GAP_PX, self._whole.width + _GAP_PX
        width, height = self._input
        if height - below >= _LEAST_COPY_SHARE * height:
            return self._placed(0, below, width, height - below)
        if width - beside >= _LEAST_COPY_SHARE * width:
            return self._placed(beside, 0, width - beside, height)
        return None


def _put(
    sheet: NDArray[np.uint8], picture: NDArray[np.uint8], place: _Place, interpolation: int
) -> None:
    resized = cv2.resize(picture, (place.width, place.height), interpolation=interpolation)
    sheet[place.top : place.top + place.height, place.left : place.left + place.width] = resized
