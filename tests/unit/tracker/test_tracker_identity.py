"""Who is who after a contact, by looks: on drawn people in different and in equal clothes."""

from __future__ import annotations

import pytest

from heel.schemas import Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_people import (
    BLUE,
    GREEN,
    RED,
    Walker,
    blobs_of,
    follow,
    id_at,
    track_at,
)

MEET, END = 28, 62
Colour = tuple[int, int, int]


def meeting(first: Colour, second: Colour, turn_back: bool) -> list[Walker]:
    """Two on one row who walk up to each other, overlap, and pass or go back."""

    def way(seq: int) -> float:
        return 4.0 * (2 * MEET - seq if turn_back and seq > MEET else seq)

    return [
        Walker(first, lambda seq: (45.0 + way(seq), 196.0)),
        Walker(second, lambda seq: (275.0 - way(seq), 200.0)),
    ]


def run(people: list[Walker]) -> list[Tracks]:
    return follow(Tracker(TrackerSettings()), people, range(END))


@pytest.mark.parametrize("turn_back", [False, True], ids=["pass", "turn back"])
def test_ids_are_on_the_right_people_after_a_contact(turn_back: bool) -> None:
    """Motion alone goes wrong in one of the two: looks have to decide."""
    people = meeting(RED, GREEN, turn_back)
    tracks = run(people)
    before = [id_at(tracks[18], person.box(18)) for person in people]
    after = [id_at(tracks[END - 1], person.box(END - 1)) for person in people]
    assert None not in before
    assert before == after


def both(tracks: Tracks, people: list[Walker], seq: int) -> list[Track]:
    found = [track_at(tracks, person.box(seq)) for person in people]
    return [track for track in found if track is not None]


def test_confidence_is_whole_before_lower_in_and_back_after_a_clear_contact() -> None:
    people = meeting(RED, GREEN, turn_back=False)
    tracks = run(people)
    before, after = (both(tracks[seq], people, seq) for seq in (18, END - 1))
    within = tracks[MEET + 2].tracks
    assert len(within) == 2
    assert [track.identity_confidence >= 0.99 for track in before] == [True, True]
    assert all(track.identity_confidence < 0.98 for track in within)
    assert [track.identity_confidence >= 0.99 for track in after] == [True, True]


def test_after_twins_met_the_identity_is_as_sure_as_motion_makes_it() -> None:
    people = meeting(BLUE, BLUE, turn_back=False)
    after = both(run(people)[END - 1], people, END - 1)
    assert len(after) == 2
    for track in after:
        assert 0.8 < track.identity_confidence < 0.998
        assert track.runner_up_confidence > 0.002


def test_blobs_whose_pixels_do_not_fit_the_evidence_are_tracked_all_the_same() -> None:
    tracker, people = Tracker(TrackerSettings()), meeting(RED, GREEN, turn_back=False)
    for seq in range(30):
        tracks = tracker.update(blobs_of(people, seq, width=150, height=2000))
    assert tracks.tracks


def test_settling_at_once_or_later_is_the_same_also_across_scenes() -> None:
    """Twins who stood behind one another for long lose their ids: that uses ids up."""
    people = [
        Walker(BLUE, lambda seq: (60.0 + 3.0 * min(seq, 30), 196.0)),
        Walker(BLUE, lambda seq: (240.0 - 3.0 * min(seq, 30), 200.0)),
    ]
    at_once, later = Tracker(TrackerSettings()), Tracker(TrackerSettings())
    for seq in range(70):
        blobs = blobs_of(people, seq % 35, index=seq, t_capture_ns=seq * 10**8, epoch=1 + seq // 35)
        assert at_once.update(blobs) == later.update(blobs)
        at_once.settle()
