"""How the camera moves, from corners that people do not cover; whether it stands.

Corners (J. Shi, C. Tomasi, "Good features to track", CVPR 1994), pyramidal Lucas-Kanade flow
(J.-Y. Bouguet 2000), and the similarity that most of them agree with (RANSAC, M. Fischler,
R. Bolles 1981). A homography follows the picture no better and goes wrong by more.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy, Point
from heel.services.geometry import boxes

Affine = NDArray[np.float64]
"""(2, 3) matrix that maps pixels of an older frame to pixels of a newer one."""

Homography = NDArray[np.float64]
"""(3, 3) matrix that maps pixels of an older frame to pixels of a newer one."""

_MOST_CORNERS = 250
"""Corners that are tracked: more take longer and say the same."""
_CORNER_QUALITY = 0.01
"""Least strength of a corner, share of the strongest."""
_CORNER_SPACING_PX = 8
"""Least distance between corners, so that they lie all over the picture."""
_WINDOW_PX = 15
"""Side of the patch that is followed."""
_PYRAMID_LEVELS = 4
"""Levels of the image pyramid: motion of up to about 100 pixels is found."""
_INLIER_PX = 1.0
"""A corner that lands nearer than this to where the motion puts it agrees."""
_STILL_PX = 0.3
"""A corner that moves less stays where it is: flow is that precise."""
_LEAST_CORNERS = 12
"""With fewer corners nothing is said; chosen by hand."""
_LEAST_SHARE = 0.3
"""Of the corners that have to agree; chosen by hand."""
_LEAST_TURN_SHARE = 0.5
"""The same for a homography, which has twice as many degrees of freedom."""
_LEAST_SPREAD = (0.35, 0.2)
"""Share of the picture's width and height that corners have to span."""
_LARGEST_ZOOM = 1.3
"""From frame to frame; beyond, the estimate is wrong."""
_PASSED_OVER = 5
"""Frames that cannot be placed before the estimate starts anew."""
_PATH_FRAMES = 64
"""How far back the path of the camera goes: tracks are rarely older than a few frames."""
_REDUCTION = 2
"""Factor by which pictures are reduced before the motion of a standing camera is looked for."""
_MOVED_PX = 0.8
"""Root mean square shift of the picture's corners that a standing camera never has, working px."""
_STILL_SHARE = 0.2
"""When the camera moves, fewer corners than this stay where they were: those near its axis."""
_ANCHOR_S = 1.0  # Age of the oldest frame that is compared: a slow pan is seen, too
_STANDING_S = 1.5  # A camera that has not moved for so long stands; chosen by hand
_STOOD_PX = 0.5  # Shift of the corners of a camera that stands, working pixels; below `_MOVED_PX`
_REST_FRAMES = 512  # Bound of the path that is remembered: more than `_STANDING_S` holds


@dataclass(frozen=True)
class MotionEstimate:
    """Motion since the frame before, working pixels.

    Attributes:
        affine: old to new pixels; the identity where nothing can be said.
        quality: share of the corners that agree with it, 0 where nothing can be said.
        still: share of the corners that have not moved in the picture.
    """

    affine: Affine
    quality: float
    still: float = 0.0

    @property
    def is_known(self) -> bool:
        """Whether the estimate may be used."""
        return self.quality > 0.0

    def shift_px(self, width: int, height: int) -> float:
        """How far the picture's corners move, root mean square."""
        corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1]], float)
        moved = corners @ self.affine.T - corners[:, :2]
        return float(np.sqrt((moved**2).sum(axis=1).mean()))


def _no_motion() -> MotionEstimate:
    """The identity, of which nothing is known."""
    return MotionEstimate(np.eye(2, 3), 0.0)


def compose(later: Affine, earlier: Affine) -> Affine:
    """The affine that does `earlier`, then `later`."""
    whole = np.vstack([earlier, [0.0, 0.0, 1.0]])
    return np.asarray(later @ whole)


def moved_points(affine: Affine, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) points through the affine."""
    return np.asarray(points @ affine[:, :2].T + affine[:, 2])


def moved_point(affine: Affine, point: Point) -> Point:
    """One point through the affine."""
    x, y = moved_points(affine, np.array([point]))[0].tolist()
    return x, y


def moved_box(box: BoxXyxy, affine: Affine) -> BoxXyxy:
    """An upright box through the affine: its centre moves, its size changes with the zoom."""
    zoom = float(np.sqrt(abs(np.linalg.det(affine[:, :2]))))
    centre = moved_point(affine, boxes.centre(box))
    return boxes.around(centre, zoom * boxes.width(box), zoom * boxes.height(box))


class CameraPath:
    """Where the camera has looked of late: the motion between any recent frame and the newest."""

    def __init__(self) -> None:
        self._steps: deque[tuple[int, Affine]] = deque(maxlen=_PATH_FRAMES)

    def add(self, seq: int, step: Affine) -> None:
        """The camera moved by `step` to get to frame `seq`."""
        self._steps.append((seq, step))

    def since(self, seq: int) -> Affine | None:
        """Motion from frame `seq` to the newest; None if that is too long ago.

        Before the first frame the camera stood still. A frame that could not be placed counts as
        the last one that could: a tracker that is told of no motion leaves its tracks there, and
        the next step begins there, see `EgoMotion`.
        """
        if len(self._steps) == _PATH_FRAMES and seq < self._steps[0][0]:
            return None
        total: Affine = np.eye(2, 3)
        for frame, step in self._steps:
            if frame > seq:
                total = compose(step, total)
        return total


class EgoMotion:
    """Estimates the motion from frame to frame.

    A frame to which the motion cannot be told, blurred say, is passed over: the next estimate is
    since the last frame that could be placed. After several such frames it starts anew.
    """

    def __init__(self) -> None:
        self._before: NDArray[np.uint8] | None = None
        self._passed_over = 0

    def update(self, grey: NDArray[np.uint8], free: NDArray[np.uint8]) -> MotionEstimate:
        """Motion since the last frame that could be placed.

        Args:
            grey: (H, W) uint8; kept, so it must not be written to afterwards.
            free: (H, W) uint8 in the frame before: 0 where people are, else 255.
        """
        motion = _no_motion()
        if self._before is not None and self._before.shape == grey.shape:
            motion = estimate_motion(self._before, grey, free)
        self._passed_over = 0 if motion.is_known else self._passed_over + 1
        if motion.is_known or self._before is None or self._passed_over > _PASSED_OVER:
            self._before, self._passed_over = grey, 0
        return motion


def estimate_motion(
    before: NDArray[np.uint8], now: NDArray[np.uint8], free: NDArray[np.uint8]
) -> MotionEstimate:
    """Motion from one (H, W) uint8 picture to another; `free` as `EgoMotion.update`."""
    tracked = _tracked_corners(before, now, free)
    if tracked is None:
        return _no_motion()
    corners, found, looked_at = tracked
    affine, inliers = cv2.estimateAffinePartial2D(
        corners, found, method=cv2.RANSAC, ransacReprojThreshold=_INLIER_PX
    )
    if affine is None:
        return _no_motion()
    share = float(np.count_nonzero(inliers)) / looked_at
    zoom = float(np.hypot(affine[0, 0], affine[1, 0]))
    agreeing = corners[np.asarray(inliers).ravel() == 1].reshape(-1, 2)
    plausible = 1.0 / _LARGEST_ZOOM < zoom < _LARGEST_ZOOM and _is_spread(agreeing, now)
    if share < _LEAST_SHARE or not plausible:
        return _no_motion()
    flow = (found - corners).reshape(-1, 2)
    still = float(np.count_nonzero((flow**2).sum(axis=1) < _STILL_PX**2)) / looked_at
    return MotionEstimate(np.asarray(affine, np.float64), min(share, 1.0), still)


def estimate_turn(
    before: NDArray[np.uint8], now: NDArray[np.uint8], free: NDArray[np.uint8]
) -> Homography | None:
    """How a camera that turned, but did not drive, sees the points of another picture.

    Turning maps points at any distance by one homography (R. Hartley, A. Zisserman, "Multiple view
    geometry", 2004, section 8.4); driving does not, where they are at several.

    Args:
        before, now: (H, W) uint8.
        free: as `EgoMotion.update`.

    Returns:
        (3, 3) old to new pixels; None where too few corners agree with any.
    """
    tracked = _tracked_corners(before, now, free)
    if tracked is None:
        return None
    corners, found, looked_at = tracked
    homography, inliers = cv2.findHomography(corners, found, cv2.RANSAC, _INLIER_PX)
    if homography is None or np.count_nonzero(inliers) < _LEAST_TURN_SHARE * looked_at:
        return None
    return np.asarray(homography, np.float64)


def _tracked_corners(
    before: NDArray[np.uint8], now: NDArray[np.uint8], free: NDArray[np.uint8]
) -> tuple[NDArray[np.float32], NDArray[np.float32], int] | None:
    """(N, 1, 2) corners of the picture before, where each is now, and how many were looked for."""
    corners = cv2.goodFeaturesToTrack(
        before, _MOST_CORNERS, _CORNER_QUALITY, _CORNER_SPACING_PX, mask=free
    )
    if corners is None or len(corners) < _LEAST_CORNERS:
        return None
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        before, now, corners, np.zeros_like(corners), winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=_PYRAMID_LEVELS,
    )  # fmt: skip
    tracked = np.asarray(status).ravel() == 1
    if np.count_nonzero(tracked) < _LEAST_CORNERS:
        return None
    return (
        np.asarray(corners[tracked], np.float32), np.asarray(found[tracked], np.float32),
        len(corners),
    )  # fmt: skip


def _is_spread(corners: NDArray[np.float32], picture: NDArray[np.uint8]) -> bool:
    """Whether corners lie about the picture: those on one person say nothing of the camera."""
    low, high = np.percentile(corners, [5, 95], axis=0)
    share = (high - low) / (picture.shape[1], picture.shape[0])
    return bool((share > _LEAST_SPREAD).all())


@dataclass(frozen=True, slots=True, eq=False)
class _Anchor:
    grey: NDArray[np.uint8]
    free: NDArray[np.uint8]
    t_ns: int


class StandingWatch:
    """Says when a standing camera has moved: compares each frame with one up to a second old."""

    def __init__(self) -> None:
        self._anchor: _Anchor | None = None

    def update(
        self, grey: NDArray[np.uint8], free: NDArray[np.uint8], t_ns: int
    ) -> MotionEstimate | None:
        """Motion since the anchor where the camera has moved, else None.

        Args:
            grey: (H, W) uint8, this frame.
            free: (H, W) uint8, 0 where people are, else 255.
            t_ns: time of the frame.
        """
        small = _reduced(grey)
        anchor = self._anchor
        if anchor is None or t_ns - anchor.t_ns > _ANCHOR_S * 1e9 or t_ns < anchor.t_ns:
            self._anchor = _Anchor(small, _reduced(free), t_ns)
        if anchor is None:
            return None
        motion = estimate_motion(anchor.grey, small, anchor.free)
        affine = motion.affine.copy()
        affine[:, 2] *= _REDUCTION
        since = MotionEstimate(affine, motion.quality)
        rows, columns = grey.shape
        moved = since.is_known and since.shift_px(columns, rows) > _MOVED_PX
        return since if moved and motion.still < _STILL_SHARE else None


class RestWatch:
    """Says when a camera that moved has come to rest."""

    def __init__(self, columns: int, rows: int) -> None:
        self._size = (columns, rows)
        self._past: deque[tuple[int, Affine]] = deque(maxlen=_REST_FRAMES)
        self._total: Affine = np.eye(2, 3)

    def update(self, motion: MotionEstimate, t_ns: int) -> bool:
        """Whether the camera has not moved for `_STANDING_S`."""
        if not motion.is_known:
            self._past.clear()
            return False
        self._total = compose(motion.affine, self._total)
        self._past.append((t_ns, self._total))
        while len(self._past) > 1 and t_ns - self._past[1][0] >= _STANDING_S * 1e9:
            self._past.popleft()
        if t_ns - self._past[0][0] < _STANDING_S * 1e9:
            return False
        return all(self._shift_px(then) < _STOOD_PX for _, then in self._past)

    def _shift_px(self, then: Affine) -> float:
        back = np.asarray(cv2.invertAffineTransform(then), np.float64)
        return MotionEstimate(compose(self._total, back), 1.0).shift_px(*self._size)


def _reduced(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(image[::_REDUCTION, ::_REDUCTION])
