"""The people of a recording as they lie in a window of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.motchallenge import ground_truth_file, read_ground_truth
from heel.services.geometry.boxes import areas, clipped

Boxes = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TruePeople:
    """Everybody annotated in one frame.

    Attributes:
        identities: (N,) int64.
        boxes_xyxy: (N, 4) pixels.
    """

    identities: NDArray[np.int64]
    boxes_xyxy: Boxes


NOBODY = TruePeople(np.zeros(0, np.int64), np.zeros((0, 4)))
"""A frame without people."""


@dataclass(frozen=True, slots=True)
class InWindow:
    """Everybody annotated in one frame, in the pixels of a window.

    Attributes:
        identities: (N,) int64.
        boxes_xyxy: (N, 4) cut at the window's borders; without area where nothing is inside.
        inside: (N,) share of each box's area within the recording that lies in the window.
    """

    identities: NDArray[np.int64]
    boxes_xyxy: Boxes
    inside: Boxes


def read_people(sequence: Path) -> dict[int, TruePeople]:
    """People by frame number, without those whom the ground truth says to ignore (flag 0).

    Raises:
        HeelError: there is no ground truth, or it is malformed.
    """
    rows = read_ground_truth(ground_truth_file(sequence))
    rows = rows.select(rows.values > 0)
    frames, starts = np.unique(rows.frames, return_index=True)
    ends = [*starts[1:].tolist(), len(rows)]
    return {
        frame: TruePeople(rows.identities[start:end], rows.boxes_xyxy[start:end])
        for frame, start, end in zip(frames.tolist(), starts.tolist(), ends, strict=True)
    }


def in_window(
    people: TruePeople,
    recording_size: tuple[int, int],
    offset_px: tuple[float, float],
    window_size: tuple[int, int],
) -> InWindow:
    """Everybody as the window shows them.

    Args:
        people: in pixels of the recording.
        recording_size: (width, height).
        offset_px: (left, top) of the window in the recording.
        window_size: (width, height).
    """
    shown = clipped(people.boxes_xyxy, recording_size)
    cut = clipped(shown - np.array([*offset_px, *offset_px]), window_size)
    inside = areas(cut) / np.maximum(areas(shown), 1e-9)
    return InWindow(people.identities, cut, np.asarray(inside))
