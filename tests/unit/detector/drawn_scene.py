"""Small drawn frames: a textured background and rectangles that stand for people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Track, Tracks

WIDTH, HEIGHT, FPS = 320, 240, 10
Person = tuple[int, int, int, int]
"""left, top, width, height, pixels."""


def background(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.uint8]:
    coarse = np.random.default_rng(1).integers(90, 130, (height // 8 + 1, width // 8 + 1, 3))
    return np.kron(coarse, np.ones((8, 8, 1)))[:height, :width].astype(np.uint8)


def frame_image(people: Sequence[Person] = ()) -> NDArray[np.uint8]:
    image = background()
    for left, top, width, height in people:
        image[top : top + height, left : left + width] = (30, 40, 220)
    return image


def frame_id(seq: int, epoch: int = 1) -> FrameId:
    return FrameId(stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=seq * 10**9 // FPS)


def tracks_of(seq: int, boxes: Sequence[Person], **changes: object) -> Tracks:
    def track(number: int, person: Person) -> Track:
        left, top, width, height = person
        fields: dict[str, object] = {
            "id": number,
            "state": "tracked",
            "box_xyxy": (float(left), float(top), float(left + width), float(top + height)),
            "velocity_pxps": (0.0, 0.0),
            "area_px": float(width * height),
            "span_px": float(width),
            "identity_confidence": 1.0,
            "shown": True,
        }
        return Track.model_validate({**fields, **changes})

    return Tracks(
        **frame_id(seq).model_dump(),
        width=WIDTH,
        height=HEIGHT,
        source_width=WIDTH,
        source_height=HEIGHT,
        tracks=tuple(track(number, box) for number, box in enumerate(boxes, 1)),
    )
