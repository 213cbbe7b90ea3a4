"""People whom the network misses for a moment, carried on by their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.camera_motion import Affine, moved_box
from heel.services.detector.neural.patch_flow import followed, grey_look, likeness
from heel.services.geometry.boxes import iou_matrix

_SAME_IOU = 0.3
"""From this overlap on two boxes are of the same person."""
_LEAST_LIKENESS = 0.6
"""Correlation with the pixels the network last saw, below which it is somebody or something else
by now: what passes in front takes the flow along."""
_LEAST_INSIDE = 0.8
"""A box that has left the picture farther than this share is gone."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Somebody in one frame.

    Attributes:
        box_xyxy: frame pixels.
        score: the network's in [0, 1], when it last saw them; falling since.
        carried_s: how long ago that was.
    """

    box_xyxy: BoxXyxy
    score: float
    carried_s: float = 0.0


class Between:
    """Remembers the people of the frame before and says where those are who are missing now."""

    def __init__(self, longest_s: float) -> None:
        """Carry nobody for longer than this, in which their score falls to nothing."""
        self._longest_s = longest_s
        self._before: NDArray[np.uint8] | None = None
        self._people: list[Seen] = []
        self._looks: list[NDArray[np.uint8]] = []
        self._t_ns = 0

    @property
    def people(self) -> Sequence[Seen]:
        """Who was in the frame before, carried or seen."""
        return self._people

    def update(
        self,
        grey: NDArray[np.uint8],
        t_ns: int,
        seen: Sequence[Seen],
        confirmed: Sequence[BoxXyxy],
        camera: Affine,
    ) -> list[Seen]:
        """Those who are missing among `seen`, where their pixels are now.

        Args:
            grey: (H, W) uint8, this frame; kept, so it must not be written to afterwards.
            t_ns: its time.
            seen: whom the network found in it.
            confirmed: where people with an identity are expected; nobody else is carried, so that
                no false alarm outlives the frame it was made in.
            camera: motion of the camera since the frame before, frame pixels.
        """
        elapsed_s = max(0.0, (t_ns - self._t_ns) * 1e-9)
        carried: list[Seen] = []
        looks: list[NDArray[np.uint8]] = []
        if self._before is not None and self._before.shape == grey.shape:
            for person, look in zip(self._people, self._looks, strict=True):
                gone_s = person.carried_s + elapsed_s
                taken = [one.box_xyxy for one in (*seen, *carried)]
                if gone_s >= self._longest_s or _among(moved_box(person.box_xyxy, camera), taken):
                    continue
                box = followed(self._before, grey, person.box_xyxy, camera)
                if box is None or _among(box, taken) or not _inside(box, grey):
                    continue
                alike = likeness(look, grey_look(grey, box))
                if not _among(box, confirmed) or alike < _LEAST_LIKENESS:
                    continue
                looks.append(look)
                left_s = self._longest_s - person.carried_s
                score = person.score * (self._longest_s - gone_s) / left_s
                carried.append(Seen(box, score, gone_s))
        self._before, self._t_ns = grey, t_ns
        self._people = [*seen, *carried]
        self._looks = [*(grey_look(grey, person.box_xyxy) for person in seen), *looks]
        return carried


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
