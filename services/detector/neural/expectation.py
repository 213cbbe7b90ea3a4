"""Where the people who are known from earlier frames are expected in this one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.schemas import FrameId, Tracks
from heel.schemas.base import BoxXyxy
from heel.services.detector.camera_motion import Affine, CameraPath, moved_box
from heel.services.detector.feedback import shift_s
from heel.services.detector.neural.attention import Expected
from heel.services.detector.neural.between import Seen
from heel.services.geometry.boxes import iou_matrix

_SAME_IOU = 0.3


def confirmed_people(tracks: Tracks | None, frame: FrameId, camera: CameraPath) -> list[Expected]:
    """People with an identity, moved on from the tracks' frame to this one."""
    motion = None if tracks is None else camera.since(tracks.seq)
    if tracks is None or motion is None:
        return []
    elapsed_s = shift_s(tracks, frame)
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
