"""Where a silhouette of whichever size fits best on a map of likeness."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from heel.services.detector.pointed.silhouette import FloatMap, Place, silhouette
from heel.services.detector.pointed.view import PERSON_PX

_FACTORS = (0.9, 0.95, 1.0, 1.05, 1.1)
_ASIDE, _GROWTH, _OFF_STANCE, _PENALTY = 0.15, 0.06, 0.05, 0.02
"""How far from where they should be, heights, from the size they should have, ln, and from where
somebody of that size stands, heights, costs so much likeness."""


@dataclass(frozen=True, slots=True)
class Fit:
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


def best_fit(likeness: list[FloatMap], aim: tuple[float, float, float], slack: float) -> Fit:
    """The place that explains the likeness best, near where the person should be.

    Args:
        likeness: by strip, (H, W) float32 in [-1, 1].
        aim: expected column and row of the middle of somebody `PERSON_PX` high, and the row of
            the horizon, pixels.
        slack: 1, or more the longer nothing was seen.
    """
    column, row, horizon = aim
    best = Fit(Place(0, 0, PERSON_PX), -math.inf)
    for factor in _FACTORS:
        height = round(PERSON_PX * factor)
        scores = strip_scores(likeness, height)
        centre = silhouette(height).centre
        stands = horizon + (row - horizon) * height / PERSON_PX
        down = (np.arange(scores.shape[0]) + centre[1] - stands) / (_OFF_STANCE * PERSON_PX)
        across = (np.arange(scores.shape[1]) + centre[0] - column) / (slack * _ASIDE * PERSON_PX)
        growth = (math.log(height / PERSON_PX) / (_GROWTH * slack)) ** 2
        scores -= (_PENALTY * (down[:, None] ** 2 + across[None, :] ** 2 + growth)).astype(
            np.float32
        )
        at_row, at_column = divmod(int(scores.argmax()), scores.shape[1])
        if scores[at_row, at_column] > best.score:
            best = Fit(Place(at_row, at_column, height), float(scores[at_row, at_column]))
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
