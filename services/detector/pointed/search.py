"""Somebody who was out of sight, looked for in the whole picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.detector.pointed.colours import StripColours, colour_bins
from heel.services.detector.pointed.fitting import likeness_at, share_inside, strip_scores
from heel.services.detector.pointed.silhouette import Place, silhouette
from heel.services.detector.pointed.stance import Stance
from heel.services.detector.pointed.view import PERSON_PX, view_around

_SIZES = np.exp(np.arange(-0.9, 0.61, 0.15))
"""Tried, of the size they had."""
_LOWEST, _HIGHEST = 0.12, 1.8
"""Heights that are tried at all, picture heights."""
_ROWS = 88
_OFF_ROWS = 3
"""Nobody stands farther than this from where people of their size stand, view pixels."""
_CLEAR, _ELSEWHERE = 0.85, 0.6
"""A second place, farther away than so many heights, has to be less like them than this share."""
_LEAST_INSIDE = 0.5


@dataclass(frozen=True, slots=True)
class Found:
    """A place: how much it stands out from what is beside it, how like them it is, and where."""

    score: float
    likeness: float
    x: float
    height: float


def alike(
    image: NDArray[np.uint8], colours: StripColours, stance: Stance, height: float
) -> list[Found]:
    """Every place that may be theirs, in pixels.

    Args:
        image: (H, W, 3) uint8 BGR.
        colours: theirs.
        stance: where people of which height stand.
        height: the one they had.
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


def _peaks(scores: NDArray[np.float32], most: int = 3) -> list[int]:
    """Columns of the highest values, a body apart from each other."""
    left = scores.copy()
    peaks = []
    for _ in range(most):
        column = int(left.argmax())
        if not math.isfinite(left[column]):
            break
        peaks.append(column)
        left[max(0, column - PERSON_PX // 3) : column + PERSON_PX // 3 + 1] = -math.inf
    return peaks


def clearest(places: list[Found], least: float) -> Found | None:
    """The one place that is like them; None for none, or two.

    Args:
        places: of `alike`.
        least: mean likeness of their body.
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
    """Whether it is beside somebody so high in that column."""
    return abs(place.x - x) > _ELSEWHERE * min(place.height, height)
