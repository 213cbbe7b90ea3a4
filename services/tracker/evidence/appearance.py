"""Appearance descriptors of people, from colours of head, torso and legs, and their galleries."""

from __future__ import annotations

import cv2
import numpy as np

from heel.schemas import Blobs
from heel.schemas.blobs import FOREGROUND
from heel.services.geometry.histograms import soft_counts
from heel.services.tracker.evidence.arrays import Box, FloatMap, Image

Look = FloatMap
"""Three parts x three Lab channels x twelve bins; each histogram sums to 1."""
_PARTS = ((0.0, 0.18), (0.18, 0.52), (0.52, 0.98))
"""From and to, shares of the box's height from its top: head, torso and legs of a person that
stands; the shoes stay out, for their pixels are mixed with the ground. Chosen by hand."""
_BINS = 12
"""Bins of the histogram of one channel; chosen by hand."""
_LEAST_PIXELS = 12
"""Foreground pixels of a part, working size, below which its histogram says too little: one for
each bin; chosen by hand."""
_CHROMA_SPAN = 40.0
"""Units of a and b in 8-bit Lab: those of clothes stay near 128, so that only this width around it
is spread over the bins; chosen by hand."""
_VIEWS = 5
"""Views of one person that a gallery holds at most; chosen by hand."""
_NEW_VIEW = 0.18
"""Distance of descriptors, 0 to 1, to the nearest view from which a descriptor is a view of its
own; chosen by hand, below the distance at which a descriptor speaks for neither of two people."""
_VIEW_MEMORY = 20
"""Descriptors over which a view is averaged: later ones weigh one in so many; chosen by hand."""


def painted(blobs: Blobs, evidence: Image) -> Image:
    """The blobs' pixels where they were cut out, (H, W, 3) uint8 at working size, else black."""
    rows, columns = evidence.shape
    picture = np.zeros((rows, columns, 3), np.uint8)
    for blob in blobs.blobs:
        patch = blob.patch.array()
        left = round(max(0.0, blob.box_xyxy[0]) * columns / blobs.width)
        top = round(max(0.0, blob.box_xyxy[1]) * rows / blobs.height)
        width = max(1, round((blob.box_xyxy[2] - blob.box_xyxy[0]) * columns / blobs.width))
        height = max(1, round((blob.box_xyxy[3] - blob.box_xyxy[1]) * rows / blobs.height))
        if patch.shape[:2] != (height, width) and width <= columns and height <= rows:
            # A crowded message carries its pixels shrunk, see services/detector/packing.py.
            patch = np.asarray(cv2.resize(patch, (width, height)), np.uint8)
        place = picture[top : top + patch.shape[0], left : left + patch.shape[1]]
        place[:] = patch[: place.shape[0], : place.shape[1]]
    return picture


def look_of(picture: Image, evidence: Image, box: Box) -> Look | None:
    """Descriptor of the foreground in a box (working pixels); None when too little is visible."""
    left, right = max(0, round(box[0])), max(0, round(box[2]))
    height = box[3] - box[1]
    parts = []
    for start, end in _PARTS:
        top, bottom = (max(0, round(box[1] + share * height)) for share in (start, end))
        mask = evidence[top:bottom, left:right] >= FOREGROUND
        if np.count_nonzero(mask) < _LEAST_PIXELS:
            return None
        pixels = picture[top:bottom, left:right][mask].reshape(1, -1, 3)
        lab = cv2.cvtColor(pixels, cv2.COLOR_BGR2LAB).reshape(-1, 3)
        parts.append(_histograms(np.asarray(lab, np.float32)))
    return np.concatenate(parts)


def _histograms(lab: FloatMap) -> Look:
    """Histograms in which each value is shared between its two nearest bins."""
    scaled = np.empty_like(lab)
    scaled[:, 0] = lab[:, 0] * ((_BINS - 1) / 255.0)
    chroma = np.clip((lab[:, 1:] - 128.0) / _CHROMA_SPAN + 0.5, 0.0, 1.0)
    scaled[:, 1:] = chroma * (_BINS - 1)
    first = np.tile(np.arange(3) * _BINS, len(lab))
    counts = soft_counts(3 * _BINS, first, [(scaled.ravel(), _BINS, 1)])
    return np.asarray(counts / len(lab), np.float32)


def distance(a: Look, b: Look) -> float:
    """Mean L1 distance of the histograms, 0 to 1."""
    return float(np.abs(a - b).sum()) / (2.0 * 3.0 * len(_PARTS))


class Gallery:
    """Descriptors of one person: a few views that differ, each a slow mean."""

    def __init__(self) -> None:
        self._views: list[Look] = []
        self._counts: list[int] = []

    def __len__(self) -> int:
        """Descriptors taken in."""
        return sum(self._counts)

    def add(self, look: Look) -> None:
        """Take in a descriptor of the person seen in the open."""
        if self._views:
            distances = [distance(look, view) for view in self._views]
            best = int(np.argmin(distances))
            if distances[best] < _NEW_VIEW or len(self._views) >= _VIEWS:
                rate = 1.0 / min(self._counts[best] + 1, _VIEW_MEMORY)
                self._views[best] = self._views[best] + rate * (look - self._views[best])
                self._counts[best] += 1
                return
        self._views.append(look)
        self._counts.append(1)

    def distance(self, look: Look) -> float:
        """To the nearest view; 1 when there is none."""
        return min((distance(look, view) for view in self._views), default=1.0)
