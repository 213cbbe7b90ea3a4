"""What moves about somebody's box otherwise than what is behind it, while the camera only turns.

Dense flow (T. Kroeger and others, "Fast optical flow using dense inverse search", ECCV 2016)
between two pictures, less that of the ground and walls on either side of the body.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.camera_motion import Homography, estimate_turn
from heel.services.detector.pointed.silhouette import ASPECT, reach

_HEIGHT = 72
"""Of a body as it is looked at, pixels; below, lengths are heights of the body."""
_ASIDE, _ABOVE, _BELOW = 0.8, 0.25, 0.25
"""What is looked at around the box."""
_BODY_MARGIN = 0.02
_CORE, _MIDDLE, _BESIDE = 0.5, 0.22, 0.3
"""From the axis of the body: where movement counts, where it is the body's, and where it is not."""
_APART_S, _FORGET_S = 0.24, 0.55
"""Between the two pictures: time for a walker to move by a tenth of their height."""
_TEXTURE = 4.0
"""Least mean gradient of a pixel whose flow can be told, grey levels a pixel."""
_BORDER_PX = 9
_LEAST_IN_PICTURE = 0.5
_LEAST_BODY_PX, _LEAST_BESIDE_PX = 40, 80
_LEAST_SIDE = 0.5
"""Share of what is on either side that has to be in the picture: from one side alone nobody can
tell how the background on the other flows."""
_LEAST_SIDE_PX, _ONE_SIDED = 40, 2.5
"""Pixels with texture on a side below which more movement, by this factor, has to be seen."""
_MOVES_PX, _SIGMAS, _FINEST_PX = 0.9, 3.0, 0.15
_FIT_ROUNDS, _FIT_SIGMAS = 6, 1.5
_LARGEST_ZOOM = 0.02
"""A camera that turns sees nothing grow."""
_ZOOM_STEP_PX = 20.0

Mask = NDArray[np.bool_]
Grey = NDArray[np.uint8]
Floats = NDArray[np.float64]


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
    rows, columns = round((1 + _ABOVE + _BELOW) * _HEIGHT), round(2 * _ASIDE * _HEIGHT)
    down = (np.arange(rows) + 0.5) / _HEIGHT - _ABOVE
    aside = (np.arange(columns) + 0.5) / _HEIGHT - _ASIDE
    return down[:, None], aside[None, :]


_DOWN, _ACROSS = _grids()
_IS_BODY: Mask = np.abs(_ACROSS) < ASPECT * reach(_DOWN) + _BODY_MARGIN
_IS_BESIDE: Mask = (np.abs(_ACROSS) > _BESIDE) | (_DOWN < -0.08) | (_DOWN > 1.06)
_SIDES: tuple[Mask, Mask] = (
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
            self._carry(grey, free, t_s)
        then = next((past for past in reversed(self._past) if t_s - past.t_s >= _APART_S), None)
        movement = None
        if then is not None and abs(_zoom(then.back, grey.shape) - 1.0) < _LARGEST_ZOOM:
            movement = self._movement(then, grey, box)
        self._past.append(_Past(t_s, grey, box, np.eye(3)))
        return movement

    def _carry(self, grey: Grey, free: Grey, t_s: float) -> None:
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
            body_step=-float(np.median(own[body][:, 0])) / _HEIGHT,
            box_step=(was[0] - 0.5 * (then.box[0] + then.box[2])) / height,
        )


def _around(grey: Grey, box: BoxXyxy, from_now: Homography) -> tuple[Grey, Mask]:
    """A box and what is around it, cut out of a picture, and where that shows the picture."""
    height, x = box[3] - box[1], 0.5 * (box[0] + box[2])
    pixel = height / _HEIGHT
    left, top = x - _ASIDE * height, box[1] - _ABOVE * height
    # Pixel centres: the matrix maps corners of pixels.
    cut = np.array([[pixel, 0.0, left + 0.5 * pixel - 0.5],
                    [0.0, pixel, top + 0.5 * pixel - 0.5], [0.0, 0.0, 1.0]])  # fmt: skip
    size = (_ACROSS.shape[1], _DOWN.shape[0])
    # Whoever is larger is averaged first: pixels left out look like movement when they change.
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
