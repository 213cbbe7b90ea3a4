"""Optional second opinion: does the box look like the person?

One colour histogram per body band, compared by the Hellinger distance. How far apart two pictures
of one person and of two people lie depends on the scene, so both are learned from the scene itself:
a track that moves alone shows what the same person looks like from frame to frame, two tracks in
one frame are two people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.tracker.given_boxes.geometry import FloatArray
from services.tracker.given_boxes.settings import AppearanceSettings
from services.tracker.given_boxes.track import Track

_SIZE = (24, 48)  # width, height to which every box is brought
_BANDS = ((0.06, 0.20), (0.20, 0.36), (0.36, 0.54), (0.54, 0.74), (0.74, 0.94))  # head to shins
_BINS = (8, 8, 8)  # lightness, a, b
_LENGTH = len(_BANDS) * (_BINS[1] * _BINS[2] + _BINS[0])


def describe(image: NDArray[np.uint8], boxes: FloatArray) -> FloatArray:
    """Colour of (N, 4) xyxy boxes of a BGR picture: (N, D) with rows of unit Euclidean length.

    Square roots of Lab histograms in five bands, weighted towards the box's upright axis, where the
    person is. Boxes outside the picture give equal entries.
    """
    features = [_describe_one(image, box) for box in boxes]
    return np.array(features).reshape(len(boxes), _LENGTH)


def _describe_one(image: NDArray[np.uint8], box: FloatArray) -> FloatArray:
    height, width = image.shape[:2]
    left, top = max(round(box[0]), 0), max(round(box[1]), 0)
    right, bottom = min(round(box[2]), width), min(round(box[3]), height)
    if right - left < 3 or bottom - top < 6:
        return np.full(_LENGTH, 1 / math.sqrt(_LENGTH))
    patch = cv2.resize(image[top:bottom, left:right], _SIZE, interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(patch, cv2.COLOR_BGR2LAB).astype(np.float64)
    across = (np.arange(_SIZE[0]) + 0.5) / _SIZE[0] - 0.5
    weight_row = np.exp(-0.5 * (across / 0.16) ** 2)
    parts = []
    for low, high in _BANDS:
        rows = lab[int(low * _SIZE[1]) : int(high * _SIZE[1])]
        weight = np.broadcast_to(weight_row, rows.shape[:2]).ravel()
        light = np.clip(rows[..., 0].ravel() / 32.0 - 0.5, 0, _BINS[0] - 1.001)
        colour_a = np.clip((rows[..., 1].ravel() - 128) / 8.0 + 3.5, 0, _BINS[1] - 1.001)
        colour_b = np.clip((rows[..., 2].ravel() - 128) / 8.0 + 3.5, 0, _BINS[2] - 1.001)
        parts.append(_soft(light, weight, _BINS[0]))
        parts.append(_soft_pair(colour_a, colour_b, weight))
    histogram = np.concatenate(parts)
    return np.asarray(np.sqrt(histogram / histogram.sum()))


def _soft(value: FloatArray, weight: FloatArray, bins: int) -> FloatArray:
    low = value.astype(int)
    share = value - low
    return np.asarray(
        np.bincount(low, weight * (1 - share), bins) + np.bincount(low + 1, weight * share, bins)
    )


def _soft_pair(first: FloatArray, second: FloatArray, weight: FloatArray) -> FloatArray:
    bins = _BINS[1] * _BINS[2]
    total = np.zeros(bins)
    a, b = first.astype(int), second.astype(int)
    u, v = first - a, second - b
    for di, wi in ((0, 1 - u), (1, u)):
        for dj, wj in ((0, 1 - v), (1, v)):
            total += np.bincount((a + di) * _BINS[2] + b + dj, weight * wi * wj, bins)
    return total


def distances(first: FloatArray, second: FloatArray) -> FloatArray:
    """Hellinger distances in [0, 1] of (N, D) and (M, D) rows of `describe`, shape (N, M)."""
    return np.asarray(np.sqrt(np.clip(1 - first @ second.T, 0.0, 1.0)))


@dataclass
class LookStatistics:
    """Running mean and variance of distances, started from a prior worth `weight` samples."""

    mean: float
    spread: float
    weight: float = 30.0
    square: float = field(init=False)

    def __post_init__(self) -> None:
        self.square = self.mean**2 + self.spread**2

    def add(self, value: float, longest: float = 2000.0) -> None:
        """Take one more distance; the oldest fade once `longest` have been seen."""
        self.weight = min(self.weight + 1, longest)
        self.mean += (value - self.mean) / self.weight
        self.square += (value**2 - self.square) / self.weight

    def log_density(self, value: FloatArray, floor: float) -> FloatArray:
        """Log of the normal density at `value`, the spread not below `floor`."""
        variance = max(self.square - self.mean**2, floor**2)
        return np.asarray(-0.5 * ((value - self.mean) ** 2 / variance + np.log(variance)))


class LookModel:
    """Turns distances of looks into log odds of being the same person."""

    def __init__(self, settings: AppearanceSettings) -> None:
        self.settings = settings
        self.same = LookStatistics(0.25, 0.08)
        self.other = LookStatistics(0.5, 0.12)

    def learn(self, first: FloatArray, second: FloatArray) -> None:
        """Learn from (N, D) looks seen alone in one frame and (N, D) galleries of their tracks."""
        distance = distances(first, second)
        for i in range(len(distance)):
            for j in range(len(distance)):
                (self.same if i == j else self.other).add(float(distance[i, j]))

    def compare(self, tracks: list[Track], looks: FloatArray) -> FloatArray:
        """Log odds (N, M) that boxes of (M, D) looks are of the tracks; 0 where none is known."""
        odds = np.zeros((len(tracks), len(looks)))
        known = [k for k, track in enumerate(tracks) if track.look is not None]
        if known and len(looks):
            gallery = np.array([tracks[k].look for k in known])
            odds[known] = self.log_odds(distances(gallery, looks))
        return odds

    def remember(self, tracks: list[Track], looks: FloatArray) -> None:
        """Learn from tracks seen alone in one frame, and put their (N, D) looks into memory."""
        known = [k for k, t in enumerate(tracks) if t.look is not None and t.confirmed]
        if known:
            self.learn(looks[known], np.array([tracks[k].look for k in known]))
        for track, look in zip(tracks, looks, strict=True):
            blend = max(self.settings.memory, 1 / (track.looks + 1))
            mixed = look if track.look is None else track.look + blend * (look - track.look)
            track.look = mixed / np.linalg.norm(mixed)
            track.looks += 1

    def log_odds(self, distance: FloatArray) -> FloatArray:
        """Log odds, same shape as `distance`, limited to what colour can be trusted with."""
        floor = self.settings.least_spread
        odds = self.same.log_density(distance, floor) - self.other.log_density(distance, floor)
        # Both normal densities are monotone only between their means.
        odds = np.where(distance < self.same.mean, np.maximum(odds, 0.0), odds)
        odds = np.where(distance > self.other.mean, np.minimum(odds, 0.0), odds)
        most = self.settings.most
        return np.asarray(np.clip(self.settings.weight * odds, -most, most))
