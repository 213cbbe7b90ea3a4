"""The tracker on messages of a detector of people: looks, long absence, twins, a moving camera."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import CameraMotion, Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_detections import (
    BLUE,
    GREEN,
    RED,
    Colours,
    Person,
    box,
    follow,
    message,
    track_at,
)

ALMOST_RED: Colours = ((32, 34, 197), (62, 51, 42))


def standing(colours: Colours, x: float, *times_s: tuple[float, float]) -> Person:
    """Somebody who is there in these times."""

    def where(t_s: float) -> tuple[float, float] | None:
        return (x, 400.0) if any(start <= t_s < end for start, end in times_s) else None

    return Person(colours, where)


def walking(
    colours: Colours, x: float, speed: float, hidden: tuple[float, float] = (0, 0)
) -> Person:
    """Somebody who walks at px/s, without a box while hidden."""

    def where(t_s: float) -> tuple[float, float] | None:
        return None if hidden[0] <= t_s < hidden[1] else (x + speed * t_s, 400.0)

    return Person(colours, where)


def found(tracks: Tracks, x: float) -> Track:
    track = track_at(tracks, (x, 400.0))
    assert track is not None
    return track


@pytest.mark.parametrize("fps", [5.0, 10.0, 30.0])
def test_two_people_keep_their_ids_at_any_frame_rate(fps: float) -> None:
    frames = follow(
        Tracker(TrackerSettings()), [walking(RED, 100, 60), walking(GREEN, 560, -60)], 7, fps
    )
    early, late = frames[round(1.5 * fps)], frames[-1]
    last_s = 7 - 1 / fps
    assert found(early, 190).id == found(late, 100 + 60 * last_s).id
    assert found(early, 470).id == found(late, 560 - 60 * last_s).id
    assert found(late, 100 + 60 * last_s).identity_confidence > 0.8


@pytest.mark.parametrize("gone_s", [5.0, 12.0, 40.0])
@pytest.mark.parametrize("elsewhere", [100.0, 500.0])
def test_who_comes_back_gets_the_old_id_by_look_wherever(gone_s: float, elsewhere: float) -> None:
    people = [
        standing(RED, 300, (0, 4)),
        standing(RED, elsewhere, (4 + gone_s, 99)),
        standing(GREEN, 200, (0, 99)),
    ]
    frames = follow(Tracker(TrackerSettings()), people, 8 + gone_s)
    assert found(frames[30], 300).id == found(frames[-1], elsewhere).id
    assert found(frames[-1], elsewhere).identity_confidence > 0.6


def test_who_comes_back_beside_somebody_is_recognised_once_seen_alone() -> None:
    """Nothing is known of their look before that, which is not to look like nobody."""
    leaving = Person(GREEN, lambda t_s: (145 + 150 * max(0.0, t_s - 14.8), 400.0))
    people = [standing(RED, 400, (0, 4)), standing(RED, 100, (14, 99)), leaving]
    frames = follow(Tracker(TrackerSettings()), people, 16)
    before, beside, alone = found(frames[30], 400), found(frames[146], 100), found(frames[158], 100)
    assert before.id not in (beside.id, found(frames[146], 145).id)
    assert alone.id == before.id


@pytest.mark.parametrize(("after_s", "same"), [(0.3, False), (3.0, True)])
def test_who_left_on_one_side_does_not_enter_on_the_other_a_moment_later(
    after_s: float, same: bool
) -> None:
    """However alike the two are: nobody runs across the picture in that time."""
    people = [
        Person(RED, lambda t_s: (500.0 + 60 * t_s, 400.0) if t_s < 2.5 else None),
        Person(RED, lambda t_s: (10 + 40 * (t_s - 2.5 - after_s), 400.0)
               if t_s >= 2.5 + after_s else None),
        standing(GREEN, 300, (0, 99)),
    ]  # fmt: skip
    frames = follow(Tracker(TrackerSettings()), people, 5.5 + after_s)
    last = frames[-1].t_capture_ns * 1e-9
    left, entered = found(frames[15], 590), found(frames[-1], 10 + 40 * (last - 2.5 - after_s))
    assert (left.id == entered.id) == same


def test_nobody_else_gets_the_id_of_who_is_gone() -> None:
    people = [
        standing(RED, 300, (0, 4)),
        standing(BLUE, 300, (6, 99)),
        standing(GREEN, 500, (0, 99)),
    ]
    frames = follow(Tracker(TrackerSettings()), people, 12)
    old = found(frames[30], 300).id
    assert all(track.id != old for tracks in frames[80:] for track in tracks.tracks)


def test_of_two_twins_who_are_gone_none_is_recognised_with_confidence() -> None:
    people = [
        standing(RED, 150, (0, 4)),
        standing(ALMOST_RED, 350, (0, 4)),
        standing(ALMOST_RED, 550, (14, 99)),
    ]
    frames = follow(Tracker(TrackerSettings()), people, 20)
    target = found(frames[30], 150).id
    assert all(
        track.id != target or track.identity_confidence < 0.6
        for tracks in frames[141:]
        for track in tracks.tracks
    )


def test_looks_undo_what_motion_got_wrong_after_a_contact() -> None:
    """Both meet, are hidden for a second, and turn back: motion says they cross."""

    def turning(colours: Colours, x: float, speed: float) -> Person:
        def where(t_s: float) -> tuple[float, float] | None:
            way = min(t_s, 6 - t_s)
            return None if 2.6 <= t_s < 3.4 else (x + speed * way, 400.0)

        return Person(colours, where)

    frames = follow(
        Tracker(TrackerSettings()), [turning(RED, 100, 65), turning(GREEN, 520, -65)], 6
    )
    assert found(frames[10], 165).id == found(frames[-1], 106).id
    assert found(frames[10], 455).id == found(frames[-1], 514).id


def test_the_confidence_of_twins_falls_after_a_contact_and_that_of_others_does_not() -> None:
    def after(first: Colours, second: Colours) -> float:
        people = [walking(first, 100, 70, (2.5, 4.0)), walking(second, 550, -70, (2.5, 4.0))]
        last = follow(Tracker(TrackerSettings()), people, 6)[-1]
        return min(track.identity_confidence for track in last.tracks if track.shown)

    assert after(RED, GREEN) > 0.8
    assert after(RED, ALMOST_RED) < after(RED, GREEN)


@pytest.mark.parametrize("told", [True, False], ids=["told", "not told"])
def test_predictions_go_with_a_camera_that_says_how_it_moves(told: bool) -> None:
    """Somebody unseen for 0.6 s while the camera turns: only who is told still knows the place."""
    tracker = Tracker(TrackerSettings())
    shift, boxes = 0.0, []
    for seq in range(30):
        turn = 30.0 if 16 <= seq < 24 else 0.0
        shift += turn
        motion = CameraMotion(affine=(1.0, 0.0, -turn, 0.0, 1.0, 0.0), quality=0.95)
        people = [standing(RED, 400, (0, 1.7), (2.3, 99))]
        blobs = message(people, seq, 10, motion if told else None, shift)
        boxes.append(tracker.update(blobs).tracks)
    away = boxes[22][0]
    assert away.missed_frames == 6
    off = abs(away.box_xyxy[0] - (box((400 - 7 * 30.0, 400))[0]))
    assert (off < 25) == told
    if told:
        assert {track.id for tracks in boxes[3:] for track in tracks} == {1}


@pytest.mark.parametrize("told", [True, False], ids=["told", "not told"])
def test_people_who_move_alike_move_no_camera_that_says_it_stands(told: bool) -> None:
    """Two hop to and fro in step; where the third one is who is unseen is told by the camera."""

    def hopping(colours: Colours, x: float) -> Person:
        return Person(colours, lambda t_s: (x + 36.0 * (round(t_s * 10) % 8 < 4), 400.0))

    tracker = Tracker(TrackerSettings())
    still = CameraMotion(affine=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0), quality=1.0)
    people = [hopping(RED, 80), hopping(GREEN, 250), standing(BLUE, 550, (0, 8.0))]
    for seq in range(84):
        tracks = tracker.update(message(people, seq, 10, still if told else None)).tracks
    away = next(track for track in tracks if track.missed_frames)
    assert (abs(away.box_xyxy[0] - box((550, 400))[0]) < 15) == told


def test_a_camera_step_moves_places_sizes_and_speeds() -> None:
    tracker = Tracker(TrackerSettings())
    for seq in range(20):
        tracker.update(message([walking(RED, 200, 50)], seq, 10))
    zoom = CameraMotion(affine=(1.5, 0.0, -100.0, 0.0, 1.5, -100.0), quality=1.0)
    before = tracker.update(message([walking(RED, 200, 50)], 20, 10)).tracks[0]
    after = tracker.update(message([], 21, 10, zoom)).tracks[0]
    assert after.velocity_pxps[0] == pytest.approx(1.5 * before.velocity_pxps[0], rel=0.1)
    size = [np.subtract(track.box_xyxy[2:], track.box_xyxy[:2]) for track in (before, after)]
    assert size[1] == pytest.approx(1.5 * size[0], rel=0.05)


@pytest.mark.parametrize("panning", [True, False], ids=["panning", "standing"])
def test_a_jerk_that_nobody_can_tell_loses_nobody_if_the_camera_moved_before(panning: bool) -> None:
    """Where the camera stood, a box as far away is not taken for the same person."""
    tracker = Tracker(TrackerSettings())
    pan, shift, ids = 40.0 if panning else 0.0, 0.0, []
    for seq in range(16):
        step = 120.0 if seq == 12 else pan
        shift += step
        told = CameraMotion(affine=(1.0, 0.0, -step, 0.0, 1.0, 0.0), quality=0.9)
        blind = CameraMotion(affine=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0), quality=0.0)
        walker = [walking(RED, 500, 10 * pan)]
        blobs = message(walker, seq, 10, blind if seq == 12 else told, shift)
        ids.append({track.id for track in tracker.update(blobs).tracks if not track.missed_frames})
    assert ids[11] == {1}
    assert (ids[12] == {1}) == panning


def test_ids_are_not_used_again_when_the_kind_of_blobs_changes() -> None:
    tracker = Tracker(TrackerSettings())
    people = [standing(RED, 200, (0, 99)), standing(GREEN, 450, (0, 99))]
    before = {track.id for tracks in follow(tracker, people, 2) for track in tracks.tracks}
    regions = tracker.update(message([], 20, 10, kind="regions"))
    after: set[int] = set()
    for seq in range(21, 40):
        after |= {track.id for track in tracker.update(message(people, seq, 10)).tracks}
    assert before == {1, 2}
    assert regions.tracks == ()
    assert after == {3, 4}


def test_people_without_a_score_count_as_sure() -> None:
    tracker = Tracker(TrackerSettings())
    for seq in range(10):
        blobs = message([standing(RED, 200, (0, 99))], seq, 10)
        plain = tuple(blob.model_copy(update={"score": None}) for blob in blobs.blobs)
        tracks = tracker.update(blobs.model_copy(update={"blobs": plain}))
    assert [track.shown for track in tracks.tracks] == [True]


def test_who_walks_behind_another_is_occluded_by_that_one() -> None:
    near = Person(GREEN, lambda t_s: (320.0, 440.0))
    far = walking(RED, 120, 80, (2.2, 2.9))
    frames = follow(Tracker(TrackerSettings()), [near, far], 5)
    first, second = found(frames[10], 320).id, found(frames[10], 200).id
    hidden = next(track for track in frames[25].tracks if track.id == second)
    assert (hidden.state, hidden.occluded_by, hidden.missed_frames) == ("occluded", (first,), 4)
    assert found(frames[-1], 120 + 80 * 4.9).id == second
    assert frames[25].occlusion
