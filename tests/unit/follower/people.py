"""Tracks of people, made in one line."""

from __future__ import annotations

from typing import Any

from heel.schemas import Track, Tracks

TRACKER = "tracker/main@00000001"
OTHER_TRACKER = "tracker/main@00000002"
WIDTH, HEIGHT = 640, 480


def person(
    track_id: int = 1, x: float = 320.0, height: float = 200.0, **changes: Any
) -> Track:  # fmt: skip
    """A person whose box is centred at `x`, feet at 400."""
    values = {
        "id": track_id, "state": "tracked",
        "box_xyxy": (x - height / 5, 400.0 - height, x + height / 5, 400.0),
        "velocity_pxps": (0.0, 0.0), "area_px": 100.0, "span_px": 10.0,
        "identity_confidence": 1.0, "shown": True,
    }  # fmt: skip
    return Track.model_validate(values | changes)


def tracks(*people: Track, seq: int = 0, epoch: int = 1) -> Tracks:
    """The tracks of one frame."""
    return Tracks(
        stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=seq * 40_000_000,
        width=WIDTH, height=HEIGHT, source_width=WIDTH, source_height=HEIGHT, tracks=people,
    )  # fmt: skip
