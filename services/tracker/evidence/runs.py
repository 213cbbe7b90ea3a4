"""Vertical runs of foreground: whether people of a height line are as high as what is seen.

A line of people that are too low fills a near person with several far ones and explains nearly as
much evidence as the right line does. It shows in the runs: of people as high as the line says, few
columns of foreground are much higher than one person, while columns of foreground through the body
of a near person are as high as two or three people of too low a line.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np

from heel.services.tracker.evidence.arrays import FloatMap, Floats
from heel.services.tracker.evidence.line import Line

_GAPS = cv2.getStructuringElement(cv2.MORPH_RECT, (1, 7))
"""Working pixels, wide and high: closes belts and shadows, as between parts of one person."""
_OVERLONG = 1.5
"""Heights of a person from which a run holds more than one: two in a row, one partly behind the
other, seldom make it; chosen by hand."""
_FRAMES = 8
"""Frames whose runs are kept: a single one may show nothing but a group; chosen by hand."""
_EVERY = 2
"""Columns from one that is looked at to the next; chosen by hand for time."""


class Runs:
    """Runs of foreground in the last frames that were added."""

    def __init__(self, smallest: float) -> None:
        """Runs that end where a line has people lower than `smallest` working pixels are left out:
        nobody is looked for there."""
        self._smallest = smallest
        self._frames: deque[Floats] = deque(maxlen=_FRAMES)

    def add(self, evidence: FloatMap, shift: float) -> None:
        """Take in one frame.

        Args:
            evidence: (H, W) in [0, 1].
            shift: working pixels by which the camera has moved everything down.
        """
        mask = (evidence[:, ::_EVERY] >= 1.0).astype(np.uint8)
        closed = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _GAPS), np.int8)
        edges = np.diff(np.pad(closed, ((1, 1), (0, 0))), axis=0).T
        begin, end = np.nonzero(edges == 1)[1], np.nonzero(edges == -1)[1]
        self._frames.append(np.stack([end - shift, end - begin], axis=1).astype(np.float64))

    def overlong(self, line: Line) -> float:
        """Share of the foreground in runs too high for one person of the line, [0, 1]."""
        if not self._frames:
            return 0.0
        foot, length = np.concatenate(self._frames).T
        height = np.maximum(line.slope * foot + line.offset, 1.0)
        counts = height > self._smallest
        whole = float(length[counts].sum())
        return float(length[counts & (length > _OVERLONG * height)].sum()) / max(whole, 1.0)
