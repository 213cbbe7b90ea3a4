"""Blobs messages drawn from rectangles: people who touch share one blob, as a detector sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, Evidence, Patch, Tracks
from heel.schemas.base import BoxXyxy
from heel.schemas.blobs import FOREGROUND
from heel.services.geometry import boxes
from heel.services.tracker.core import Tracker

WIDTH, HEIGHT, FPS = 640, 480, 10
TALL, WIDE = 120, 40


@dataclass(frozen=True)
class Walker:
    """A person in stripes of one colour, with foot centre x at frame 0 and a speed."""

    colour: tuple[int, int, int]
    x: float
    speed: float = 0.0
    top: float = 200.0
    present: range = field(default=range(100000))

    def box(self, seq: int) -> BoxXyxy:
        return boxes.around((self.x + self.speed * seq, self.top + TALL / 2), WIDE, TALL)


RED, GREEN, BLUE = (20, 20, 230), (20, 220, 30), (230, 40, 20)
STRIPES = {RED: (12, 0), GREEN: (0, 10), BLUE: (30, 0)}
"""Height or width of a pair of stripes, pixels: in plain colours the paper's features, which are of
texture, would be told apart by errors of rounding alone."""


def clothes(colour: tuple[int, int, int], rows: int, columns: int) -> NDArray[np.uint8]:
    """(rows, columns, 3) in the stripes of a colour; plain in any other one."""
    high, wide = STRIPES.get(colour, (0, 0))
    row, column = np.mgrid[:rows, :columns]
    dark = (row % high < high // 2) if high else (column % max(wide, 1) < wide // 2)
    return np.where(dark[..., None], np.array(colour) // 2, np.array(colour)).astype(np.uint8)


def blobs_of(walkers: Sequence[Walker], seq: int, **changes: object) -> Blobs:
    """Walkers later in the list stand in front."""
    image = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    seen = np.zeros((HEIGHT, WIDTH), np.uint8)
    present = [walker for walker in walkers if seq in walker.present]
    for walker in present:
        left, top, right, bottom = (max(0, int(value)) for value in walker.box(seq))
        seen_part = image[top:bottom, left:right]
        seen_part[:] = clothes(walker.colour, *seen_part.shape[:2])
        seen[top:bottom, left:right] = FOREGROUND
    outlines = joined([walker.box(seq) for walker in present])
    return message([drawn(box, image) for box in outlines], seq, seen, **changes)


def joined(parts: Sequence[BoxXyxy]) -> list[BoxXyxy]:
    """Boxes that touch become one, as connected components do."""
    todo, done = list(parts), []
    while todo:
        box = todo.pop(0)
        touching = [other for other in todo if boxes.intersection(box, other) > 0]
        if touching:
            todo = [other for other in todo if other not in touching]
            todo.append(boxes.enclosing([box, *touching]))
        else:
            done.append(box)
    return done


def drawn(box: BoxXyxy, image: NDArray[np.uint8]) -> Blob:
    left, top, right, bottom = (max(0, int(value)) for value in box)
    return Blob(
        box_xyxy=box,
        area_px=boxes.area(box),
        centroid=boxes.centre(box),
        patch=Patch.from_array(image[top : max(bottom, top + 1), left : max(right, left + 1)]),
    )


def plain(box: BoxXyxy) -> Blob:
    """A grey blob whose patch is a single pixel."""
    return Blob(
        box_xyxy=box,
        area_px=boxes.area(box),
        centroid=boxes.centre(box),
        patch=Patch(width=1, height=1, bgr=b"\x80\x80\x80"),
    )


def message(
    found: Sequence[Blob], seq: int, seen: NDArray[np.uint8] | None = None, **changes: object
) -> Blobs:
    fields: dict[str, object] = {
        "stream": "front",
        "epoch": 1,
        "seq": seq,
        "index": seq,
        "t_capture_ns": seq * 10**9 // FPS,
        "width": WIDTH,
        "height": HEIGHT,
        "source_width": WIDTH,
        "source_height": HEIGHT,
        "blobs": tuple(found),
        "evidence": None if seen is None else Evidence.from_array(seen),
        "detector": "drawn",
    }
    return Blobs.model_validate({**fields, **changes})


def follow(tracker: Tracker, walkers: Sequence[Walker], frames: range) -> list[Tracks]:
    return [tracker.update(blobs_of(walkers, seq)) for seq in frames]


def id_at(tracks: Tracks, box: BoxXyxy) -> int | None:
    """Id of the shown track on a box, IoU above a half."""
    found = [track.id for track in tracks.tracks
             if track.shown and boxes.iou(track.box_xyxy, box) > 0.5]  # fmt: skip
    return found[0] if len(found) == 1 else None
