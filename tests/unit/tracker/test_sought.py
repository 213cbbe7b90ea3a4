"""The one person who is looked for, through the tracker core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from pydantic import ValidationError

from heel.schemas import Blob, Blobs, CameraMotion, Patch, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace import Event, Trace

_PATCH = Patch.from_array(np.zeros((2, 2, 3), np.uint8))


def blob(left: float, score: float = 0.9, proven: bool = True) -> Blob:
    return Blob(
        box_xyxy=(left, 100.0, left + 40.0, 200.0), area_px=4000.0, centroid=(left + 20.0, 150.0),
        patch=_PATCH, score=score, proven=proven,
    )  # fmt: skip


def frame(
    seq: int, seen: Blob | None, sought: int | None = 1, motion: CameraMotion | None = None
) -> Blobs:
    return Blobs(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=seq * 50_000_000,
        width=640, height=480, source_width=640, source_height=480,
        blobs=() if seen is None else (seen,), kind="people", sought=sought,
        camera_motion=motion, detector="test",
    )  # fmt: skip


def play(frames: Sequence[Blobs]) -> list[Tracks]:
    tracker = Tracker(TrackerSettings())
    return [tracker.update(each) for each in frames]


def test_they_are_shown_from_the_third_frame_on() -> None:
    told = [message.tracks for message in play([frame(k, blob(10.0)) for k in range(4)])]
    assert [len(tracks) for tracks in told] == [0, 0, 1, 1]
    assert all(track.state == "tracked" and track.shown for tracks in told for track in tracks)


def test_whether_they_are_proven_is_passed_on_as_it_is_told() -> None:
    told = [False, False, False, False, True, True]
    frames = [frame(k, blob(10.0, proven=proven)) for k, proven in enumerate(told)]
    tracks = [message.tracks[0] for message in play([*frames, frame(6, None)])[2:]]
    assert [track.proven for track in tracks] == [*told[2:], True]


def test_they_keep_their_id_wherever_and_whenever_they_come_back() -> None:
    before = [frame(k, blob(10.0)) for k in range(5)]
    gone = [frame(k, None) for k in range(5, 305)]
    after = [frame(305, blob(500.0, score=0.75))]
    messages = play([*before, *gone, *after])
    assert messages[6].tracks[0].state == "lost"
    assert not messages[100].tracks
    (back,) = messages[-1].tracks
    assert (back.id, back.state, back.identity_confidence) == (1, "tracked", 0.75)
    assert back.velocity_pxps == (0.0, 0.0)


def test_somebody_else_who_is_sought_gets_another_id() -> None:
    first = [frame(k, blob(10.0)) for k in range(5)]
    second = [frame(k, blob(10.0), sought=2) for k in range(5, 10)]
    messages = play([*first, *second])
    assert not messages[5].tracks
    assert messages[4].tracks[0].id != messages[9].tracks[0].id


def test_velocity_and_the_place_of_somebody_missed_follow_person_and_camera() -> None:
    walking = [frame(k, blob(10.0 + 2.0 * k)) for k in range(40)]
    turned = CameraMotion(affine=(1.0, 0.0, 30.0, 0.0, 1.0, 0.0), quality=1.0)
    messages = play([*walking, frame(40, None, motion=turned)])
    assert messages[39].tracks[0].velocity_pxps == pytest.approx((40.0, 0.0), abs=1.0)
    assert messages[40].tracks[0].box_xyxy[0] == pytest.approx(88.0 + 2.0 + 30.0, abs=0.5)


def test_boxes_that_shake_are_followed_and_hardly_reach_the_velocity() -> None:
    rng = np.random.default_rng(1)
    at_px = [10.0 + 2.0 * k + float(rng.normal(0.0, 1.0)) for k in range(200)]
    tracks = [message.tracks[0] for message in play(
        [frame(k, blob(left)) for k, left in enumerate(at_px)]
    )[20:]]  # fmt: skip
    off_pxps = np.array([track.velocity_pxps for track in tracks]) - (40.0, 0.0)
    off_px = np.array([track.box_xyxy[0] for track in tracks]) - at_px[20:]
    assert np.sqrt(np.mean(np.square(off_pxps), axis=0)).max() < 15.0
    assert np.sqrt(np.mean(np.square(off_px))) < 1.0


def test_only_one_can_be_sought_and_only_of_people() -> None:
    two = frame(0, blob(10.0)).model_dump() | {"blobs": (blob(1.0), blob(9.0))}
    with pytest.raises(ValidationError, match="no more than one blob"):
        Blobs.model_validate(two)
    regions = frame(0, blob(10.0)).model_dump() | {"kind": "regions"}
    with pytest.raises(ValidationError, match="needs kind 'people'"):
        Blobs.model_validate(regions)


@pytest.mark.parametrize(
    "affine",
    [
        pytest.param((-1.0, 0.0, 0.0, 0.0, -1.0, 0.0), id="mirrored"),
        pytest.param((1e8, 0.0, 0.0, 0.0, 1e8, 0.0), id="enlarged"),
        pytest.param((1.0, 0.0, 1e9, 0.0, 1.0, 1e9), id="far away"),
        pytest.param((0.0,) * 6, id="nothing"),
    ],
)
def test_an_impossible_camera_ends_no_tracker(affine: tuple[float, ...]) -> None:
    motion = CameraMotion.model_validate({"affine": affine, "quality": 1.0})
    unseen = [frame(k, None, motion=motion) for k in range(4, 9)]
    messages = play([*(frame(k, blob(10.0)) for k in range(4)), *unseen, frame(9, blob(10.0))])
    assert messages[-1].tracks[0].id == 1


def test_a_person_who_comes_back_is_not_also_remembered_as_away() -> None:
    events: list[Event] = []
    tracker = Tracker(TrackerSettings(), trace=Trace(events.append))
    for seq in range(2600):
        tracker.update(frame(seq, None if 5 <= seq < 40 else blob(10.0)))
    told = [event.kind for event in events if event.id == 1]
    assert told == ["confirmed", "unseen", "gone", "confirmed"]
