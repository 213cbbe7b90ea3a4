"""Components of the evidence that look like one person: what the scene scale starts
from, and what people are born from where there is no scale."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from heel.schemas.blobs import FOREGROUND
from heel.services.tracker.evidence.arrays import Foot, Image

_CLOSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 7))
"""Working pixels, wide and high: closes gaps between the parts of one person, which lie above each
other, and few between people side by side; chosen by hand."""
_LOWEST = 0.07
"""Share of the image height below which a component is no person but clutter; chosen by hand."""
_HIGHEST = 0.75
"""Share of the image height above which a component is no whole person but a change of light, or a
person too near; chosen by hand."""
_WIDEST = 1.7
"""Height by width below which a component holds more than one standing person; chosen by hand."""
_NARROWEST = 4.5
"""Height by width above which a component is a part of a person, or a pole; chosen by hand."""
_FILL = 0.4
"""Share of its box that a component fills at least: a silhouette of one person does; chosen by
hand."""


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
