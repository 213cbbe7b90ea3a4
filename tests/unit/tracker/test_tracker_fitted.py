"""The default tracker on small drawn evidence maps: every rule of births, occlusion and deaths."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import Blobs, MessageError, Tracks, decode, encode
from heel.schemas.blobs import FOREGROUND, MOVING
from heel.schemas.tracks import MAX_TRACKS
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_people import (
    BLUE,
    FPS,
    GREEN,
    HEIGHT,
    RED,
    WIDTH,
    Walker,
    blobs_of,
    draw,
    follow,
    id_at,
    message,
    straight,
)


def default_tracker() -> Tracker:
    return Tracker(TrackerSettings())


def test_a_walker_is_confirmed_and_keeps_one_id_and_a_true_velocity() -> None:
    walker = straight(RED, 60, 4)
    tracks = follow(default_tracker(), [walker], range(45))
    assert {id_at(found, walker.box(seq)) for seq, found in enumerate(tracks[12:], 12)} == {1}
    last = tracks[-1].tracks[0]
    assert last.velocity_pxps == pytest.approx((4 * FPS, 0), abs=6)
    assert last.state == "tracked"
    assert last.identity_confidence >= 0.99
    assert not any(found.occlusion for found in tracks)


@pytest.mark.parametrize("settled", [(True, False), (False, True)], ids=["even", "odd"])
def test_settling_early_or_not_gives_the_same_tracks(settled: tuple[bool, bool]) -> None:
    walkers = [straight(RED, 60, 4), straight(BLUE, 250, -3, row=150)]
    eager, mixed = default_tracker(), default_tracker()
    for seq in range(40):
        blobs = blobs_of(walkers, seq)
        expected, found = eager.update(blobs), mixed.update(blobs)
        assert encode(found) == encode(expected)
        eager.settle()
        if settled[seq % 2]:
            mixed.settle()


@pytest.mark.parametrize(("evidence_class", "shown"), [(FOREGROUND, False), (MOVING, True)])
def test_a_person_counts_only_once_moving(evidence_class: int, shown: bool) -> None:
    tracker = default_tracker()
    _, standing = draw([straight(RED, 150, 0)], 1)
    for seq in range(20):
        tracks = tracker.update(
            message(np.where(standing, evidence_class, 0).astype(np.uint8), seq)
        )
    assert [track.shown for track in tracks.tracks] == [True] * shown


def test_a_lone_shadow_is_nobody() -> None:
    tracker = default_tracker()
    for seq in range(20):
        _, evidence = draw([straight(RED, 60, 4)], seq)
        tracks = tracker.update(message((evidence > 0).astype(np.uint8), seq))
    assert tracks.tracks == ()


def test_somebody_who_stands_still_keeps_the_track() -> None:
    walker = Walker(RED, lambda seq: (60.0 + 4 * min(seq, 25), 200.0))
    tracks = follow(default_tracker(), [walker], range(120))
    assert {id_at(found, walker.box(seq)) for seq, found in enumerate(tracks[15:], 15)} == {1}


def crossing(speeds: tuple[float, ...]) -> list[Walker]:
    """People on rows 14 pixels apart who all pass x = 160 in frame 30."""
    return [
        straight(colour, 160 - 30 * speed, speed, row=185.0 + 14 * index)
        for index, (colour, speed) in enumerate(zip((RED, GREEN, BLUE), speeds, strict=False))
    ]


@pytest.mark.parametrize("speeds", [(4.0, -4.0), (-4.0, 3.0), (4.0, -4.0, -2.5)], ids=str)
def test_ids_stay_on_their_people_through_merge_and_split(speeds: tuple[float, ...]) -> None:
    tracker, people = default_tracker(), crossing(speeds)
    tracks = follow(tracker, people, range(58))
    before, after = ([id_at(tracks[seq], person.box(seq)) for person in people] for seq in (18, 55))
    assert None not in before
    assert before == after
    assert len(set(before)) == len(people)


def test_who_is_hidden_is_occluded_by_the_nearer_person() -> None:
    people = crossing((4.0, -4.0))
    tracks = follow(default_tracker(), people, range(31))
    far, near = (id_at(tracks[18], person.box(18)) for person in people)
    hidden = next(track for track in tracks[30].tracks if track.id == far)
    assert tracks[30].occlusion
    assert not tracks[18].occlusion
    assert (hidden.state, hidden.occluded_by, hidden.shown) == ("occluded", (near,), True)
    front = next(track for track in tracks[30].tracks if track.id == near)
    assert (front.state, front.occluded_by) == ("tracked", ())


@pytest.mark.parametrize("width", [6, 14, 24])
def test_a_pillar_in_front_costs_no_id(width: int) -> None:
    tracker, walker = default_tracker(), straight(RED, 50, 4)
    for seq in range(60):
        picture, evidence = draw([walker], seq)
        evidence[:, 160 - width // 2 : 160 + width // 2] = 0
        tracks = tracker.update(message(evidence, seq, picture))
        if seq == 15:
            first = id_at(tracks, walker.box(seq))
    assert first is not None
    assert [track.id for track in tracks.tracks] == [first]
    assert id_at(tracks, walker.box(59)) == first


def test_someone_gone_is_first_hidden_then_forgotten_and_the_id_is_not_used_again() -> None:
    tracker = default_tracker()
    tracks = follow(tracker, [straight(RED, 60, 4, present=range(30))], range(80))
    assert tracks[29].tracks[0].shown
    assert tracks[31].tracks[0].state == "lost"
    assert tracks[31].tracks[0].missed_frames == 2
    assert not tracks[40].tracks[0].shown
    assert tracks[31].tracks[0].identity_confidence < 1.0
    assert tracks[79].tracks == ()
    later = Walker(GREEN, lambda seq: (100.0 + 4 * (seq - 80), 200.0))
    found = follow(tracker, [later], range(80, 100))
    assert [track.id for track in found[-1].tracks] == [2]


@pytest.mark.parametrize(
    "change", [{"epoch": 2}, {"stream": "rear"}, {"width": 640, "height": 480}], ids=str
)
def test_a_new_scene_forgets_everybody_and_uses_no_id_again(change: dict[str, object]) -> None:
    tracker, people = default_tracker(), crossing((4.0, -4.0))
    known = {track.id for tracks in follow(tracker, people, range(18)) for track in tracks.tracks}
    assert tracker.update(blobs_of(people, 18, **change)).tracks == ()
    after = [tracker.update(blobs_of(people, seq, **change)) for seq in range(19, 36)]
    fresh = {track.id for tracks in after for track in tracks.tracks}
    assert fresh
    assert min(fresh) > max(known)


def test_evidence_of_another_size_starts_over() -> None:
    tracker, walker = default_tracker(), straight(RED, 60, 4)
    assert follow(tracker, [walker], range(20))[-1].tracks
    evidence = draw([walker], 20)[1]
    assert tracker.update(message(evidence[::2, ::2].copy(), 20)).tracks == ()


def test_boxes_are_in_frame_pixels_whatever_the_working_size() -> None:
    walker = straight(RED, 60, 4)
    small, large = default_tracker(), default_tracker()
    for seq in range(25):
        one = small.update(blobs_of([walker], seq))
        two = large.update(blobs_of([walker], seq, width=2 * WIDTH, height=2 * HEIGHT))
    assert two.tracks[0].box_xyxy == pytest.approx([2 * v for v in one.tracks[0].box_xyxy])
    assert two.tracks[0].velocity_pxps == pytest.approx(
        [2 * v for v in one.tracks[0].velocity_pxps]
    )


def test_without_evidence_people_are_only_predicted() -> None:
    tracker, walker = default_tracker(), straight(RED, 60, 4)
    last = follow(tracker, [walker], range(25))[-1].tracks[0]
    for seq in range(25, 28):
        tracks = tracker.update(message(None, seq))
    (track,) = tracks.tracks
    assert (track.id, track.state, track.missed_frames) == (last.id, "lost", 3)
    assert track.box_xyxy[0] == pytest.approx(last.box_xyxy[0] + 12, abs=4)
    for seq in range(28, 70):
        tracks = tracker.update(message(None, seq))
    assert tracks.tracks == ()


def test_blobs_that_never_carry_evidence_give_messages_without_tracks() -> None:
    tracker = default_tracker()
    blobs = message(None, 7)
    tracks = tracker.update(blobs)
    assert (tracks.tracks, tracks.seq, tracks.t_capture_ns) == ((), 7, blobs.t_capture_ns)


def payloads(reverse: bool = False) -> list[bytes]:
    tracker, people, packed = default_tracker(), crossing((4.0, -4.0, 3.0)), []
    for seq in range(45):
        blobs = blobs_of(people, seq)
        order = blobs.blobs[::-1] if reverse else blobs.blobs
        packed.append(encode(tracker.update(blobs.model_copy(update={"blobs": order}))))
    return packed


def test_same_blobs_give_the_same_bytes_and_their_order_does_not_matter() -> None:
    first = payloads()
    assert payloads() == first
    assert payloads(reverse=True) == first


def noise(random: np.random.Generator) -> np.ndarray:
    """Rectangles of any class anywhere."""
    evidence = np.zeros((HEIGHT, WIDTH), np.uint8)
    for _ in range(int(random.integers(0, 12))):
        x, y = random.integers(0, WIDTH - 10), random.integers(0, HEIGHT - 10)
        width, height = random.integers(2, 40), random.integers(2, 80)
        evidence[y : y + height, x : x + width] = random.integers(0, 4)
    return evidence


@pytest.mark.parametrize("seed", range(3))
def test_any_evidence_gives_valid_messages_with_unique_growing_ids_and_fair_confidence(
    seed: int,
) -> None:
    tracker, random, newest = default_tracker(), np.random.default_rng(seed), 0
    people = crossing((4.0, -4.0, 3.0))
    for seq in range(60):
        evidence = np.maximum(draw(people, seq)[1], noise(random) if seq % 4 == 0 else 0)
        tracks = tracker.update(message(evidence, seq))
        assert decode(Tracks, encode(tracks)) == tracks
        ids = [track.id for track in tracks.tracks]
        assert ids == sorted(set(ids))
        assert len(ids) <= MAX_TRACKS
        assert all(0 <= track.identity_confidence <= 1 for track in tracks.tracks)
        assert all(
            track.identity_confidence + track.runner_up_confidence <= 1 for track in tracks.tracks
        )
        newest = max([newest, *ids])
    assert newest > 0


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (300, 1), (9, 7), (1024, 1024)], ids=str)
@pytest.mark.parametrize("frame", [(1, 1), (7680, 4320)], ids=str)
def test_any_size_is_tracked(size: tuple[int, int], frame: tuple[int, int]) -> None:
    tracker = default_tracker()
    for seq in range(4):
        evidence = np.full(size, MOVING, np.uint8)
        tracks = tracker.update(message(evidence, seq, width=frame[0], height=frame[1]))
        assert decode(Tracks, encode(tracks)) == tracks


@pytest.mark.parametrize(
    "times_ns",
    [
        [5] * 20,
        [(9 * 10**9, 3, 2 * 10**9)[seq % 3] for seq in range(20)],
        [10**17 * seq for seq in range(20)],
    ],
    ids=["stands still", "jumps", "races"],
)
def test_broken_clocks_give_valid_tracks(times_ns: list[int]) -> None:
    tracker = default_tracker()
    for seq, time_ns in enumerate(times_ns):
        tracks = tracker.update(blobs_of(crossing((4.0, -4.0)), seq, t_capture_ns=time_ns))
        assert decode(Tracks, encode(tracks)) == tracks


def test_unreadable_evidence_is_refused_and_changes_nothing() -> None:
    tracker, untouched = default_tracker(), default_tracker()
    good = [blobs_of(crossing((4.0, -4.0)), seq) for seq in range(20)]
    assert good[0].evidence is not None
    broken_evidence = good[0].evidence.model_copy(update={"data": b"no zlib"})
    broken: Blobs = good[0].model_copy(update={"evidence": broken_evidence, "epoch": 2})
    first = [tracker.update(blobs) for blobs in good[:10]]
    with pytest.raises(MessageError, match="zlib"):
        tracker.update(broken)
    rest = [tracker.update(blobs) for blobs in good[10:]]
    assert first + rest == [untouched.update(blobs) for blobs in good]


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="forgetfulness"):
        TrackerSettings.model_validate({"forgetfulness": 1})
    assert TrackerSettings.model_validate({"forget_s": None}) == TrackerSettings()
