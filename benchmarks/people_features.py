"""Features of a person's foreground, one interface for all: box and evidence to named vectors."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND
from heel.services.tracker.paper.features import FAMILIES, extract
from heel.services.tracker.people.appearance import describe

Vectors = dict[str, NDArray[np.float64]]
_STRIPS, _CELLS, _ANGLES = 6, (8, 4), 9
_LEAST_PX = 4

FEATURES: dict[str, tuple[str, ...]] = {
    "colour by body part (in use)": ("lab_parts",),
    "colour histogram": ("lab_whole",),
    "mean colour of six strips": ("strips",),
    "gradient directions": ("gradients",),
    "colour by body part and gradients": ("lab_parts", "gradients"),
    "the paper's seven": FAMILIES,
    "colour by body part and the paper's seven": ("lab_parts", *FAMILIES),
    **{f"paper: {family.replace('_', ' ')}": (family,) for family in FAMILIES},
}
"""What is compared, and which vectors it is made of."""


def vectors_of(
    image: NDArray[np.uint8], evidence: NDArray[np.uint8], box_xyxy: NDArray[np.float64]
) -> Vectors | None:
    """Every vector of a person; None where too little of the foreground is in the box.

    Args:
        image: (H, W, 3) uint8 BGR at working size.
        evidence: (H, W) uint8, the frame's evidence map.
        box_xyxy: in its pixels.
    """
    rows, columns = evidence.shape
    left, top, right, bottom = (float(value) for value in box_xyxy)
    x0, x1 = max(0, round(left)), min(columns, round(right))
    y0, y1 = max(0, round(top)), min(rows, round(bottom))
    if min(x1 - x0, y1 - y0) < _LEAST_PX:
        return None
    patch, mask = image[y0:y1, x0:x1], evidence[y0:y1, x0:x1] >= FOREGROUND
    parts = describe([patch], [mask])[0].reshape(5, -1)
    return {
        "lab_parts": parts.ravel(),
        "lab_whole": parts.mean(axis=0),
        "strips": _strips(patch, mask),
        "gradients": _gradients(patch),
        **extract(patch),
    }


def _strips(patch: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Mean Lab of the foreground in horizontal strips; of all pixels where a strip has none."""
    lab = cv2.cvtColor(patch, cv2.COLOR_BGR2LAB).astype(np.float64)
    edges = np.linspace(0, len(patch), _STRIPS + 1).round().astype(int)
    means = []
    for start, end in pairwise(edges):
        pixels, chosen = lab[start : max(end, start + 1)], mask[start : max(end, start + 1)]
        means.append(pixels[chosen].mean(axis=0) if chosen.any() else pixels.mean(axis=(0, 1)))
    return np.concatenate(means)


def _gradients(patch: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Histograms of unsigned gradient directions in cells, each normalised (N. Dalal 2005)."""
    rows, columns = _CELLS
    grey = cv2.cvtColor(cv2.resize(patch, (columns * 8, rows * 8)), cv2.COLOR_BGR2GRAY)
    x, y = cv2.spatialGradient(grey)
    strength = np.hypot(x, y)
    angle = (np.arctan2(y, x) % np.pi / np.pi * _ANGLES).astype(np.intp) % _ANGLES
    cells = np.add.outer(np.arange(rows * 8) // 8 * columns, np.arange(columns * 8) // 8)
    flat = (cells * _ANGLES + angle).ravel()
    histogram = np.bincount(flat, strength.ravel(), rows * columns * _ANGLES)
    histogram = histogram.reshape(-1, _ANGLES)
    norm = np.maximum(histogram.sum(axis=1, keepdims=True), 1.0)
    return np.asarray((histogram / norm).ravel(), np.float64)
