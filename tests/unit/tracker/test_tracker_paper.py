"""The paper's tracker on drawn blobs: births, merges, splits, identities, deaths."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from heel.schemas import Tracks, decode, encode
from heel.schemas.tracks import MAX_TRACKS
from heel.services.geometry import boxes
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_rectangles import (
    BLUE,
    GREEN,
    RED,
    WIDE,
    Walker,
    blobs_of,
    follow,
    id_at,
    message,
    plain,
)


def paper_tracker() -> Tracker:
    return Tracker(TrackerSettings(preset="paper"))


def test_a_walker_is_confirmed_and_keeps_one_id_and_a_true_velocity() -> None:
    walker = Walker(RED, 100, 8)
    tracks = follow(paper_tracker(), [walker], range(40))
    assert tracks[0].tracks[0].state == "new"
    assert not tracks[0].tracks[0].shown
    assert {id_at(found, walker.box(seq)) for seq, found in enumerate(tracks[8:], 8)} == {1}
    last = tracks[-1].tracks[0]
    assert last.velocity_pxps == pytest.approx((80, 0), abs=5)
    assert (last.span_px, last.area_px) == pytest.approx((40, 4800), rel=0.02)
    assert last.identity_confidence == 1.0


CROSSING = [Walker(RED, 100, 8), Walker(GREEN, 420, -8)]
TURNING_BACK = 20
"""Frame in which the two of `meet` stand closest."""


def cross(seq: int) -> list[Walker]:
    """The two of `CROSSING` where they stand in this frame."""
    return [Walker(walker.colour, walker.x + walker.speed * seq) for walker in CROSSING]


def meet(seq: int) -> list[Walker]:
    """Two who walk up to each other, touch, and go back the way they came: nobody crosses."""
    way = 7.0 * (seq if seq <= TURNING_BACK else 2 * TURNING_BACK - seq)
    return [Walker(RED, 150 + way), Walker(GREEN, 460 - way)]


@pytest.mark.parametrize("encounter", ["crossing", "turning back"])
def test_ids_stay_on_their_people_through_merge_and_split(encounter: str) -> None:
    """Position alone fails in one of the two encounters; features have to decide."""
    tracker = paper_tracker()
    ids, grouped = {}, False
    for seq in range(41):
        walkers = cross(seq) if encounter == "crossing" else meet(seq)
        tracks = tracker.update(blobs_of(walkers, seq))
        ids[seq] = [id_at(tracks, walker.box(seq)) for walker in walkers]
        grouped |= tracks.occlusion
    assert grouped
    assert ids[10] == ids[40]
    assert None not in ids[10]


def test_both_are_occluded_while_they_share_a_blob() -> None:
    tracks = follow(paper_tracker(), CROSSING, range(21))
    together = tracks[20]
    assert [track.state for track in together.tracks] == ["occluded", "occluded"]
    assert together.occlusion
    assert sum(len(track.occluded_by) for track in together.tracks) == 1
    assert [track.state for track in tracks[12].tracks] == ["tracked", "tracked"]
    assert not tracks[12].occlusion


def test_coasts_inside_the_common_blob_without_evidence() -> None:
    tracker = paper_tracker()
    for seq in range(21):
        blobs = blobs_of(CROSSING, seq)
        found = tracker.update(blobs)
    (blob,) = blobs.blobs
    for track in found.tracks:
        assert boxes.cover(track.box_xyxy, blob.box_xyxy) > 0.9


def test_identity_confidence_falls_in_a_group_and_is_whole_again_after_a_clear_split() -> None:
    tracks = follow(paper_tracker(), CROSSING, range(60))
    alone, together, after = tracks[12], tracks[20], tracks[59]
    assert all(track.identity_confidence == 1.0 for track in alone.tracks)
    assert all(track.identity_confidence < 1.0 for track in together.tracks)
    assert all(track.identity_confidence > 0.95 for track in after.tracks)


def test_twins_leave_the_identity_in_doubt_after_the_split() -> None:
    twins = [Walker(RED, 100, 8), Walker(RED, 420, -8)]
    after = follow(paper_tracker(), twins, range(60))[59]
    for track in after.tracks:
        assert track.identity_confidence < 0.75
        assert track.runner_up_confidence > 0.25
        assert track.identity_confidence + track.runner_up_confidence <= 1.0


APART, TOGETHER = (120.0, 320.0, 520.0), (300.0, 320.0, 340.0)


def trio(seq: int, order: tuple[int, ...]) -> list[Walker]:
    """Three come down until frame 15, gather until 35, and are apart in `order` by 55."""
    top = 130.0 + 5 * min(seq, 15)
    gathered = np.clip((seq - 15) / 20, 0, 1) - np.clip((seq - 35) / 20, 0, 1)
    homes = APART if seq < 35 else [APART[place] for place in order]
    return [
        Walker(colour, home + float(gathered) * (meeting - home), top=top)
        for colour, home, meeting in zip((RED, GREEN, BLUE), homes, TOGETHER, strict=True)
    ]


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_three_people_are_told_apart_at_the_split(order: tuple[int, ...]) -> None:
    tracker = paper_tracker()
    ids = {}
    for seq in range(56):
        people = trio(seq, order)
        tracks = tracker.update(blobs_of(people, seq))
        ids[seq] = [id_at(tracks, person.box(seq)) for person in people]
    assert None not in ids[15]
    assert ids[55] == ids[15]


def test_self_occlusion_starts_no_group_and_costs_no_id() -> None:
    """Somebody spreads the arms: wider than eq. 4 allows, but the blob count is equal."""
    tracker = paper_tracker()
    for seq in range(20):
        box = boxes.around((100 + 8.0 * seq, 260), 90 if 10 <= seq < 13 else WIDE, 120)
        tracks = tracker.update(message([plain(box)], seq))
        assert not tracks.occlusion
    assert [track.id for track in tracks.tracks if track.shown] == [1]


def test_someone_gone_is_first_hidden_then_forgotten_and_the_id_is_not_used_again() -> None:
    tracker = paper_tracker()
    tracks = follow(tracker, [Walker(RED, 100, 8, present=range(20))], range(60))
    assert tracks[19].tracks[0].shown
    assert tracks[22].tracks[0].state == "lost"
    assert not tracks[28].tracks[0].shown
    assert tracks[22].tracks[0].identity_confidence < 1.0
    assert tracks[59].tracks == ()
    later = tracker.update(blobs_of([Walker(RED, 100)], 60))
    assert [track.id for track in later.tracks] == [2]


@pytest.mark.parametrize(
    "change",
    [{"epoch": 2}, {"stream": "rear"}, {"width": 320, "height": 240}],
    ids=str,
)
def test_a_new_scene_forgets_everybody_and_uses_no_id_again(change: dict[str, object]) -> None:
    tracker = paper_tracker()
    follow(tracker, CROSSING, range(10))
    tracks = tracker.update(blobs_of(CROSSING, 0, **change))
    assert [(track.id, track.state) for track in tracks.tracks] == [(3, "new"), (4, "new")]


def many_walkers() -> list[Walker]:
    return [
        Walker(RED, 60, 8, 20),
        Walker(GREEN, 400, -8, 30),
        Walker(BLUE, 100, 6, 300),
        Walker(RED, 500, -7, 310),
    ]


def payloads(reverse: bool = False) -> list[bytes]:
    tracker = paper_tracker()
    packed = []
    for seq in range(50):
        blobs = blobs_of(many_walkers(), seq)
        order = blobs.blobs[::-1] if reverse else blobs.blobs
        packed.append(encode(tracker.update(blobs.model_copy(update={"blobs": order}))))
    return packed


def test_same_blobs_give_the_same_bytes() -> None:
    assert payloads() == payloads()


def test_the_order_of_blobs_does_not_matter() -> None:
    assert payloads() == payloads(reverse=True)


def test_random_blobs_give_valid_messages_with_unique_and_growing_ids() -> None:
    tracker = paper_tracker()
    random = np.random.default_rng(3)
    newest = 0
    for seq in range(60):
        corners = random.uniform(-50, 600, (int(random.integers(0, 30)), 2))
        sizes = random.uniform(0, 200, (len(corners), 2))
        found = [
            plain((float(x), float(y), float(x + w), float(y + h)))
            for (x, y), (w, h) in zip(corners, sizes, strict=True)
        ]
        ids = [track.id for track in tracker.update(message(found, seq)).tracks]
        assert len(ids) == len(set(ids)) <= MAX_TRACKS
        born = [number for number in ids if number > newest]
        assert born == list(range(newest + 1, newest + 1 + len(born))) or min(born) > newest
        newest = max([newest, *ids])


def test_more_blobs_than_tracks_allowed_stay_within_the_cap() -> None:
    tracker = paper_tracker()
    for seq in range(4):
        found = [
            plain((x, y, x + 8.0, y + 16.0))
            for x in np.arange(0.0, 640.0, 40.0) + 15.0 * seq
            for y in np.arange(0.0, 320.0, 40.0) + 20.0 * (seq % 2)
        ]
        tracks = tracker.update(message(found, seq))
        assert len(tracks.tracks) <= MAX_TRACKS
        assert len(encode(tracks)) <= Tracks.max_bytes


def test_frames_without_blobs_give_messages_without_tracks() -> None:
    tracker = paper_tracker()
    for seq in range(3):
        blobs = message([], seq)
        tracks = tracker.update(blobs)
        assert tracks.tracks == ()
        assert (tracks.seq, tracks.index, tracks.t_capture_ns) == (seq, seq, blobs.t_capture_ns)


@pytest.mark.parametrize("size", [(1, 1), (7680, 4320)], ids=str)
def test_any_frame_size_is_tracked(size: tuple[int, int]) -> None:
    width, height = size
    tracker = paper_tracker()
    whole = plain((0.0, 0.0, float(width), float(height)))
    for seq in range(5):
        tracks = tracker.update(message([whole], seq, width=width, height=height))
    assert [track.id for track in tracks.tracks] == [1]


@pytest.mark.parametrize(
    "times_ns", [[5, 5, 5], [9 * 10**9, 3, 2 * 10**9], [0, 10**18, 10**18 + 1]], ids=str
)
def test_broken_clocks_give_valid_tracks(times_ns: list[int]) -> None:
    tracker = paper_tracker()
    for seq, time_ns in enumerate(times_ns):
        tracks = tracker.update(blobs_of(CROSSING, seq, t_capture_ns=time_ns))
        assert decode(Tracks, encode(tracks)) == tracks
        assert tracks.tracks
