"""Tells a camera that shows nothing new from a still scene, which has contrast and noise."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_ROW_STRIDE = 16
"""Rows, of which one is looked at first; chosen by hand."""
_BLANK_DEVIATION = 5.0
"""8-bit levels. A covered lens deviates by its noise, 1 to 4; a dim street by 20 and more."""


class NewsWatch:
    """Says for every frame since when a camera has shown nothing new.

    Nothing new is the very same bytes again, or a picture without contrast: black, white, covered.

    Comparing beats hashing: with sensor noise one row in sixteen already differs (0.02 ms for
    768x576, zlib.crc32 takes 0.32 ms), and where it does not, the full comparison is exact.
    """

    def __init__(self) -> None:
        self._image: NDArray[np.uint8] | None = None
        self._since_ns = 0
        self.complaint = ""
        """What the last picture showed in place of news; empty if it was new."""

    def update(self, image: NDArray[np.uint8], now_ns: int) -> int:
        """Take the next frame, (H, W, 3) uint8, which is not to be written to afterwards.

        Args:
            image: the frame.
            now_ns: when it was acquired, on any clock that does not go back.

        Returns:
            When the last new picture came, on the same clock; `now_ns` if this one is new.
        """
        self.complaint = ""
        if self._image is not None and _blank(image):
            self.complaint = "black, white or covered: the picture has no contrast"
        elif self._image is not None and _same_bytes(image, self._image):
            self.complaint = "the very same picture comes again and again"
        if not self.complaint:
            self._image, self._since_ns = image, now_ns
        return self._since_ns

    def reset(self) -> None:
        """Forget the last frame, for example after connecting again."""
        self._image = None


def _same_bytes(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> bool:
    return np.array_equal(a[::_ROW_STRIDE], b[::_ROW_STRIDE]) and np.array_equal(a, b)


def _blank(image: NDArray[np.uint8]) -> bool:
    """0.02 ms for 768x576."""
    _, deviation = cv2.meanStdDev(image[::_ROW_STRIDE])
    return float(deviation.max()) < _BLANK_DEVIATION
