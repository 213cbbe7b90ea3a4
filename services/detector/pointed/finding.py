"""The person at a point of one picture: about where it ends, to the pixel, and whether it is one.

Upright bodies of every size about the point are tried: a person is one whose strips from head to
foot differ from what is beside them, above the head and below the feet. Histograms of rectangles
come from integral images (F. Porikli, "Integral histogram", CVPR 2005). The outline is GrabCut's
(C. Rother, V. Kolmogorov, A. Blake, SIGGRAPH 2004), which begins with the silhouette of a standing
person: its middle is sure to be body, what is far from it sure to be none.

Lengths are heights of the body, unless they say otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.silhouette import ASPECT, reach, scaled_part

_ROWS = 180  # pictures are looked at at about this height, pixels
_LIGHT_STEP = 24  # Lab's lightness of one colour, of 256 levels; chosen by hand
_HUE_STEP = 8  # Lab's a and b of one colour; chosen by hand
_MOST_COLOURS = 128  # the most frequent ones; all others count as one
_STRIPS = 8  # from head to foot
_LOWEST = 0.2  # least height tried, picture heights
_HIGHEST = 1.25  # largest height tried, picture heights: the feet may be out of the picture
_STEP = 1.07  # ratio of one height tried to the next
_DOWN = (0.15, 0.72, 0.03)  # where the point lies on the body, from head to foot: from, to, step
_POINT_ASIDE = 0.1  # how far the point lies from the middle of the body
_POINT_ASIDE_STEP = 0.025  # step of the places tried
_HORIZON = (0.38, 0.75)
"""Part of the body at which the middle row lies: a robot's level camera is no higher than a person
is tall."""
_GAP = 0.06  # between the body and what is compared with it: arms move there
_BESIDE = 0.12  # width of what is compared with the body
_END_WEIGHT = 0.5  # of the contrast at head and feet: a body without its legs stands out, too
_LONGER = 0.3  # weight of ln(height), for the same reason
_UNTOLD = 0.4  # contrast taken for ends that are out of the picture
_LEAST_SIDES = 0.45  # contrast on either side below which there is no person; chosen by hand

OUTLINE_PX = 72
"""Height of the person whose outline is looked for, pixels."""
_ASIDE = 0.7  # looked at to either side of the middle
_ABOVE = 0.5  # looked at above the head
_BELOW = 0.35  # looked at below the feet
_MAYBE_ASIDE = 0.3  # farther from the middle than this is sure to be no part of the body
_MAYBE_ABOVE = 0.32  # and farther above the head
_MAYBE_BELOW = 0.22  # and farther below the feet
_ROUNDS = 4  # of GrabCut; chosen by hand
_TRUNK = ((0.1, 0.6), 0.05)
"""Sure to be body: rows from head (0) to foot (1), and how far from the middle."""
_LEGS = ((0.5, 0.93), (0.025, 0.075))
"""Sure to be body: rows, and from where to where beside the middle."""
_HEAD = ((-0.2, 0.05), 0.06)
"""Likely to be body, if the box begins too low: rows, and how far from the middle."""
_MIDDLE = 0.2  # part of the outline, to either side of the middle, that tells head and feet
_LEAST_WIDTH = 0.055  # how wide it has to be there
_FLOOR = 0.8  # shadows on the floor are looked for below this part of the body
_SHADOW_WIDTH = 1.8  # wider than so many bodies is a shadow
_IN_SHADOW = 0.05  # how far feet stand in it

_UPRIGHT_SIDES = 0.7
"""Least contrast of a body that is shown unproven: a cupboard passes, but goes on above or below;
this and what follows was chosen on rendered pictures so that no thing passes."""
_UPRIGHT_ENDS = 1.85  # least contrast of its ends
_LEAST_OVERLAP = 0.5  # of outline and silhouette, intersection over union
_HEAD_ROWS = (0.0, 0.1)  # from head (0) to foot (1)
_SHOULDER_ROWS = (0.2, 0.3)  # from head (0) to foot (1)
_HEAD_WIDTH = (0.03, 0.17)  # least and largest
_SHOULDER_WIDTH = 0.42  # largest
_NARROWER = 0.62  # how much narrower than the shoulders a head is at least
_SAME_SIZE = 0.35  # ln: the outline ends about where the contrast does

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Bodies:
    """Candidates, (N,) each, pixels: middle, head, height."""

    x: Floats
    top: Floats
    height: Floats


@dataclass(frozen=True, slots=True)
class Contrast:
    """An upright body that differs from what is around it.

    Attributes:
        box_xyxy: off by up to a seventh of its height, pixels.
        sides: mean difference from what is on either side, in [0, 1].
        ends: sum of those above the head and below the feet, in [0, 2].
    """

    box_xyxy: BoxXyxy
    sides: float
    ends: float


def most_contrast(image: NDArray[np.uint8], x_px: float, y_px: float) -> Contrast | None:
    """The body at a point that differs most from what is around it; None: no shape of a person.

    Args:
        image: (H, W, 3) uint8 BGR.
        x_px, y_px: a point on the body, better on the chest than on the feet.
    """
    scale = min(1.0, _ROWS / image.shape[0])
    size = max(1, round(scale * image.shape[1])), max(1, round(scale * image.shape[0]))
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    bodies = _candidates(size[1], scale * x_px, scale * y_px)
    if not len(bodies.x):
        return None
    counts = _ColourCounts(small)
    sides = _side_contrast(counts, bodies)
    ends = _end_contrast(counts, bodies)
    total = sides + _END_WEIGHT * ends
    best = int(np.argmax(total + _LONGER * np.log(bodies.height / size[1])))
    if sides[best] < _LEAST_SIDES:
        return None
    x, top, height = (float(of[best]) / scale for of in (bodies.x, bodies.top, bodies.height))
    half = 0.5 * ASPECT * height
    box = (x - half, top, x + half, top + height)
    return Contrast(box, float(sides[best]), float(ends[best]))


def _candidates(rows: int, x: float, y: float) -> _Bodies:
    count = int(np.log(_HIGHEST / _LOWEST) / np.log(_STEP)) + 1
    heights = rows * _LOWEST * _STEP ** np.arange(count)
    asides = np.arange(-_POINT_ASIDE, _POINT_ASIDE + 1e-6, _POINT_ASIDE_STEP)
    height, down, aside = (
        grid.ravel() for grid in np.meshgrid(heights, np.arange(*_DOWN), asides, indexing="ij")
    )
    top = y - down * height
    horizon = (0.5 * rows - top) / height
    level = (horizon > _HORIZON[0]) & (horizon < _HORIZON[1])
    return _Bodies(x + aside[level] * height[level], top[level], height[level])


def _side_contrast(counts: _ColourCounts, of: _Bodies) -> Floats:
    """Mean difference between strips of the body and what is on either side of them."""
    total, told = np.zeros(len(of.x)), np.zeros(len(of.x))
    width = ASPECT * of.height
    for strip in range(_STRIPS):
        first, last = strip / _STRIPS, (strip + 1) / _STRIPS
        half = reach(np.linspace(first, last, 5)).mean() * width
        top, bottom = of.top + first * of.height, of.top + last * of.height
        body = counts.within(top, of.x - 0.85 * half, bottom, of.x + 0.85 * half)
        near, far = half + _GAP * of.height, half + (_GAP + _BESIDE) * of.height
        for left, right in ((of.x - far, of.x - near), (of.x + near, of.x + far)):
            differs, known = _difference(body, counts.within(top, left, bottom, right))
            total += np.where(known, differs, 0.0)
            told += known
    return total / np.maximum(told, 1.0)


def _end_contrast(counts: _ColourCounts, of: _Bodies) -> Floats:
    """Sum of the differences between head and what is above it, and legs and the floor below."""
    height, top, x = of.height, of.top, of.x
    head = counts.within(top + 0.01 * height, x - 0.06 * height,
                         top + 0.10 * height, x + 0.06 * height)  # fmt: skip
    above = counts.within(top - 0.10 * height, x - 0.06 * height,
                          top - 0.02 * height, x + 0.06 * height)  # fmt: skip
    legs = counts.within(top + 0.875 * height, x - 0.1 * height, top + height, x + 0.1 * height)
    below = counts.within(top + 1.03 * height, x - 0.1 * height,
                          top + 1.10 * height, x + 0.1 * height)  # fmt: skip
    ends = (_difference(head, above), _difference(legs, below))
    return np.asarray(sum(np.where(known, differs, _UNTOLD) for differs, known in ends))


def _difference(a: Floats, b: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """(N,) total variation between histograms (N, K) of counts, and where both have pixels."""
    of_a, of_b = a.sum(axis=1), b.sum(axis=1)
    known = (of_a > 3.0) & (of_b > 3.0)
    shares = a / np.maximum(of_a, 1.0)[:, None] - b / np.maximum(of_b, 1.0)[:, None]
    return 0.5 * np.abs(shares).sum(axis=1), known


class _ColourCounts:
    """Histograms of rectangles of one picture."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), np.int32)
        hues = (lab[..., 1:] - 128) // _HUE_STEP + 64
        code = (lab[..., 0] // _LIGHT_STEP) << 16 | hues[..., 0] << 8 | hues[..., 1]
        _, colours, counts = np.unique(code, return_inverse=True, return_counts=True)
        rank = np.empty(len(counts), np.int32)
        rank[np.argsort(-counts, kind="stable")] = np.arange(len(counts))
        colours = np.minimum(rank, _MOST_COLOURS - 1)[colours].reshape(code.shape)
        layers = [
            cv2.integral((colours == colour).astype(np.uint8), sdepth=cv2.CV_32F)
            for colour in range(int(colours.max()) + 1)
        ]
        self._sums = np.ascontiguousarray(np.stack(layers, axis=-1))

    def within(self, top: Floats, left: Floats, bottom: Floats, right: Floats) -> Floats:
        """(N, K) pixels of each colour in rectangles, (N,) pixels each."""
        rows, columns = (side - 1 for side in self._sums.shape[:2])
        first_row, last_row = _clipped(top, rows), _clipped(bottom, rows)
        first, last = _clipped(left, columns), _clipped(right, columns)
        sums = self._sums
        counts = sums[last_row, last] - sums[first_row, last]
        counts += sums[first_row, first] - sums[last_row, first]
        return np.asarray(counts, np.float64)


def _clipped(at: Floats, most: int) -> NDArray[np.intp]:
    return np.clip(np.rint(at), 0, most).astype(np.intp)


def outline_box(image: NDArray[np.uint8], box: BoxXyxy) -> BoxXyxy:
    """The box of the person whose box is about this one.

    Args:
        image: (H, W, 3) uint8 BGR.
        box: off by up to a sixth of the height, pixels.
    """
    body, scale, left, top = _cut_out(image, box)
    rows = np.flatnonzero(_widths(body, _MIDDLE) >= _LEAST_WIDTH * OUTLINE_PX)
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
        foot (1); one height of the body is `OUTLINE_PX` pixels, its axis the middle column.
    """
    body, *_ = _cut_out(image, box)
    return body, (np.arange(body.shape[0]) + 0.5) / OUTLINE_PX - _ABOVE


def _cut_out(
    image: NDArray[np.uint8], box: BoxXyxy
) -> tuple[NDArray[np.bool_], float, float, float]:
    """The body, mask pixels a picture pixel, and the mask's corner in the picture."""
    height, x = box[3] - box[1], 0.5 * (box[0] + box[2])
    scale = OUTLINE_PX / height
    left, top = x - _ASIDE * height, box[1] - _ABOVE * height
    size = round(2 * _ASIDE * OUTLINE_PX), round((1 + _ABOVE + _BELOW) * OUTLINE_PX)
    return _body(scaled_part(image, left, top, scale, size)), scale, left, top


def _body(view: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) where the person is: what is connected with the middle of the trunk."""
    rows, columns = view.shape[:2]
    down = ((np.arange(rows) + 0.5) / OUTLINE_PX - _ABOVE)[:, None]
    aside = np.abs((np.arange(columns) + 0.5) / OUTLINE_PX - _ASIDE)[None, :]
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
    middle = labels[round((_ABOVE + 0.3) * OUTLINE_PX), columns // 2]
    return np.asarray(labels == middle)


def _widths(body: NDArray[np.bool_], within: float) -> NDArray[np.intp]:
    """Pixels of the body by row, not farther than so many heights from the middle."""
    middle, half = body.shape[1] // 2, round(within * OUTLINE_PX)
    return np.asarray(body[:, middle - half : middle + half + 1].sum(axis=1))


def _above_shadow(body: NDArray[np.bool_], first: int, last: int) -> float:
    widths = body.sum(axis=1)
    usual = float(np.median(widths[first:last]))
    wide = np.flatnonzero(widths[:last] > _SHADOW_WIDTH * usual)
    wide = wide[wide > first + _FLOOR * (last - first)]
    return float(last) if not wide.size else min(last, wide[0] + _IN_SHADOW * (last - first))


def looks_upright(image: NDArray[np.uint8], contrast: Contrast, box: BoxXyxy) -> bool:
    """Whether the body there has head and shoulders, and stands out all around.

    Such a place may be shown before anything has moved there. It proves nothing: a picture of a
    person has the same outline.

    Args:
        image: (H, W, 3) uint8 BGR.
        contrast: of the place.
        box: of its outline.
    """
    before = contrast.box_xyxy[3] - contrast.box_xyxy[1]
    if contrast.sides < _UPRIGHT_SIDES or contrast.ends < _UPRIGHT_ENDS:
        return False
    if abs(math.log((box[3] - box[1]) / before)) > _SAME_SIZE:
        return False
    body, down = outline(image, box)
    across = (np.arange(body.shape[1]) + 0.5 - 0.5 * body.shape[1]) / OUTLINE_PX
    standing = np.abs(across)[None, :] < ASPECT * reach(down)[:, None]
    overlap = np.count_nonzero(body & standing) / np.count_nonzero(body | standing)
    widths = body.sum(axis=1) / OUTLINE_PX
    head, shoulders = (
        float(widths[(down >= first) & (down < last)].mean())
        for first, last in (_HEAD_ROWS, _SHOULDER_ROWS)
    )
    return bool(
        overlap > _LEAST_OVERLAP
        and _HEAD_WIDTH[0] < head < min(_HEAD_WIDTH[1], _NARROWER * shoulders)
        and shoulders < _SHOULDER_WIDTH
    )
