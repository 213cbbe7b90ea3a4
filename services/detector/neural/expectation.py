"""Where the people who are known from earlier frames are expected in this one."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from heel.schemas import FrameId, Tracks
from heel.schemas.base import BoxXyxy
from heel.services.detector.camera_motion import Affine, compose, moved_box
from heel.services.detector.free_mask import shift_s
from heel.services.detector.neural.attention import Expected
from heel.services.detector.neural.between import Seen
from heel.services.geometry.boxes import iou_matrix

_SAME_IOU = 0.3
_REMEMBERED_FRAMES = 64


class CameraPath:
    """The motion of the camera over the last frames, frame pixels."""

    def __init__(self) -> None:
        self._steps: deque[tuple[int, Affine]] = deque(maxlen=_REMEMBERED_FRAMES)

    def add(self, seq: int, step: Affine) -> None:
        """Motion from the frame before to frame `seq`."""
        self._steps.append((seq, step))

    def since(self, seq: int) -> Affine:
        """Motion from frame `seq` to the newest."""
        total: Affine = np.eye(2, 3)
        for frame, step in self._steps:
            if frame > seq:
                total = compose(step, total)
        return total


def confirmed_people(tracks: Tracks | None, frame: FrameId, camera: CameraPath) -> list[Expected]:
    """People with an identity, moved on from the tracks' frame to this one."""
    if tracks is None:
        return []
    elapsed_s, motion = shift_s(tracks, frame), camera.since(tracks.seq)
    people = []
    for track in tracks.tracks:
        if track.state == "new":
            continue
        x, y = (elapsed_s * speed for speed in track.velocity_pxps)
        left, top, right, bottom = track.box_xyxy
        box = moved_box((left + x, top + y, right + x, bottom + y), motion)
        people.append(Expected(box, track.id))
    return people


def newcomers(before: Sequence[Seen], known: Sequence[Expected], step: Affine) -> list[Expected]:
    """Who was seen in the frame before and is nobody known."""
    boxes: list[BoxXyxy] = [moved_box(person.box_xyxy, step) for person in before]
    if not boxes or not known:
        return [Expected(box, None) for box in boxes]
    overlap = iou_matrix(np.array(boxes), np.array([person.box_xyxy for person in known]))
    free = overlap.max(axis=1) < _SAME_IOU
    return [Expected(box, None) for box, new in zip(boxes, free.tolist(), strict=True) if new]
