"""Tells a frozen camera, which repeats the same bytes, from a still scene, which has noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_ROW_STRIDE = 16


class RepeatWatch:
    """Says for every frame for how long a camera has shown the very same bytes.

    Comparing beats hashing: with sensor noise one row in sixteen already differs (0.02 ms for
    768x576, zlib.crc32 takes 0.32 ms), and where it does not, the full comparison is exact.
    """

    def __init__(self) -> None:
        self._image: NDArray[np.uint8] | None = None
        self._since_ns = 0

    def update(self, image: NDArray[np.uint8], now_ns: int) -> int:
        """Take the next frame, (H, W, 3) uint8, which nobody may write to afterwards.

        Args:
            image: the frame.
            now_ns: when it was acquired, on any clock that does not go back.

        Returns:
            When these bytes came first, on the same clock; `now_ns` if they differ from the last.
        """
        if self._image is None or not _same_bytes(image, self._image):
            self._image, self._since_ns = image, now_ns
        return self._since_ns

    def reset(self) -> None:
        """Forget the last frame, for example after connecting again."""
        self._image = None


def _same_bytes(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> bool:
    return np.array_equal(a[::_ROW_STRIDE], b[::_ROW_STRIDE]) and np.array_equal(a, b)
