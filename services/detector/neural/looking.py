"""The network on a frame and on a part of it, and what both say together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.services.detector.neural.model import Detections, PersonModel, without_doubles
from heel.services.detector.neural.views import View, Views
from heel.services.geometry.boxes import cover_matrix, iou_matrix

_EDGE_SHARE = 0.01
"""Boxes nearer to the edge of a view than this share of its height are cut off by it."""
_SAME_IOU = 0.4
_FRAGMENT = 0.7
"""A box of a view with this share of its area inside somebody larger is a piece of them."""


def look(
    model: PersonModel, image: NDArray[np.uint8], views: Views, least_score: float, part: View
) -> Detections:
    """People in a part of a frame, whole ones only.

    Args:
        model: the network.
        image: (H, W, 3) uint8 BGR, the frame.
        views: of frames of this size.
        least_score: of a person.
        part: the part, or the whole frame.

    Raises:
        HeelError: OpenCV failed on this picture.
    """
    pixels = image[part.top : part.top + part.height, part.left : part.left + part.width]
    found = model.detect(pixels, least_score)
    offset = np.array([part.left, part.top, part.left, part.top], np.float32)
    boxes = found.boxes + offset
    size, margin = (views.whole.width, views.whole.height), _EDGE_SHARE * part.height
    good = [not part.cuts((a, b, c, d), *size, margin) for a, b, c, d in boxes.tolist()]
    return Detections(boxes[good], found.scores[good])


def together(whole: Detections, close: Detections, part: View) -> Detections:
    """Both looks as one, everybody once, best first.

    Who is seen in both is where the closer look says: of small people the whole frame often shows
    the upper half alone, with as good a score.
    """
    if len(whole.boxes) and len(close.boxes):
        beyond = np.array([not part.holds((a, b, c, d)) for a, b, c, d in whole.boxes.tolist()])
        inside = cover_matrix(close.boxes, whole.boxes[beyond])
        kept = ~(inside >= _FRAGMENT).any(axis=1)
        close = Detections(close.boxes[kept], close.scores[kept])
    if len(whole.boxes) and len(close.boxes):
        same = iou_matrix(whole.boxes, close.boxes) >= _SAME_IOU
        best = np.where(same, whole.scores[:, None], 0.0).max(axis=0)
        close = Detections(close.boxes, np.maximum(close.scores, best).astype(np.float32))
        whole = Detections(whole.boxes[~same.any(axis=1)], whole.scores[~same.any(axis=1)])
    boxes = np.concatenate([whole.boxes, close.boxes])
    scores = np.concatenate([whole.scores, close.scores])
    kept_of_both = without_doubles(boxes, scores)
    return Detections(boxes[kept_of_both], scores[kept_of_both])


def nobody() -> Detections:
    """No people."""
    return Detections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32))
