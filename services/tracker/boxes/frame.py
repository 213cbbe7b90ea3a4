"""One frame's boxes as the tracker takes them: checked and sorted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs
from heel.schemas.errors import HeelError
from heel.services.tracker.people.appearance import describe
from heel.services.tracker.people.geometry import FloatArray, boxes_to_measurements

_LEAST_SIDE_PX = 1.0
"""Least side of a box [px]: thinner ones are numerical leftovers of clipping."""


@dataclass(frozen=True)
class FrameBoxes:
    """Boxes of one frame.

    Attributes:
        boxes: (N, 4) xyxy pixels.
        raw: (N,) the detector's scores, any scale.
        scores: (N,) in [0, 1], see `ScoreScale`.
        looks: (N, D) descriptors of `appearance.describe`, or None without pictures.
        proven: (N,) whether a box is known to be on a person, not a thing.
    """

    boxes: FloatArray
    raw: FloatArray
    scores: FloatArray
    looks: FloatArray | None
    proven: NDArray[np.bool_]

    def select(self, chosen: NDArray[Any]) -> FrameBoxes:
        """The boxes at indices, or where a mask is true."""
        looks = None if self.looks is None else self.looks[chosen]
        return FrameBoxes(
            self.boxes[chosen], self.raw[chosen], self.scores[chosen], looks, self.proven[chosen]
        )

    def measurements(self) -> FloatArray:
        """(N, 4) rows as of `geometry.boxes_to_measurements`."""
        return boxes_to_measurements(self.boxes)


def checked(
    boxes: FloatArray,
    scores: FloatArray,
    looks: FloatArray | None = None,
    proven: NDArray[np.bool_] | None = None,
) -> FrameBoxes:
    """Boxes sorted by place, so that the detector's order has no influence.

    Boxes thinner than a pixel are left out.

    Args:
        boxes: (N, 4) xyxy pixels. scores: (N,). looks: (N, D) or None. proven: (N,), all if None.

    Raises:
        HeelError: shapes do not fit, a number is not finite, or a box has no area.
    """
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 4)
    scores = np.asarray(scores, dtype=np.float64)
    if scores.shape != (len(boxes),) or (looks is not None and len(looks) != len(boxes)):
        raise HeelError(f"scores of shape {scores.shape} for {len(boxes)} boxes; give one each")
    bad = ~np.isfinite(boxes).all(axis=1) | ~np.isfinite(scores)
    bad |= (boxes[:, 2:] <= boxes[:, :2]).any(axis=1)
    if bad.any():
        index = int(np.argmax(bad))
        raise HeelError(
            f"box {boxes[index].tolist()} with score {scores[index]} is not a box in pixels; "
            "give finite left < right and top < bottom"
        )
    order = np.lexsort((scores, *boxes.T))
    order = order[(boxes[order, 2:] - boxes[order, :2] > _LEAST_SIDE_PX).all(axis=1)]
    looks = None if looks is None else looks[order]
    proven = np.ones(len(scores), bool) if proven is None else proven
    return FrameBoxes(boxes[order], scores[order], scores[order], looks, proven[order])


def detected(blobs: Blobs, identify: bool) -> FrameBoxes:
    """The boxes of a message of kind "people", and, to identify people, their descriptors."""
    return checked(
        np.array([blob.box_xyxy for blob in blobs.blobs]).reshape(-1, 4),
        np.array([1.0 if blob.score is None else blob.score for blob in blobs.blobs]),
        describe([blob.patch.array() for blob in blobs.blobs]) if identify else None,
        np.array([blob.proven for blob in blobs.blobs], bool),
    )
