"""What the fields of a track mean, held to on the same scenes by every tracker there is.

Two people of known places are drawn for each tracker as its input: regions that melt where people
touch, an evidence map, boxes of a network that misses the hidden, or the one person pointed at.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from heel.schemas import Blob, Blobs, Patch, Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_people import BLUE, FPS, HEIGHT, RED, WIDTH, Walker, blobs_of
from tests.unit.tracker.drawn_rectangles import drawn, joined

Way = Callable[[int], tuple[float, float] | None]
TALL_FEW = 0.55
"""Share of a box under a nearer one from which a network draws none."""


def _crossing(seq: int) -> tuple[float, float]:
    return 40.0 + 4.0 * seq, 202.0


def _nearer(seq: int) -> tuple[float, float]:
    return 280.0 - 4.0 * seq, 210.0


def _stops(seq: int) -> tuple[float, float]:
    return 40.0 + 4.0 * min(seq, 25), 190.0


def _leaves(seq: int) -> tuple[float, float] | None:
    x = 150.0 - 5.0 * seq
    return (x, 190.0) if x > 0 else None


def _comes_back(seq: int) -> tuple[float, float] | None:
    """Away for longer than anybody is told of who is not seen."""
    if seq < 30:
        return 160.0 - 2.0 * seq, 190.0
    return None if seq < 70 else (100.0 - 1.0 * (seq - 70), 190.0)


@dataclass(frozen=True)
class Scene:
    """Two people by their feet, and how many frames they are seen for."""

    first: Way
    second: Way
    frames: int


SCENES = {
    "merge, occlusion and split": Scene(_crossing, _nearer, 58),
    "stand still": Scene(_stops, lambda seq: (300.0 - 3.0 * min(seq, 30), 215.0), 60),
    "leave": Scene(_leaves, lambda seq: (300.0 - 3.0 * min(seq, 30), 215.0), 80),
    "return": Scene(_comes_back, lambda seq: (300.0 - 1.0 * min(seq, 40), 215.0), 100),
}


def _walkers(scene: Scene) -> list[Walker]:
    return [Walker(RED, scene.first), Walker(BLUE, scene.second)]


def regions(scene: Scene, seq: int) -> Blobs:
    return blobs_of(_walkers(scene), seq)


def melted(scene: Scene, seq: int) -> Blobs:
    """Full rectangles: where two touch there is one blob."""
    present = [each for each in _walkers(scene) if each.where(seq) is not None]
    image = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    for each in sorted(present, key=lambda walker: walker.box(seq)[3]):
        left, top, right, bottom = (max(0, int(value)) for value in each.box(seq))
        image[top:bottom, left:right] = each.colour
    outlines = [box for box in joined([each.box(seq) for each in present]) if box[2] > 1]
    return _message(seq, [drawn(box, image) for box in outlines])


def boxes(scene: Scene, seq: int) -> Blobs:
    """As a network sees them: none where a nearer one covers most of a person."""
    present = [each for each in _walkers(scene) if each.where(seq) is not None]
    found = [
        _blob(each, seq)
        for each in present
        if not any(_covers(other, each, seq) for other in present if other is not each)
    ]
    return _message(seq, found, kind="people")


def one_alone(scene: Scene, seq: int) -> Blobs:
    """The first person alone, whom the detector looks for."""
    first = _walkers(scene)[0]
    seen = first.where(seq) is not None and _blob(first, seq) in boxes(scene, seq).blobs
    return _message(seq, [_blob(first, seq)] if seen else [], kind="people", sought=1)


def _covers(nearer: Walker, farther: Walker, seq: int) -> bool:
    front, behind = nearer.box(seq), farther.box(seq)
    across = min(front[2], behind[2]) - max(front[0], behind[0])
    return front[3] > behind[3] and across > TALL_FEW * (behind[2] - behind[0])


def _blob(walker: Walker, seq: int) -> Blob:
    left, top, right, bottom = walker.box(seq)
    pixels = np.full((24, 12, 3), walker.colour, np.uint8)
    pixels[12:] //= 2
    return Blob(
        box_xyxy=(left, top, right, bottom), area_px=(right - left) * (bottom - top),
        centroid=((left + right) / 2, (top + bottom) / 2), patch=Patch.from_array(pixels),
        score=0.9,
    )  # fmt: skip


def _message(seq: int, blobs: list[Blob], **changes: object) -> Blobs:
    return Blobs.model_validate({
        "stream": "front", "epoch": 1, "seq": seq, "index": seq, "width": WIDTH, "height": HEIGHT,
        "t_capture_ns": seq * 10**9 // FPS, "source_width": WIDTH, "source_height": HEIGHT,
        "detector": "drawn", "blobs": tuple(blobs), **changes,
    })  # fmt: skip


TRACKERS: dict[str, tuple[str, Callable[[Scene, int], Blobs]]] = {
    "foreground": ("default", regions),
    "paper": ("paper", melted),
    "people": ("default", boxes),
    "pointed-at": ("default", one_alone),
}
EVERYBODY = ("foreground", "paper", "people")
"""Trackers of all who are in sight."""


@functools.cache
def played(tracker: str, scene: str) -> list[Tracks]:
    preset, made = TRACKERS[tracker]
    core = Tracker(TrackerSettings.model_validate({"preset": preset}))
    return [core.update(made(SCENES[scene], seq)) for seq in range(SCENES[scene].frames)]


def on(tracks: Tracks, place: tuple[float, float] | None) -> Track | None:
    """The shown track whose box stands on a place."""
    assert place is not None
    found = [
        track
        for track in tracks.tracks
        if track.shown
        and abs((track.box_xyxy[0] + track.box_xyxy[2]) / 2 - place[0]) < 9
        and abs(track.box_xyxy[3] - place[1]) < 15
    ]
    return found[0] if len(found) == 1 else None


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("tracker", TRACKERS)
def test_every_track_is_what_the_schema_says(tracker: str, scene: str) -> None:
    """The definitions at `heel.schemas.Track`, frame by frame."""
    states = set()
    for tracks in played(tracker, scene):
        by_id = {track.id: track for track in tracks.tracks}
        assert list(by_id) == sorted(track.id for track in tracks.tracks), "by id, each once"
        assert tracks.occlusion == any(track.state == "occluded" for track in tracks.tracks)
        for track in tracks.tracks:
            states.add(track.state)
            left, top, right, bottom = track.box_xyxy
            assert (track.span_px, track.area_px) == (right - left, (right - left) * (bottom - top))
            assert track.identity_confidence + track.runner_up_confidence <= 1.0 + 1e-9
            assert track.proven
            assert track.distance_m is track.bearing_rad is None, "nothing has measured it"
            assert not (track.state == "new" and track.shown)
            assert track.state != "tracked" or track.missed_frames == 0
            assert track.state != "lost" or track.missed_frames > 0
            assert track.state == "occluded" or track.occluded_by == ()
            assert track.missed_frames == 0 or track.state != "occluded" or track.occluded_by
            before_it = [by_id[other].box_xyxy for other in track.occluded_by]
            assert all(box[3] >= bottom - 0.1 * (bottom - top) for box in before_it), "nearer"
            assert all(box[0] < right and box[2] > left for box in before_it), "before it"
            assert before_it == sorted(before_it, key=lambda box: -box[3]), "nearest first"
    assert "tracked" in states


@pytest.mark.parametrize("tracker", EVERYBODY)
def test_a_person_behind_another_is_occluded_and_comes_out_with_the_same_id(tracker: str) -> None:
    scene, frames = (
        SCENES["merge, occlusion and split"],
        played(tracker, "merge, occlusion and split"),
    )
    ids = {}
    for seq in (22, 55):
        found = [on(frames[seq], way(seq)) for way in (scene.first, scene.second)]
        assert [track and track.state for track in found] == ["tracked", "tracked"], seq
        ids[seq] = [track.id for track in found if track]
    assert ids[22] == ids[55]
    far, near = ids[22]
    behind = [track for track in frames[30].tracks if track.id == far]
    assert [(track.state, track.occluded_by) for track in behind] == [("occluded", (near,))]
    sure = {seq: track.identity_confidence for seq, tracks in enumerate(frames)
            for track in tracks.tracks if track.id == far}  # fmt: skip
    if tracker != "people":  # whose boxes never melt
        assert min(sure[seq] for seq in range(24, 50)) < sure[22], "it is open which is which"


def test_one_person_pointed_at_is_lost_while_hidden_and_the_same_after() -> None:
    frames = played("pointed-at", "merge, occlusion and split")
    states = [track.state for tracks in frames for track in tracks.tracks]
    runs = [state for state, _ in itertools.groupby(states)]
    assert runs == ["tracked", "lost", "tracked"]
    assert {track.id for tracks in frames for track in tracks.tracks} == {1}


@pytest.mark.parametrize("tracker", TRACKERS)
def test_a_person_who_stands_stays_tracked_with_one_id(tracker: str) -> None:
    scene, frames = SCENES["stand still"], played(tracker, "stand still")
    found = [on(frames[seq], scene.first(seq)) for seq in range(20, scene.frames)]
    assert {track and track.state for track in found} == {"tracked"}
    assert len({track and track.id for track in found}) == 1
    assert abs(found[-1].velocity_pxps[0]) < 4.0 if found[-1] else False


@pytest.mark.parametrize("tracker", TRACKERS)
def test_a_person_who_left_is_hidden_soon_and_nobody_gets_the_id(tracker: str) -> None:
    scene, frames = SCENES["leave"], played(tracker, "leave")
    left = next(track.id for track in frames[15].tracks if track.shown
                and track.box_xyxy[2] < 150)  # fmt: skip
    gone = next(seq for seq in range(scene.frames) if scene.first(seq) is None)
    after = [track for tracks in frames[gone + FPS :] for track in tracks.tracks]
    assert not any(track.id == left and track.shown for track in after)
    assert left not in {track.id for track in frames[-1].tracks}


@pytest.mark.parametrize("tracker", TRACKERS)
def test_a_person_who_returns_is_known_or_new_but_never_the_other(tracker: str) -> None:
    scene, frames = SCENES["return"], played(tracker, "return")
    before, other = on(frames[25], scene.first(25)), on(frames[25], scene.second(25))
    back = on(frames[-1], scene.first(scene.frames - 1))
    assert before is not None
    assert back is not None
    assert (other is not None) == (tracker != "pointed-at")
    seen = {track.id for tracks in frames[:70] for track in tracks.tracks}
    assert back.id == before.id or back.id not in seen
    if tracker in ("people", "pointed-at"):
        assert back.id == before.id, "by appearance"
    away = [track for tracks in frames[33:70] for track in tracks.tracks if track.id == before.id]
    assert {track.state for track in away} <= {"lost"}


@pytest.mark.parametrize("tracker", ["foreground", "people", "pointed-at"])
def test_the_longer_a_person_is_out_of_sight_the_less_sure_is_the_id(tracker: str) -> None:
    """Not the published method's, whose confidence is that of its last decision."""
    scene, frames = SCENES["return"], played(tracker, "return")
    known = on(frames[25], scene.first(25))
    assert known is not None
    unseen = [track.identity_confidence for tracks in frames[33:70] for track in tracks.tracks
              if track.id == known.id]  # fmt: skip
    assert unseen, "it is still told of"
    assert all(later < sooner for sooner, later in itertools.pairwise(unseen))
    assert unseen[0] < known.identity_confidence
