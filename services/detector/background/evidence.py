"""From the picture to a map of evidence, and from that to regions: alike for every background.

picture --smoothed--> labels of a background --median--> what moves is marked --> regions
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.blobs import FOREGROUND
from heel.services.geometry.picture_motion import Affine, MotionEstimate, compose

Indices = NDArray[np.intp]
"""Positions in a flattened map, ascending."""

_SPAN_S = 0.12
"""Between two frames that are compared: the outline of a walking person has moved by several
working pixels, a standing camera has not."""
_JITTER = 0.95  # of the span: frame times jitter, so a frame that is 5 % too young will do
_MOST_FRAMES = 64  # kept for comparison: more than the span holds at any frame rate
_LEAST_DIFFERENCE = 8.0
"""Grey levels that are no movement in a picture without noise; chosen by hand."""
_NOISE_FACTOR = 4.0
"""Of the median difference, the noise of the camera, on top of that; chosen by hand."""
_MEDIAN_PX = 5  # median filter over labels: single pixels are noise
_SPECKS = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))  # opening of what moves
_GAPS = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 7))
"""Closing of foreground: bodies are cut across, by belts and shadows, more than down."""


@dataclass(frozen=True, slots=True)
class Region:
    """One connected region, in working pixels."""

    left: int
    top: int
    width: int
    height: int
    area: int
    centroid_x: float
    centroid_y: float


@dataclass(frozen=True, slots=True)
class Seen:
    """One frame as a background sees it.

    Attributes:
        evidence: (H, W) uint8 of NONE, SHADOW, FOREGROUND and MOVING; None where it cannot say.
        regions: foreground regions, largest first.
        learning: whether the model has only just started and is not to be believed yet.
        protected_seq: frame whose tracks were kept out of the model just now, if any.
        motion: of the camera since the frame before, None where it is taken to stand still.
        reason: why, where it cannot say.
    """

    evidence: NDArray[np.uint8] | None
    regions: list[Region]
    learning: bool
    protected_seq: int | None
    motion: MotionEstimate | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """What is known of a background: with it another model goes on where one has ended.

    Attributes:
        mean: (H, W, 3) float32.
        variance: (H, W) float32, grey levels squared.
        known: (H, W) uint8, 255 where the background is known, else 0.
    """

    mean: NDArray[np.float32]
    variance: NDArray[np.float32]
    known: NDArray[np.uint8]


class Foreground(Protocol):
    """A background of one scene: tells foreground, and learns."""

    @property
    def name(self) -> str:
        """Of the background, for the message."""
        ...

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See one frame, (H, W, 3) uint8 BGR at working size; feedback is of the same scene."""
        ...


def smoothed(image: NDArray[np.uint8], blur_px: int) -> NDArray[np.uint8]:
    """A new image: Gaussian blur with a kernel of `blur_px`, odd; 0 only copies."""
    if not blur_px:
        return image.copy()
    return np.asarray(cv2.GaussianBlur(image, (blur_px, blur_px), 0), np.uint8)


class FrameDifference:
    """Remembers the last frames and says where the newest differs from the one `_SPAN_S` before."""

    def __init__(self) -> None:
        self._past: deque[tuple[int, NDArray[np.uint8], Affine]] = deque(maxlen=_MOST_FRAMES)

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
                maxlen=_MOST_FRAMES,
            )
        while len(self._past) > 1 and t_ns - self._past[1][0] >= _JITTER * 1e9 * _SPAN_S:
            self._past.popleft()
        before = image
        if self._past:
            before = self._past[0][1]
            if camera is not None:
                before = _warped(before, self._past[0][2], image)
        self._past.append((t_ns, image, np.eye(2, 3)))
        return _moving(image, before)


def _warped(
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
    level = _LEAST_DIFFERENCE + _NOISE_FACTOR * float(np.median(strongest[::4, ::4]))
    moving = cv2.threshold(strongest, level, 255, cv2.THRESH_BINARY)[1]
    return np.asarray(cv2.morphologyEx(moving, cv2.MORPH_OPEN, _SPECKS), np.uint8)


def without_specks(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Labels through a median filter."""
    return np.asarray(cv2.medianBlur(labels, _MEDIAN_PX), np.uint8)


def mark_moving(labels: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """FOREGROUND that moves becomes MOVING, the next higher value.

    Args:
        labels: (H, W) uint8 of NONE, SHADOW and FOREGROUND.
        moving: (H, W) uint8, 0 or 255.
    """
    return labels + ((labels >> 1) & moving)


def foreground(evidence: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """255 where FOREGROUND or MOVING, else 0."""
    return np.asarray(cv2.threshold(evidence, FOREGROUND - 1, 255, cv2.THRESH_BINARY)[1], np.uint8)


def find_regions(evidence: NDArray[np.uint8], min_area_px: int) -> list[Region]:
    """Connected foreground, largest first.

    Small ones stay: a person cut up by a lamp post is put together by the tracker.
    """
    closed = cv2.morphologyEx(foreground(evidence), cv2.MORPH_CLOSE, _GAPS)
    regions = regions_of(np.asarray(closed, np.uint8))
    return [region for region in regions if region.area >= min_area_px]


def indices_of(mask: NDArray[np.uint8]) -> Indices:
    """Where a map is not 0; several times faster than `np.flatnonzero` of bytes."""
    return np.flatnonzero(np.minimum(mask, 1).view(np.bool_))


def regions_of(mask: NDArray[np.uint8]) -> list[Region]:
    """The 8-connected regions of a (H, W) mask, largest first.

    The statistics come from the set pixels only, which takes a third of the time of OpenCV's own.
    """
    index = indices_of(mask)
    if not index.size:
        return []
    count, labels = cv2.connectedComponents(mask, connectivity=8)
    label = np.asarray(labels, np.int32).reshape(-1)[index]
    y, x = np.divmod(index, mask.shape[1])
    area = np.bincount(label, minlength=count)
    far = np.full((2, count), max(mask.shape), np.intp)
    near = np.full((2, count), -1, np.intp)
    for axis, place in enumerate((x, y)):
        np.minimum.at(far[axis], label, place)
        np.maximum.at(near[axis], label, place)
    centre = [np.bincount(label, place, count) / np.maximum(area, 1) for place in (x, y)]
    regions = [
        Region(
            int(far[0, i]), int(far[1, i]),
            int(near[0, i] - far[0, i]) + 1, int(near[1, i] - far[1, i]) + 1,
            int(area[i]), float(centre[0][i]), float(centre[1][i]),
        )
        for i in range(1, count)
    ]  # fmt: skip
    return sorted(regions, key=lambda region: (-region.area, region.left, region.top))
