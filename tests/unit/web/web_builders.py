"""Schema objects for the tests of the web page."""

from __future__ import annotations

from heel.schemas import FollowState, Header, Target, Track, Tracks
from heel.schemas.follow import FollowStateName
from heel.services.web.joiner import HeldImage

TRACKER = "tracker/main@0123abcd"


def header(seq: int, epoch: int = 1, width: int = 64, height: int = 48) -> Header:
    return Header(
        stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=seq * 40_000_000,
        width=width, height=height, source_width=width, source_height=height,
        image_encoding="image/raw;bgr8", producer="capture/main@0123abcd",
    )  # fmt: skip


def held(seq: int, epoch: int = 1, arrived_s: float = 0.0, size: int = 10) -> HeldImage:
    return HeldImage(header(seq, epoch), bytes(size), arrived_s)


def track(identity: int, **changes: object) -> Track:
    values: dict[str, object] = {
        "id": identity, "state": "tracked", "box_xyxy": (1.0, 2.0, 11.0, 32.0),
        "velocity_pxps": (0.0, 0.0), "area_px": 300.0, "span_px": 10.0,
        "identity_confidence": 0.9, "shown": True,
    }  # fmt: skip
    return Track.model_validate(values | changes)


def tracks(seq: int, epoch: int = 1, people: tuple[Track, ...] = ()) -> Tracks:
    return Tracks(
        stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=seq * 40_000_000,
        width=64, height=48, source_width=64, source_height=48, tracks=people,
    )  # fmt: skip


def follow_state(
    track_id: int | None = None,
    tracker: str | None = None,
    state: FollowStateName = "following",
    estop: bool = False,
) -> FollowState:
    mode = "none" if track_id is None else "id"
    target = Target(seq=1, mode=mode, track_id=track_id, tracker=tracker)
    return FollowState(
        seq=3, state=state, reason="target in sight", estop=estop, target=target,
        linear_mps=0.1, angular_radps=0.0,
    )  # fmt: skip
