"""Foreground by OpenCV's MOG2 and the paper's true-blob test, for comparison.

Z. Zivkovic, "Improved adaptive Gaussian mixture model for background subtraction", ICPR 2004, eq. 1
and 2 of the paper: it selects the number of components by itself. Each frame is learned at once,
with confirmed people, moved ahead to it, kept out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Track, Tracks
from heel.schemas.base import Point
from heel.schemas.blobs import FOREGROUND, NONE, SHADOW
from heel.services.detector.background.evidence import (
    FrameDifference,
    Region,
    Seen,
    mark_moving,
    regions_of,
    smoothed,
    without_specks,
)
from heel.services.detector.feedback import shift_s
from heel.services.detector.settings import DetectorSettings
from heel.services.detector.work_size import WorkSize

_MOG2_SHADOW = 127
"""OpenCV's label of shadows; foreground is 255."""
_MOG2_FOREGROUND = 255
"""OpenCV's label of foreground."""
_SPOT_RADIUS = 0.3
"""Farthest the box of a standing person wanders, heights."""
_MAX_AHEAD_S = 1.0
"""Tracks are not moved ahead further than this: older feedback is a guess."""


@dataclass(frozen=True, slots=True)
class Mog2Numbers:
    """Sizes in working pixels; a size of 0 leaves its step out.

    Attributes:
        history_frames: memory of the background model; its learning rate falls to 1 by this.
        variance_threshold: squared Mahalanobis distance that makes a pixel foreground.
        darkest_shadow: share of the brightness of the background still called shadow.
        learning_frames: frames after a start during which the background is not believed.
        median_px: median filter over the pixel labels: 0, 3 or 5.
        shadow_fill_fraction: shadow between foreground above and below is a person again, up to
            this share of the frame height.
        open_px: width and height of the opening.
        close_px: width and height of the closing.
        min_box_area_fraction: true-blob test, box area over frame area.
        min_height_fraction: true-blob test, box height over frame height.
        min_fill: true-blob test, foreground pixels over box area.
        protect_margin: protected boxes grow by this share of their size on each side.
        protect_still_s: a track on one spot for longer is learned after all, seconds.
        tells_motion: whether MOVING is told from FOREGROUND.
    """

    history_frames: int = 500
    variance_threshold: float = 16.0
    darkest_shadow: float = 0.7
    learning_frames: int = 25
    median_px: int = 5
    shadow_fill_fraction: float = 0.04
    open_px: tuple[int, int] = (0, 0)
    close_px: tuple[int, int] = (3, 9)
    min_box_area_fraction: float = 0.0012
    min_height_fraction: float = 0.07
    min_fill: float = 0.2
    protect_margin: float = 0.15
    protect_still_s: float = 10.0
    tells_motion: bool = True


COMPOSITE = Mog2Numbers()
"""With people kept out of the background; chosen by hand."""

PAPER = Mog2Numbers(
    darkest_shadow=0.5,
    median_px=0,
    shadow_fill_fraction=0.0,
    open_px=(3, 3),
    close_px=(5, 5),
    min_box_area_fraction=0.01,
    min_height_fraction=0.0,
    min_fill=0.0,
    tells_motion=False,
)
"""As printed where the paper prints a number (eq. 3; full 768x576 frames); OpenCV's own defaults
for MOG2 where it does not."""


class Mog2Foreground:
    """MOG2 of one scene."""

    name = "mog2"

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        self._numbers = PAPER if settings.preset == "paper" else COMPOSITE
        self._size = size
        self._blur_px = settings.blur_px
        self._model = _Mog2(self._numbers)
        self._protection = Protection(
            size, self._numbers.protect_margin, self._numbers.protect_still_s
        )
        self._difference = FrameDifference()
        self._frames = 0

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame."""
        self._frames += 1
        learning = self._frames <= self._numbers.learning_frames
        protected, protected_seq = None, None
        if feedback is not None and not learning:
            protected = self._protection.mask(feedback, frame)
            protected_seq = feedback.seq
        smooth = smoothed(image, self._blur_px)
        labels = without_specks(self._model.classify(smooth, protected), self._numbers.median_px)
        regions = true_blobs(labels, self._size, self._numbers)
        if self._numbers.tells_motion:
            labels = mark_moving(labels, self._difference.update(smooth, frame.t_capture_ns))
        return Seen(labels, regions, learning, protected_seq)


class _Mog2:
    """MOG2 that can leave some pixels unlearned."""

    def __init__(self, numbers: Mog2Numbers) -> None:
        self._mixture = cv2.createBackgroundSubtractorMOG2(
            numbers.history_frames, numbers.variance_threshold, detectShadows=True
        )
        self._mixture.setShadowThreshold(numbers.darkest_shadow)
        self._mixture.setShadowValue(_MOG2_SHADOW)
        self._history_frames = numbers.history_frames
        self._frames = 0

    def classify(
        self, image: NDArray[np.uint8], protected: NDArray[np.bool_] | None
    ) -> NDArray[np.uint8]:
        """Label every pixel, (H, W) uint8 of NONE, SHADOW and FOREGROUND, and learn the frame.

        MOG2 takes one learning rate for the whole frame. So with protection the frame is labelled
        without learning, and what is learned is a composite in which the protected pixels show
        the model's own background.

        Args:
            image: (H, W, 3) uint8.
            protected: (H, W) bool, pixels that must not be learned; None for none.
        """
        # MOG2's own automatic rate, which counts every call and would count our two as two frames.
        self._frames += 1
        rate = 1.0 / min(2 * self._frames, self._history_frames)
        if self._frames == 1:
            # MOG2 calls its whole first frame foreground; there is nothing to compare it with.
            self._mixture.apply(image, learningRate=rate)
            return np.full(image.shape[:2], NONE, np.uint8)
        if protected is None or not protected.any():
            return _evidence(self._mixture.apply(image, learningRate=rate))
        labels = self._mixture.apply(image, learningRate=0.0)
        background = self._mixture.getBackgroundImage()
        composite = np.where(protected[..., None], background, image)
        self._mixture.apply(composite, learningRate=rate)
        return _evidence(labels)


def _evidence(labels: NDArray[Any]) -> NDArray[np.uint8]:
    evidence = np.full(labels.shape, NONE, np.uint8)
    evidence[labels == _MOG2_SHADOW] = SHADOW
    evidence[labels == _MOG2_FOREGROUND] = FOREGROUND
    return evidence


class Protection:
    """Protects people who move now and then from being learned.

    Unconfirmed tracks are never protected: a ghost, left where a person walked away, would become
    permanent. For the same reason protection ends for a track that never leaves its spot.
    """

    def __init__(self, size: WorkSize, margin: float, max_still_s: float) -> None:
        """Know nobody.

        Args:
            size: the working size.
            margin: growth of each box per side, share of its size.
            max_still_s: a track that stays on one spot for longer is no longer protected.
        """
        self._size = size
        self._margin = margin
        self._max_still_s = max_still_s
        self._spots: dict[int, tuple[Point, int]] = {}

    def mask(self, feedback: Tracks, frame: FrameId) -> NDArray[np.bool_]:
        """(size.height, size.width) bool, true where nothing of a frame may be learned."""
        mask = np.zeros((self._size.height, self._size.width), np.bool_)
        ahead_s = min(_MAX_AHEAD_S, max(0.0, shift_s(feedback, frame)))
        now_ns = frame.t_capture_ns
        self._spots = {track.id: self._spot(track, now_ns) for track in feedback.tracks}
        for track in feedback.tracks:
            still_s = (now_ns - self._spots[track.id][1]) / 1e9
            seen = track.shown and track.state in ("tracked", "occluded")
            if seen and still_s <= self._max_still_s:
                mask[self._covered(track, ahead_s)] = True
        return mask

    def _spot(self, track: Track, now_ns: int) -> tuple[Point, int]:
        """The spot the track stays on and since when, new when it has left the old one."""
        left, top, right, bottom = track.box_xyxy
        foot = ((left + right) / 2, bottom)
        spot, since_ns = self._spots.get(track.id, (foot, now_ns))
        left_it = math.dist(foot, spot) > _SPOT_RADIUS * (bottom - top)
        return (foot, now_ns) if left_it else (spot, since_ns)

    def _covered(self, track: Track, ahead_s: float) -> tuple[slice, slice]:
        """Rows and columns under a box with its margin, moved ahead by its velocity."""
        size, margin = self._size, self._margin
        left, top, right, bottom = track.box_xyxy
        shift_x, shift_y = (ahead_s * speed for speed in track.velocity_pxps)
        across, down = margin * (right - left), margin * (bottom - top)
        columns = np.array([left + shift_x - across, right + shift_x + across]) / size.scale_x
        rows = np.array([top + shift_y - down, bottom + shift_y + down]) / size.scale_y
        columns, rows = np.clip(columns, 0, size.width), np.clip(rows, 0, size.height)
        return (
            slice(int(rows[0]), int(np.ceil(rows[1]))),
            slice(int(columns[0]), int(np.ceil(columns[1]))),
        )


def true_blobs(labels: NDArray[np.uint8], size: WorkSize, numbers: Mog2Numbers) -> list[Region]:
    """Regions of foreground that pass the true-blob test, largest first.

    Args:
        labels: (H, W) uint8 of NONE, SHADOW and FOREGROUND; shadow counts as nothing.
        size: the working size of the frame.
        numbers: kernels and thresholds.
    """
    mask = _cleaned(_person_pixels(labels, numbers.shadow_fill_fraction), numbers)
    return [region for region in regions_of(mask) if _is_true_blob(region, size, numbers)]


def _person_pixels(labels: NDArray[np.uint8], fill_fraction: float) -> NDArray[np.uint8]:
    """Foreground, and shadow that has foreground both above and below it; (H, W) of 0 and 1.

    Dark clothes look like shadow to MOG2, but a cast shadow has no person below it.
    """
    foreground = np.asarray(labels == FOREGROUND, np.uint8)
    gap = round(fill_fraction * labels.shape[0])
    if gap < 1:
        return foreground
    kernel = np.ones((2 * (gap // 2) + 1, 1), np.uint8)
    bridged = cv2.morphologyEx(foreground, cv2.MORPH_CLOSE, kernel)
    return np.where((bridged > 0) & (labels == SHADOW), np.uint8(1), foreground)


def _cleaned(mask: NDArray[np.uint8], numbers: Mog2Numbers) -> NDArray[np.uint8]:
    for operation, kernel_px in (
        (cv2.MORPH_OPEN, numbers.open_px),
        (cv2.MORPH_CLOSE, numbers.close_px),
    ):
        if all(kernel_px):
            kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, kernel_px)
            mask = np.asarray(cv2.morphologyEx(mask, operation, kernel), np.uint8)
    return mask


def _is_true_blob(region: Region, size: WorkSize, numbers: Mog2Numbers) -> bool:
    """The paper's test, eq. 3 (box area above R * C / 100), with relative numbers.

    A share of the frame is the same at working size and at full size.
    """
    box_area = region.width * region.height
    return (
        box_area > numbers.min_box_area_fraction * size.width * size.height
        and region.height >= numbers.min_height_fraction * size.height
        and region.area >= numbers.min_fill * box_area
    )
