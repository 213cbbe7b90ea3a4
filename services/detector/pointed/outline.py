"""Where a person ends, to the pixel, from about where they are.

GrabCut (C. Rother, V. Kolmogorov, A. Blake, SIGGRAPH 2004) that begins with a standing person's
silhouette: its middle is sure to be body, what is far from it sure to be none.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.silhouette import ASPECT, reach
from heel.services.detector.pointed.view import scaled_part

HEIGHT = 72
"""Of the person, as looked at, pixels."""
_ASIDE, _ABOVE, _BELOW = 0.7, 0.5, 0.35
"""What is looked at around the person, heights."""
_MAYBE_ASIDE, _MAYBE_ABOVE, _MAYBE_BELOW = 0.3, 0.32, 0.22
"""Farther from the middle than this is sure not to be them."""
_ROUNDS = 4
_TRUNK, _LEGS = ((0.1, 0.6), 0.05), ((0.5, 0.93), (0.025, 0.075))
_HEAD = ((-0.2, 0.05), 0.06)
_MIDDLE, _LEAST_WIDTH = 0.2, 0.055
"""Part of the outline that tells head and feet, and how wide it has to be there, heights."""
_FLOOR, _SHADOW_WIDTH, _IN_SHADOW = 0.8, 1.8, 0.05
"""Below this part of the body, wider than so many bodies is a shadow on the floor."""


def outline_box(image: NDArray[np.uint8], box: BoxXyxy) -> BoxXyxy:
    """The box of the person whose box is about this one.

    Args:
        image: (H, W, 3) uint8 BGR.
        box: off by up to a sixth of the height, pixels.
    """
    body, scale, left, top = _cut_out(image, box)
    rows = np.flatnonzero(_widths(body, _MIDDLE) >= _LEAST_WIDTH * HEIGHT)
    if not rows.size:
        return box
    first, last = float(rows[0]), _above_shadow(body, int(rows[0]), int(rows[-1]) + 1)
    columns = np.nonzero(body[int(first) : int(first + 0.6 * (last - first))])[1]
    x = left + (float(np.median(columns)) + 0.5) / scale
    tall = (last - first) / scale
    return (
        x - 0.5 * ASPECT * tall, top + first / scale, x + 0.5 * ASPECT * tall, top + last / scale
    )  # fmt: skip


def outline(
    image: NDArray[np.uint8], box: BoxXyxy
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """What belongs to the body in a box that fits it.

    Returns:
        (H, W) mask of what is in and around the box, and (H,) where its rows lie, from head (0) to
        foot (1); one height of the body is `HEIGHT` pixels, its axis the middle column.
    """
    body, *_ = _cut_out(image, box)
    return body, (np.arange(body.shape[0]) + 0.5) / HEIGHT - _ABOVE


def _cut_out(
    image: NDArray[np.uint8], box: BoxXyxy
) -> tuple[NDArray[np.bool_], float, float, float]:
    """The body, mask pixels a picture pixel, and the mask's corner in the picture."""
    height, x = box[3] - box[1], 0.5 * (box[0] + box[2])
    scale = HEIGHT / height
    left, top = x - _ASIDE * height, box[1] - _ABOVE * height
    size = round(2 * _ASIDE * HEIGHT), round((1 + _ABOVE + _BELOW) * HEIGHT)
    return _body(scaled_part(image, left, top, scale, size)), scale, left, top


def _body(view: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) where the person is: what is connected with the middle of the trunk."""
    rows, columns = view.shape[:2]
    down = ((np.arange(rows) + 0.5) / HEIGHT - _ABOVE)[:, None]
    aside = np.abs((np.arange(columns) + 0.5) / HEIGHT - _ASIDE)[None, :]
    maybe = (aside < _MAYBE_ASIDE) & (down > -_MAYBE_ABOVE) & (down < 1 + _MAYBE_BELOW)
    likely = (aside < ASPECT * reach(down)) | (
        (aside < _HEAD[1]) & (down > _HEAD[0][0]) & (down < _HEAD[0][1])
    )
    sure = (aside < _TRUNK[1]) & (down > _TRUNK[0][0]) & (down < _TRUNK[0][1])
    legs = (aside > _LEGS[1][0]) & (aside < _LEGS[1][1])
    sure |= legs & (down > _LEGS[0][0]) & (down < _LEGS[0][1])
    mask = np.full((rows, columns), cv2.GC_BGD, np.uint8)
    mask[maybe] = cv2.GC_PR_BGD
    mask[likely] = cv2.GC_PR_FGD
    mask[sure] = cv2.GC_FGD
    # Its colour clusters start from OpenCV's generator: equal pictures are to give equal boxes.
    cv2.setRNGSeed(1)
    # The rectangle is of no use when a mask begins.
    cv2.grabCut(view, mask, (0, 0, columns, rows), np.zeros((1, 65)), np.zeros((1, 65)), _ROUNDS,
                cv2.GC_INIT_WITH_MASK)  # fmt: skip
    inside = np.isin(mask, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8)
    _, labels = cv2.connectedComponents(inside, connectivity=4)
    middle = labels[round((_ABOVE + 0.3) * HEIGHT), columns // 2]
    return np.asarray(labels == middle)


def _widths(body: NDArray[np.bool_], within: float) -> NDArray[np.intp]:
    """Pixels of the body by row, not farther than so many heights from the middle."""
    middle, half = body.shape[1] // 2, round(within * HEIGHT)
    return np.asarray(body[:, middle - half : middle + half + 1].sum(axis=1))


def _above_shadow(body: NDArray[np.bool_], first: int, last: int) -> float:
    widths = body.sum(axis=1)
    usual = float(np.median(widths[first:last]))
    wide = np.flatnonzero(widths[:last] > _SHADOW_WIDTH * usual)
    wide = wide[wide > first + _FLOOR * (last - first)]
    return float(last) if not wide.size else min(last, wide[0] + _IN_SHADOW * (last - first))
