"""Whether a place that was pointed at is a person: told by what moves there, and how.

What moves about a box otherwise than what is behind it, while the camera only turns, is told by
dense flow (T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016) between
two pictures, less that of the ground and walls on either side of the body.

Lengths are heights of the body, unless they say otherwise.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.silhouette import ASPECT, reach
from heel.services.geometry.picture_motion import Homography, estimate_turn

_QUIET_PX = 100  # fewer pixels than this that move are nobody; chosen by hand
_OFF_AXIS = 0.15
"""Farther from the axis of the body than this, on average, is not a walk; chosen by hand."""
_LEAST_INSIDE = 0.55  # share of the movement on the body; chosen by hand
_MOST_BESIDE = 0.5  # share of what is on one side that may move as well; chosen by hand
_LEGS = 0.72  # a walk moves the legs: so far down movement reaches, from head (0) to foot (1)
_HEAD = 0.35  # and so far up: something smaller within a larger box is not what the box is about
_FROM_ASIDE = 0.28  # movement that begins so far off the axis comes in from a side
_OUTSIDE = 0.3  # and so does movement with so little of it on the body
_PASSES = 0.08  # pixels that go so far
_ALONG = 0.3  # ... while the box goes less than this share of it, pass by
_SLIDES = 0.03  # a box that goes so far while its pixels do not go the same way slides over a wall
_NEEDED_S = 0.35  # how long a person has to walk; chosen by hand
_NEEDED_AFTER_OTHERS_S = 1.2
"""Longer, where it began from aside: a person that passes by at 1 m/s is before a body for half a
second."""
_QUIET_S = 0.3
"""Nothing has to move for so long before movement from aside is forgotten; chosen by hand."""
_LONGEST_STEP_S = 0.2  # for so long at most does one frame stand

_BODY_PX = 72  # of a body as it is looked at, pixels
_ASIDE = 0.8  # looked at to either side of the axis
_ABOVE = 0.25  # looked at above the head
_BELOW = 0.25  # looked at below the feet
_BODY_MARGIN = 0.02  # beyond the silhouette that is still body
_CORE = 0.5  # from the axis of the body: where movement counts
_MIDDLE = 0.22  # from the axis: where it is the body's
_BESIDE = 0.3  # from the axis: where it is not
_APART_S = 0.24  # between the two pictures: time for a walker to move by a tenth of the body height
_FORGET_S = 0.55  # older pictures are not compared: the turn since is known too badly
_TEXTURE = 4.0  # least mean gradient of a pixel whose flow can be told, grey levels a pixel
_BORDER_PX = 9  # patches of the flow reach so far
_LEAST_IN_PICTURE = 0.5  # share of the body in the picture
_LEAST_BODY_PX = 40  # pixels with texture on the body; chosen by hand
_LEAST_BESIDE_PX = 80  # pixels with texture beside it; chosen by hand
_LEAST_SIDE = 0.5
"""Share of what is on either side that has to be in the picture: one side alone does not tell how
the background on the other flows."""
_LEAST_SIDE_PX = 40  # pixels with texture on a side, below which more movement has to be seen
_ONE_SIDED = 2.5  # ... by this factor; chosen by hand
_MOVES_PX = 0.9  # least movement, view pixels; chosen by hand
_SIGMAS = 3.0  # least movement, in the scatter of the background
_FINEST_PX = 0.15  # least scatter: flow is no finer, view pixels
_FIT_ROUNDS = 6  # of the robust fit; more change nothing
_FIT_SIGMAS = 1.5  # scatter beyond which a pixel counts less
_LARGEST_ZOOM = 0.02  # a camera that turns sees nothing grow
_ZOOM_STEP_PX = 20.0  # distance over which growth is measured, pixels

Mask = NDArray[np.bool_]
Grey = NDArray[np.uint8]
Floats = NDArray[np.float64]


class Proof:
    """Gathers evidence of one person, frame by frame.

    A person that stands and then walks begins to move in the middle of the box; one that merely
    passes by comes in from a side. After movement that began so, more is needed until all is quiet.
    """

    def __init__(self) -> None:
        self._watch = MovementWatch()
        self._walked_s = 0.0
        self._quiet_s = _QUIET_S
        self._began = self._from_aside = False
        self._last_s: float | None = None

    @property
    def proves(self) -> bool:
        """Whether it suffices to drive after the person."""
        needed_s = _NEEDED_AFTER_OTHERS_S if self._from_aside else _NEEDED_S
        return self._walked_s >= needed_s

    def look(
        self, grey: NDArray[np.uint8], box: BoxXyxy, free: NDArray[np.uint8], t_s: float
    ) -> None:
        """Take in a frame; arguments as `MovementWatch.look`."""
        dt_s = 0.0 if self._last_s is None else min(max(0.0, t_s - self._last_s), _LONGEST_STEP_S)
        self._last_s = t_s
        movement = self._watch.look(grey, box, free, t_s)
        if movement is None or self.proves:
            return
        if movement.pixels < _QUIET_PX:
            self._quiet_s += dt_s
            self._walked_s = max(0.0, self._walked_s - 0.5 * dt_s)
            self._began = self._began and self._walked_s > 0.0
            if self._from_aside and self._quiet_s >= _QUIET_S:
                self._from_aside, self._walked_s = False, 0.0
            return
        self._quiet_s = 0.0
        if not _walks(movement, (grey.shape[0] - box[1]) / (box[3] - box[1])):
            comes_in = abs(movement.aside) > _FROM_ASIDE or movement.inside < _OUTSIDE
            self._from_aside = self._from_aside or (comes_in and not self._began)
            self._walked_s = max(0.0, self._walked_s - 0.5 * dt_s)
        else:
            self._began = True
            self._walked_s += dt_s


def _walks(movement: Movement, visible: float) -> bool:
    """Whether it is the person in the box that moves, from the legs up.

    Args:
        movement: about the box.
        visible: part of the body, from the head on, above the picture's lower border.
    """
    step = movement.body_step
    passes_by = abs(step) > _PASSES and movement.box_step * step < _ALONG * step * step
    slides = abs(movement.box_step) > _SLIDES and movement.box_step * step <= 0.0
    return (
        abs(movement.aside) < _OFF_AXIS
        and movement.inside > _LEAST_INSIDE
        and movement.beside < _MOST_BESIDE
        and movement.highest < _HEAD
        and movement.lowest > _LEGS * min(visible, 1.0)
        and not passes_by
        and not slides
    )


@dataclass(frozen=True, slots=True)
class Movement:
    """What has moved against its background within a quarter of a second.

    Attributes:
        pixels: how many, of a body 72 pixels high; at most about 2,000.
        aside: their mean place, heights to the right of the body's axis.
        inside: share of them on the body.
        highest, lowest: nearly the highest and lowest of them, from head (0) to foot (1).
        body: share of the body that moves.
        beside: the larger share of what is on its left or its right.
        body_step, box_step: how far the body's pixels and its box have gone to the right, heights.
    """

    pixels: int
    aside: float
    inside: float
    highest: float
    lowest: float
    body: float
    beside: float
    body_step: float
    box_step: float


@dataclass(frozen=True, slots=True, eq=False)
class _Past:
    t_s: float
    grey: Grey
    box: BoxXyxy
    back: Homography
    """From pixels of now to its own."""


def _grids() -> tuple[Floats, Floats]:
    """Where the pixels looked at lie: (H, 1) down from head to foot, (1, W) aside of the axis."""
    rows, columns = round((1 + _ABOVE + _BELOW) * _BODY_PX), round(2 * _ASIDE * _BODY_PX)
    down = (np.arange(rows) + 0.5) / _BODY_PX - _ABOVE
    aside = (np.arange(columns) + 0.5) / _BODY_PX - _ASIDE
    return down[:, None], aside[None, :]


_DOWN, _ACROSS = _grids()
_IS_BODY: Mask = np.abs(_ACROSS) < ASPECT * reach(_DOWN) + _BODY_MARGIN
_IS_BESIDE: Mask = (np.abs(_ACROSS) > _BESIDE) | (_DOWN < -0.08) | (_DOWN > 1.06)
"""Above the head and below the feet as well, with a margin that is chosen by hand."""
_SIDES: tuple[Mask, Mask] = (  # left and right of the body, from head (0) to foot (1)
    (_ACROSS < -_BESIDE) & (_DOWN > 0.0) & (_DOWN < 1.0),
    (_ACROSS > _BESIDE) & (_DOWN > 0.0) & (_DOWN < 1.0),
)


class MovementWatch:
    """Compares each picture with one a quarter of a second older."""

    def __init__(self) -> None:
        self._past: deque[_Past] = deque()
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        # Legs are a few pixels wide: at a coarser scale they flow as the floor beside them does.
        self._flow.setFinestScale(0)

    def look(self, grey: Grey, box: BoxXyxy, free: Grey, t_s: float) -> Movement | None:
        """What moves about a box; None where that cannot be told.

        Args:
            grey: (H, W) uint8; kept, not to be written to afterwards.
            box: of the body, pixels.
            free: (H, W) uint8 in the frame before: 0 where the body is, else 255.
            t_s: time of the frame.
        """
        if self._past:
            self._warp(grey, free, t_s)
        then = next((past for past in reversed(self._past) if t_s - past.t_s >= _APART_S), None)
        movement = None
        if then is not None and abs(_zoom(then.back, grey.shape) - 1.0) < _LARGEST_ZOOM:
            movement = self._movement(then, grey, box)
        self._past.append(_Past(t_s, grey, box, np.eye(3)))
        return movement

    def _warp(self, grey: Grey, free: Grey, t_s: float) -> None:
        """Let what was seen before be found from this picture."""
        before = self._past[-1].grey
        turn = estimate_turn(before, grey, free) if before.shape == grey.shape else None
        if turn is None:
            self._past.clear()
            return
        back = np.linalg.inv(turn)
        self._past = deque(
            _Past(past.t_s, past.grey, past.box, past.back @ back)
            for past in self._past
            if 0.0 < t_s - past.t_s <= _FORGET_S
        )

    def _movement(self, then: _Past, grey: Grey, box: BoxXyxy) -> Movement | None:
        before, told_before = _around(then.grey, box, then.back)
        now, told_now = _around(grey, box, np.eye(3))
        flow = np.asarray(self._flow.calc(now, before, None), np.float64)  # type: ignore[call-overload]
        told = told_before & told_now
        if np.count_nonzero(told & _IS_BODY) < _LEAST_IN_PICTURE * np.count_nonzero(_IS_BODY):
            return None
        if any(told[side].mean() < _LEAST_SIDE for side in _SIDES):
            return None
        told &= _textured(now)
        body, beside = _IS_BODY & told, _IS_BESIDE & told
        if body.sum() < _LEAST_BODY_PX or beside.sum() < _LEAST_BESIDE_PX:
            return None
        background, spread = _plane(flow, beside)
        own = flow - background
        least_px = max(_MOVES_PX, _SIGMAS * spread)
        if any(np.count_nonzero(told & side) < _LEAST_SIDE_PX for side in _SIDES):
            least_px *= _ONE_SIDED
        moves = np.hypot(own[..., 0], own[..., 1]) > least_px
        core = moves & told & (np.abs(_ACROSS) < _CORE)
        rows, columns = np.nonzero(core)
        height = box[3] - box[1]
        was = _mapped(then.back, 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        return Movement(
            pixels=len(rows),
            aside=float(_ACROSS[0, columns].mean()) if len(rows) else 0.0,
            inside=float((np.abs(_ACROSS[0, columns]) < _MIDDLE).mean()) if len(rows) else 0.0,
            highest=float(np.percentile(_DOWN[rows, 0], 5)) if len(rows) else 0.0,
            lowest=float(np.percentile(_DOWN[rows, 0], 95)) if len(rows) else 0.0,
            body=_share(moves, body),
            beside=max(_share(moves, beside & side) for side in (_ACROSS < 0, _ACROSS > 0)),
            body_step=-float(np.median(own[body][:, 0])) / _BODY_PX,
            box_step=(was[0] - 0.5 * (then.box[0] + then.box[2])) / height,
        )


def _around(grey: Grey, box: BoxXyxy, from_now: Homography) -> tuple[Grey, Mask]:
    """A box and what is around it, cut out of a picture, and where that shows the picture."""
    height, x = box[3] - box[1], 0.5 * (box[0] + box[2])
    pixel = height / _BODY_PX
    left, top = x - _ASIDE * height, box[1] - _ABOVE * height
    # Pixel centres: the matrix maps corners of pixels.
    cut = np.array([[pixel, 0.0, left + 0.5 * pixel - 0.5],
                    [0.0, pixel, top + 0.5 * pixel - 0.5], [0.0, 0.0, 1.0]])  # fmt: skip
    size = (_ACROSS.shape[1], _DOWN.shape[0])
    # A larger body is averaged first: pixels left out look like movement when they change.
    small, shrink = _averaged(grey, max(1, int(pixel)))
    matrix, inverse = shrink @ from_now @ cut, cv2.WARP_INVERSE_MAP
    part = cv2.warpPerspective(
        small, matrix, size, flags=cv2.INTER_LINEAR | inverse, borderMode=cv2.BORDER_REPLICATE
    )
    all_of_it = np.full(small.shape, 255, np.uint8)
    told = cv2.warpPerspective(all_of_it, matrix, size, flags=cv2.INTER_NEAREST | inverse)
    # Patches of the flow that reach over the border find there what the border repeats.
    told = cv2.erode(told, np.ones((_BORDER_PX, _BORDER_PX)), borderValue=255)
    return np.asarray(part, np.uint8), np.asarray(told) > 0


def _averaged(grey: Grey, factor: int) -> tuple[Grey, Homography]:
    """A picture smaller by a whole factor, and how its pixels come from those of the picture."""
    if factor == 1:
        return grey, np.eye(3)
    columns, rows = grey.shape[1] // factor, grey.shape[0] // factor
    cut = np.ascontiguousarray(grey[: rows * factor, : columns * factor])
    small = cv2.resize(cut, (columns, rows), interpolation=cv2.INTER_AREA)
    shift = 0.5 / factor - 0.5
    shrink = np.array([[1 / factor, 0.0, shift], [0.0, 1 / factor, shift], [0.0, 0.0, 1.0]])
    return np.asarray(small, np.uint8), shrink


def _textured(view: Grey) -> Mask:
    across = cv2.Sobel(view, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(view, cv2.CV_32F, 0, 1, scale=0.125)
    return np.asarray(cv2.blur(np.hypot(across, down), (3, 3))) > _TEXTURE


def _plane(flow: Floats, where: Mask) -> tuple[Floats, float]:
    """(H, W, 2) flow of the background, linear in the place, and the scatter about it, pixels.

    Iteratively reweighted least squares (P. Huber, "Robust statistics", 1981) with weights that
    fall off as Geman and McClure's.
    """
    rows, columns = np.nonzero(where)
    at = np.stack([np.ones(len(rows)), _ACROSS[0, columns], _DOWN[rows, 0]], axis=1)
    told = flow[rows, columns]
    weights = np.ones(len(rows))
    for _ in range(_FIT_ROUNDS):
        weighted = at * weights[:, None]
        fit = np.linalg.solve(weighted.T @ at + 1e-3 * np.eye(3), weighted.T @ told)
        off = np.hypot(*(told - at @ fit).T)
        spread = max(_FINEST_PX, 1.4826 * float(np.median(off)))
        weights = 1.0 / (1.0 + (off / (_FIT_SIGMAS * spread)) ** 2) ** 2
    background = fit[0] + _ACROSS[..., None] * fit[1] + _DOWN[..., None] * fit[2]
    return np.asarray(background), spread


def _share(moves: Mask, where: Mask) -> float:
    count = np.count_nonzero(where)
    return float(np.count_nonzero(moves & where)) / count if count else 0.0


def _mapped(matrix: Homography, x: float, y: float) -> Floats:
    mapped = matrix @ np.array([x, y, 1.0])
    return np.asarray(mapped[:2] / mapped[2])


def _zoom(matrix: Homography, shape: tuple[int, ...]) -> float:
    """By how much what is in the middle of the picture has grown, or shrunk."""
    x, y, step = 0.5 * shape[1], 0.5 * shape[0], _ZOOM_STEP_PX
    across = _mapped(matrix, x + step, y) - _mapped(matrix, x - step, y)
    down = _mapped(matrix, x, y + step) - _mapped(matrix, x, y - step)
    return float(np.sqrt(abs(across[0] * down[1] - across[1] * down[0]))) / (2.0 * step)
