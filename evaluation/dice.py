"""The paper's accuracy: the Dice coefficient of detected and true area, frame by frame.

Patoliya & Mewada, figure 6 and equation 7: ``Acc = 100 * 2 TP / ((TP + FP) + (TP + FN))``, where TP
is the area that detected and true objects share, FP the detected area outside true objects and FN
the true area that was not detected. All boxes of a frame count as one region, so overlapping boxes
are not counted twice, and neither identities nor the IoU threshold play a part.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import AlignedSequence


def dice_per_frame(sequence: AlignedSequence) -> NDArray[np.float64]:
    """Equation 7 for every evaluated frame.

    Areas are exact areas of the boxes in square pixels, not counted on a raster, and are not cut
    at the image's edge: the same boxes as for every other score.

    Returns:
        ``(frame_count,)`` float64 percent; element ``i`` is frame ``i + 1``. A frame with only true
        or only detected boxes has 0; a frame with neither has NaN, as equation 7 is 0/0 there.
    """
    accuracy = np.full(sequence.frame_count, np.nan)
    for frame in sequence.frames:
        true_area = union_area(frame.gt_xyxy)
        detected_area = union_area(frame.tracks_xyxy)
        either_area = union_area(np.vstack([frame.gt_xyxy, frame.tracks_xyxy]))
        shared_area = true_area + detected_area - either_area
        # Rounding may carry the difference a last digit beyond what areas can share.
        shared_area = min(max(shared_area, 0.0), true_area, detected_area)
        accuracy[frame.frame - 1] = 100.0 * (shared_area / (0.5 * (true_area + detected_area)))
    return accuracy


def mean_dice(sequence: AlignedSequence) -> float:
    """Mean percent over the frames in which equation 7 is defined."""
    return float(np.nanmean(dice_per_frame(sequence)))


def union_area(boxes_xyxy: NDArray[np.float64]) -> float:
    """Area that ``(N, 4)`` boxes cover together, in square pixels.

    The boxes' edges cut the plane into at most ``(2N - 1)^2`` cells that are wholly covered or
    wholly free; the covered ones are summed.
    """
    if len(boxes_xyxy) == 0:
        return 0.0
    x = np.unique(boxes_xyxy[:, 0::2])
    y = np.unique(boxes_xyxy[:, 1::2])
    spans_x = (boxes_xyxy[:, :1] <= x[:-1]) & (boxes_xyxy[:, 2:3] >= x[1:])
    spans_y = (boxes_xyxy[:, 1:2] <= y[:-1]) & (boxes_xyxy[:, 3:] >= y[1:])
    covered = spans_y.T @ spans_x  # of booleans, so: does any box span the cell both ways?
    return float(np.diff(y) @ covered @ np.diff(x))
