"""Where a silhouette fits on a map of likeness: near by, where it ends, and in the whole picture.

Lengths are heights of the person, unless they say otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.pointed.colours import StripColours, colour_bins
from heel.services.detector.pointed.distance import Stance
from heel.services.detector.pointed.silhouette import (
    ASPECT,
    PERSON_PX,
    STRIPS,
    FloatMap,
    Place,
    silhouette,
    view_around,
)

_FACTORS = (0.9, 0.95, 1.0, 1.05, 1.1)  # sizes tried, of the size that the person should have
_ASIDE = 0.15  # so far from where the person should be costs as much likeness as `_PENALTY` says
_GROWTH = 0.06  # and so far from the size that it should have, ln
_OFF_STANCE = 0.05  # and so far from where a person of that size stands
_PENALTY = 0.02  # likeness; chosen by hand

_BAND = 0.42  # columns looked at on either side for the ends of the body, box widths
_BODY = 0.2  # likeness of a pixel of the body; chosen by hand
_LEAST_BODY = 0.1  # how much of the width of the box such pixels have to fill in a row
_SHADOW_REACH = 0.3  # to either side: where shadows on the floor are told by their width
_SHADOW = 0.8  # more of the row than this share is a shadow on the floor
_LOW = 0.3  # below the hip where shadows are looked for
_IN_SHADOW = 0.06  # how far feet stand in them
_GAP = 0.04  # a gap as long ends the body
_SHORTEST = 0.35  # least length from the hip up or down
_LONGEST = 0.95  # largest length from the hip up or down
_LEAST_CUT = 0.2  # least length from the hip to the border of the picture that cuts the body

_SIZES = np.exp(np.arange(-0.9, 0.61, 0.15))
"""Tried in the whole picture, of the size that the person had."""
_LOWEST = 0.08  # least height tried at all, picture heights: 14 m away before 90 degrees
_HIGHEST = 1.8  # largest height that is tried at all, picture heights
_ROWS = 88  # of the views that are searched, pixels
_MOST_PEAKS = 3  # places looked at of each size; chosen by hand
_OFF_ROWS = 3  # a person stands no farther than this from where one of its size stands, view pixels
_CLEAR = 0.85  # a second place has to be less like the person than this share of the best
_ELSEWHERE = 0.6  # places farther apart than this are two
_LEAST_INSIDE = 0.5  # share of the body in the picture


@dataclass(frozen=True, slots=True)
class SilhouetteFit:
    """The best place and its score."""

    place: Place
    score: float


def strip_scores(likeness: list[FloatMap], height: int) -> FloatMap:
    """(H', W') mean likeness inside less that beside, by upper left corner of the template.

    Args:
        likeness: by strip, (H, W) float32 in [-1, 1].
        height: of the silhouette, pixels.
    """
    rows, columns = likeness[0].shape
    shape = silhouette(height)
    high, wide = shape.shape
    total = np.zeros((rows - high + 1, columns - wide + 1), np.float32)
    for strip, layer in zip(shape.strips, likeness, strict=True):
        last = strip.first_row + strip.weights.shape[0]
        part = layer[strip.first_row : rows - high + last]
        total += cv2.matchTemplate(part, strip.weights, cv2.TM_CCORR)
    return total


def best_fit(
    likeness: list[FloatMap], aim: tuple[float, float, float], slack: float, size_slack: float
) -> SilhouetteFit:
    """The place that explains the likeness best, near where the person should be.

    Args:
        likeness: by strip, (H, W) float32 in [-1, 1].
        aim: expected column and row of the middle of a person `PERSON_PX` high, and the row of
            the horizon, pixels.
        slack: 1, or more the longer nothing was seen.
        size_slack: the same for the size.
    """
    column, row, horizon = aim
    best = SilhouetteFit(Place(0, 0, PERSON_PX), -math.inf)
    for factor in _FACTORS:
        height = round(PERSON_PX * factor)
        scores = strip_scores(likeness, height)
        centre = silhouette(height).centre
        stands = horizon + (row - horizon) * height / PERSON_PX
        down = (np.arange(scores.shape[0]) + centre[1] - stands) / (_OFF_STANCE * PERSON_PX)
        across = (np.arange(scores.shape[1]) + centre[0] - column) / (slack * _ASIDE * PERSON_PX)
        growth = (math.log(height / PERSON_PX) / (_GROWTH * size_slack)) ** 2
        scores -= (_PENALTY * (down[:, None] ** 2 + across[None, :] ** 2 + growth)).astype(
            np.float32
        )
        at_row, at_column = divmod(int(scores.argmax()), scores.shape[1])
        if scores[at_row, at_column] > best.score:
            best = SilhouetteFit(Place(at_row, at_column, height), float(scores[at_row, at_column]))
    return best


def likeness_at(likeness: list[FloatMap], place: Place) -> float:
    """Mean likeness of the body there."""
    shape = silhouette(place.height)
    total = 0.0
    for strip, layer in zip(shape.strips, likeness, strict=True):
        first, last = strip.first_row, strip.first_row + strip.weights.shape[0]
        part = layer[place.row + first : place.row + last, place.span[1]]
        total += float((part * shape.cover[first:last]).sum())
    return total / float(shape.cover.sum())


def share_inside(inside: FloatMap, place: Place) -> float:
    """Share of the body there that the picture shows."""
    cover = silhouette(place.height).cover
    return float((cover * inside[place.span]).sum() / cover.sum())


@dataclass(frozen=True, slots=True)
class End:
    """Where a person ends: the row, or the picture's last before they do."""

    row: float
    cut: bool


def extent(
    likeness: list[FloatMap], inside: FloatMap, place: Place
) -> tuple[End | None, End | None]:
    """Upper and lower end of the person's colours about the middle of the box, None if not told.

    Args:
        likeness: by strip, (H, W) float32 in [-1, 1].
        inside: (H, W) float32, 1 inside the picture, else 0.
        place: where the template fits best.
    """
    shape = silhouette(place.height)
    body = _body(likeness, place.row + shape.centre[1])
    middle, half = place.column + shape.centre[0], max(2, round(_BAND * ASPECT * place.height))
    columns = slice(max(0, middle - half), middle + half + 1)
    count = (body[:, columns] > _BODY).sum(axis=1)
    solid = count >= max(1.0, _LEAST_BODY * ASPECT * place.height)
    reach = round(_SHADOW_REACH * place.height)
    around = slice(max(0, middle - reach), middle + reach + 1)
    shadow = (body[:, around] > _BODY).mean(axis=1) > _SHADOW
    hip = place.row + shape.centre[1]
    visible = inside[:, min(max(0, middle), inside.shape[1] - 1)] > 0.0
    up = _rows_until_gap(solid[: hip + 1][::-1], visible[: hip + 1][::-1], place.height)
    low = round(_LOW * place.height)
    floor = np.flatnonzero(shadow[hip + low :])
    standing = solid[hip:].copy()
    if floor.size:
        standing[low + int(floor[0]) + round(_IN_SHADOW * place.height) :] = False
    down = _rows_until_gap(standing, visible[hip:], place.height)
    return (
        None if up is None else End(hip - up.row + 1.0, up.cut),
        None if down is None else End(hip + down.row, down.cut),
    )


def _body(likeness: list[FloatMap], hip: int) -> FloatMap:
    """Likeness to any strip of the upper body above the hip, of the lower body below it."""
    upper = np.maximum.reduce(likeness[: STRIPS // 2])[:hip]
    return np.vstack([upper, np.maximum.reduce(likeness[STRIPS // 2 :])[hip:]])


def _rows_until_gap(
    solid: NDArray[np.bool_], visible: NDArray[np.bool_], height: int
) -> End | None:
    """How many rows go on until a gap or the picture's border; None where that is no person's."""
    gap, reach = max(1, round(_GAP * height)), round(_LONGEST * height)
    end = 0
    for row in range(len(solid)):
        if not visible[row]:
            leaves = row - end <= 1 and row > _LEAST_CUT * height
            return End(float(row), cut=True) if leaves else None
        if row > reach:
            return None
        if solid[row]:
            end = row + 1
        elif row >= end + gap:
            break
    return End(float(end), cut=False) if end > _SHORTEST * height else None


@dataclass(frozen=True, slots=True)
class Found:
    """A place: how much it stands out from what is around, how like the person it is, and where."""

    score: float
    likeness: float
    x: float
    height: float


def alike(
    image: NDArray[np.uint8], colours: StripColours, stance: Stance, height: float
) -> list[Found]:
    """Every place in the picture that may be the person's, pixels.

    Args:
        image: (H, W, 3) uint8 BGR.
        colours: of the person.
        stance: where people of which height stand.
        height: the one that it had.
    """
    rows, columns = image.shape[:2]
    places: list[Found] = []
    for tried in (height * _SIZES).tolist():
        if not _LOWEST * rows < tried < _HIGHEST * rows:
            continue
        size = math.ceil(columns * PERSON_PX / tried) + 2 * PERSON_PX, _ROWS
        view = view_around(image, 0.5 * columns, stance.centre(tried), tried, size)
        likeness = [layer * view.inside for layer in colours.likeness(colour_bins(view.image))]
        scores = strip_scores(likeness, PERSON_PX)
        first = _ROWS // 2 - silhouette(PERSON_PX).centre[1]
        band = scores[max(0, first - _OFF_ROWS) : first + _OFF_ROWS + 1]
        for column in _peaks(band.max(axis=0)):
            place = Place(
                max(0, first - _OFF_ROWS) + int(band[:, column].argmax()), column, PERSON_PX
            )
            inside = share_inside(view.inside, place)
            if inside >= _LEAST_INSIDE:
                x = view.to_picture(place.middle[0], 0.0)[0]
                like = likeness_at(likeness, place) / inside
                score = float(scores[place.row, place.column]) / inside
                places.append(Found(score, like, x, tried))
    return places


def _peaks(scores: NDArray[np.float32]) -> list[int]:
    """Columns of the highest values, a body apart from each other."""
    left = scores.copy()
    peaks = []
    for _ in range(_MOST_PEAKS):
        column = int(left.argmax())
        if not math.isfinite(left[column]):
            break
        peaks.append(column)
        left[max(0, column - PERSON_PX // 3) : column + PERSON_PX // 3 + 1] = -math.inf
    return peaks


def clearest(places: list[Found], least: float) -> Found | None:
    """The one place that is like the person; None for none, or two.

    Args:
        places: of `alike`.
        least: mean likeness of its body.
    """
    if not places:
        return None
    best = max(places, key=lambda one: one.score)
    apart = [one for one in places if elsewhere(one, best.x, best.height)]
    second = max((one.score for one in apart), default=0.0)
    if best.likeness < least or second > _CLEAR * best.score:
        return None
    return best


def elsewhere(place: Found, x: float, height: float) -> bool:
    """Whether it is beside a person so high in that column."""
    return abs(place.x - x) > _ELSEWHERE * min(place.height, height)
