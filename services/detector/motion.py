"""What moves: the difference between a frame and one shortly before."""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.camera_motion import Affine, compose

SPAN_S = 0.12
"""At 0.12 s a walking person's outline has moved by several working pixels, a camera has not."""

_MAX_FRAMES = 64
_OPEN = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))


class FrameDifference:
    """Remembers the last frames and says where the newest differs from the one `SPAN_S` before."""

    def __init__(self) -> None:
        self._past: deque[tuple[int, NDArray[np.uint8], Affine]] = deque(maxlen=_MAX_FRAMES)

    def update(
        self, image: NDArray[np.uint8], t_ns: int, camera: Affine | None = None
    ) -> NDArray[np.uint8]:
        """(H, W) uint8, 255 where it moves; nothing moves in the first frame.

        Args:
            image: (H, W, 3) uint8, smoothed; kept, so it must not be written to afterwards.
            t_ns: acquisition time.
            camera: motion of the camera since the frame before; None if it stands still.
        """
        if camera is not None:
            self._past = deque(
                ((then, picture, compose(camera, moved)) for then, picture, moved in self._past),
                maxlen=_MAX_FRAMES,
            )
        # Frame times jitter: a frame that is 5 % too young will do.
        while len(self._past) > 1 and t_ns - self._past[1][0] >= 0.95e9 * SPAN_S:
            self._past.popleft()
        before = image
        if self._past:
            before = self._past[0][1]
            if camera is not None:
                before = _carried(before, self._past[0][2], image)
        self._past.append((t_ns, image, np.eye(2, 3)))
        return _moving(image, before)


def _carried(
    before: NDArray[np.uint8], motion: Affine, image: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """An older frame in the pixels of this one; what it did not show is this one's."""
    size = (image.shape[1], image.shape[0])
    # OpenCV warps four channels in half the time of three, copies included, with equal results.
    older, newer = (cv2.cvtColor(each, cv2.COLOR_BGR2BGRA) for each in (before, image))
    cv2.warpAffine(older, motion, size, newer, borderMode=cv2.BORDER_TRANSPARENT)
    return np.asarray(cv2.cvtColor(newer, cv2.COLOR_BGRA2BGR), np.uint8)


def _moving(image: NDArray[np.uint8], before: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Where two frames differ by clearly more than most pixels do."""
    blue, green, red = cv2.split(cv2.absdiff(image, before))
    strongest = np.asarray(cv2.max(cv2.max(blue, green), red), np.uint8)
    # Most of a picture is at rest, so the median is the camera's noise, compression included.
    level = 8.0 + 4.0 * float(np.median(strongest[::4, ::4]))
    moving = cv2.threshold(strongest, level, 255, cv2.THRESH_BINARY)[1]
    return np.asarray(cv2.morphologyEx(moving, cv2.MORPH_OPEN, _OPEN), np.uint8)


def mark_moving(evidence: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """FOREGROUND that moves becomes MOVING, the next higher value.

    Args:
        evidence: (H, W) uint8 of NONE, SHADOW and FOREGROUND.
        moving: (H, W) uint8, 0 or 255.
    """
    return evidence + ((evidence >> 1) & moving)
