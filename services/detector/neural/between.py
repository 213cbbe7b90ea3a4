"""The people between two looks of the network: expected where they were, kept by their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.base import BoxXyxy
from heel.services.detector.feedback import shift_s
from heel.services.detector.neural.views import Expected
from heel.services.geometry.boxes import iou_matrix
from heel.services.geometry.patch_flow import followed, grey_patch, likeness
from heel.services.geometry.picture_motion import Affine, CameraPath, moved_box

_SAME_IOU = 0.3  # from this overlap on two boxes are of the same person
_LEAST_LIKENESS = 0.6
"""Correlation with the pixels the network last saw, below which they are another's by now: what
passes in front takes the flow along."""
_FILLS = 0.8
"""Of the frame's height: whoever is higher fills the picture, their head or feet often beyond it,
and networks miss them for as long as they stand there; chosen by hand."""
_FILLING_S = 30.0
"""For so long somebody who fills the picture is kept by their pixels at most; chosen by hand."""
_LEAST_INSIDE = 0.8  # a box that has left the picture farther than this share is gone


@dataclass(frozen=True, slots=True)
class SeenPerson:
    """A person in one frame.

    Attributes:
        box_xyxy: frame pixels.
        score: the network's in [0, 1], when it last saw the person; falling since.
        unseen_s: how long ago that was.
    """

    box_xyxy: BoxXyxy
    score: float
    unseen_s: float = 0.0


class Between:
    """Remembers the people of the frame before and says where those are that are missing now."""

    def __init__(self, longest_s: float) -> None:
        """Keep nobody for longer than this, in which the score falls to nothing.

        Whoever fills the picture is kept for longer, unless this is 0.
        """
        self._longest_s = longest_s
        self._before: NDArray[np.uint8] | None = None
        self._people: list[SeenPerson] = []
        self._patches: list[NDArray[np.uint8]] = []
        self._t_ns = 0

    @property
    def people(self) -> Sequence[SeenPerson]:
        """Those in the frame before, kept or seen."""
        return self._people

    def update(
        self,
        grey: NDArray[np.uint8],
        t_ns: int,
        seen: Sequence[SeenPerson],
        confirmed: Sequence[BoxXyxy],
        camera: Affine,
    ) -> list[SeenPerson]:
        """Those that are missing among `seen`, where their pixels are now.

        Args:
            grey: (H, W) uint8, this frame; kept, so it must not be written to afterwards.
            t_ns: its time.
            seen: people that the network found in it.
            confirmed: where people with an identity are expected; nobody else is kept, so that
                no false alarm outlives the frame it was made in.
            camera: motion of the camera since the frame before, frame pixels.
        """
        elapsed_s = max(0.0, (t_ns - self._t_ns) * 1e-9)
        kept: list[SeenPerson] = []
        patches: list[NDArray[np.uint8]] = []
        if self._before is not None and self._before.shape == grey.shape:
            for person, patch in zip(self._people, self._patches, strict=True):
                gone_s = person.unseen_s + elapsed_s
                longest_s = self._keeps_s(person.box_xyxy, grey)
                taken = [one.box_xyxy for one in (*seen, *kept)]
                if gone_s >= longest_s or _among(moved_box(person.box_xyxy, camera), taken):
                    continue
                box = followed(self._before, grey, person.box_xyxy, camera)
                if box is None or _among(box, taken) or not _inside(box, grey):
                    continue
                alike = likeness(patch, grey_patch(grey, box))
                if not _among(box, confirmed) or alike < _LEAST_LIKENESS:
                    continue
                patches.append(patch)
                left_s = longest_s - person.unseen_s
                score = person.score * (longest_s - gone_s) / left_s
                kept.append(SeenPerson(box, score, gone_s))
        self._before, self._t_ns = grey, t_ns
        self._people = [*seen, *kept]
        self._patches = [*(grey_patch(grey, person.box_xyxy) for person in seen), *patches]
        return kept

    def _keeps_s(self, box: BoxXyxy, image: NDArray[np.uint8]) -> float:
        fills = self._longest_s > 0 and box[3] - box[1] >= _FILLS * image.shape[0]
        return max(self._longest_s, _FILLING_S) if fills else self._longest_s


def _among(box: BoxXyxy, others: Sequence[BoxXyxy]) -> bool:
    if not others:
        return False
    return bool(iou_matrix(np.array([box]), np.array(others)).max() >= _SAME_IOU)


def _inside(box: BoxXyxy, image: NDArray[np.uint8]) -> bool:
    rows, columns = image.shape
    left, top, right, bottom = box
    across = min(right, columns) - max(left, 0.0)
    down = min(bottom, rows) - max(top, 0.0)
    area = (right - left) * (bottom - top)
    return bool(min(across, down) > 0 and across * down >= _LEAST_INSIDE * area)


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


def newcomers(
    before: Sequence[SeenPerson], known: Sequence[Expected], step: Affine
) -> list[Expected]:
    """People seen in the frame before that are none of those known."""
    boxes: list[BoxXyxy] = [moved_box(person.box_xyxy, step) for person in before]
    if not boxes or not known:
        return [Expected(box, None) for box in boxes]
    overlap = iou_matrix(np.array(boxes), np.array([person.box_xyxy for person in known]))
    free = overlap.max(axis=1) < _SAME_IOU
    return [Expected(box, None) for box, new in zip(boxes, free.tolist(), strict=True) if new]
