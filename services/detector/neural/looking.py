"""The network on a frame and on a part of it, and what both say together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.detector.neural.model import Detections, PersonModel, without_doubles
from services.detector.neural.overlap import area, intersection, iou
from services.detector.neural.views import View, Views

_EDGE_SHARE = 0.01
"""Boxes nearer to the edge of a view than this share of its height are cut off by it."""
_SAME_IOU = 0.4
_AGREE_IOU = 0.6
"""From this overlap on the boxes of both looks are averaged. Of 2571 boxes of both looks on
PETS09-S2L1 3.5 % of the closer ones miss their person (IoU below 0.5) and 2.9 % of the means; of 79
on Crossing 3.8 and 0 %, of 106 on Human3 1.9 and 0.9 %, of 206 on UAV-person11 10.7 % of both."""
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

    Who is seen in both is where both say on the average, by scores: their errors differ. Where the
    two hardly agree, the closer look counts alone: of small people the whole frame often shows the
    upper half, with as good a score.
    """
    if len(whole.boxes) and len(close.boxes):
        beyond = np.array([not part.holds((a, b, c, d)) for a, b, c, d in whole.boxes.tolist()])
        inside = intersection(close.boxes, whole.boxes[beyond]) / area(close.boxes)[:, None]
        kept = ~(inside >= _FRAGMENT).any(axis=1)
        close = Detections(close.boxes[kept], close.scores[kept])
    if len(whole.boxes) and len(close.boxes):
        whole, close = _meant(whole, close)
    boxes = np.concatenate([whole.boxes, close.boxes])
    scores = np.concatenate([whole.scores, close.scores])
    kept_of_both = without_doubles(boxes, scores)
    return Detections(boxes[kept_of_both], scores[kept_of_both])


def _meant(whole: Detections, close: Detections) -> tuple[Detections, Detections]:
    """Who is in the whole frame alone, and who is in the closer look, averaged over both."""
    overlap = iou(whole.boxes, close.boxes)
    same = overlap >= _SAME_IOU
    partner = np.where(same, whole.scores[:, None], 0.0).argmax(axis=0)
    column = np.arange(len(close.boxes))
    best = np.where(same, whole.scores[:, None], 0.0).max(axis=0)
    agree = overlap[partner, column] >= _AGREE_IOU
    share = np.where(agree, best / np.maximum(best + close.scores, 1e-9), 0.0)[:, None]
    boxes = (close.boxes + share * (whole.boxes[partner] - close.boxes)).astype(np.float32)
    seen = Detections(boxes, np.maximum(close.scores, best).astype(np.float32))
    alone = ~same.any(axis=1)
    return Detections(whole.boxes[alone], whole.scores[alone]), seen


def nobody() -> Detections:
    """No people."""
    return Detections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32))
