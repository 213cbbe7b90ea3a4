"""Components of the evidence that look like one person: what the scene scale starts
from, and who is born where there is no scale."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from heel.schemas.blobs import FOREGROUND
from heel.services.tracker.fitted.arrays import Foot, Image

_CLOSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 7))
_LOWEST, _HIGHEST = 0.07, 0.75
"""Share of the image height."""
_WIDEST, _NARROWEST = 1.7, 4.5
"""Height by width."""
_FILL = 0.4


@dataclass(frozen=True)
class Sample:
    """A component that could be one whole person; working pixels."""

    foot: Foot
    height: float


def samples_of(evidence: Image) -> list[Sample]:
    """Components of the foreground that could be one whole person each."""
    rows, columns = evidence.shape
    mask = cv2.morphologyEx((evidence >= FOREGROUND).astype(np.uint8), cv2.MORPH_CLOSE, _CLOSE)
    stats = np.asarray(cv2.connectedComponentsWithStats(mask, connectivity=8)[2])
    samples = []
    for x, y, width, height, area in stats[1:].tolist():
        border = x <= 1 or y <= 1 or x + width >= columns - 1 or y + height >= rows - 1
        if border or not _LOWEST * rows < height < _HIGHEST * rows:
            continue
        if _WIDEST < height / width < _NARROWEST and area > _FILL * width * height:
            samples.append(Sample((x + width / 2.0, float(y + height)), float(height)))
    return samples
