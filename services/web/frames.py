"""The one message that carries a picture together with what is drawn over it.

    4 bytes   length N of the header, big-endian
    N bytes   header, JSON
    rest      JPEG

Boxes and pixels of a frame travel in one message, so that they cannot get apart.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from heel.schemas import FollowState, Track
from heel.services.web.joiner import Joined

FORMAT_VERSION = 1
"""Of the header; goes up when an old page would misread a new one."""


@dataclass(frozen=True, slots=True)
class ViewFrame:
    """A coded picture and the header that describes it."""

    header: dict[str, Any]
    jpeg: bytes

    def pack(self, number: int, dropped: int) -> bytes:
        """The bytes for one viewer.

        Args:
            number: what the viewer acknowledges.
            dropped: pictures this viewer has missed so far.
        """
        header = self.header | {"number": number, "dropped": dropped}
        coded = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
        return len(coded).to_bytes(4, "big") + coded + self.jpeg


def describe(joined: Joined, state: FollowState | None, age_s: float) -> dict[str, Any]:
    """The header of a frame: which one it is, its people, and which of them is the target.

    Args:
        joined: the frame.
        state: what the follower said last.
        age_s: age of the frame, seconds since acquisition.
    """
    header, tracks = joined.image.header, joined.tracks
    return {
        "v": FORMAT_VERSION,
        "stream": header.stream,
        # A JavaScript number would lose the last digits.
        "epoch": str(header.epoch),
        "seq": header.seq,
        "index": header.index,
        "width": header.width,
        "height": header.height,
        "age_ms": round(age_s * 1e3, 1),
        "tracker": joined.tracker,
        "target": _target(joined, state),
        "pending": _pending(state),
        "occlusion": tracks is not None and tracks.occlusion,
        "tracks": None if tracks is None else [_person(track) for track in tracks.tracks],
    }


def _pending(state: FollowState | None) -> list[float] | None:
    """Where a person that was pointed at is looked for, pixels."""
    if state is None or state.pending_point_px is None:
        return None
    return [round(side, 1) for side in state.pending_point_px]


def _target(joined: Joined, state: FollowState | None) -> dict[str, Any] | None:
    if state is None or state.target.track_id is None or state.target.tracker != joined.tracker:
        return None
    return {"id": state.target.track_id, "state": state.state}


def _person(track: Track) -> dict[str, Any]:
    return {
        "id": track.id,
        "state": track.state,
        "shown": track.shown,
        "box": [round(side, 1) for side in track.box_xyxy],
        "confidence": round(track.identity_confidence, 3),
        "occluded_by": track.occluded_by,
        "distance_m": None if track.distance_m is None else round(track.distance_m, 2),
    }
