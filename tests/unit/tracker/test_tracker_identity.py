"""Who is who after a contact, by looks: on drawn people in different and in equal clothes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.evidence.appearance import Gallery, distance, look_of
from heel.services.tracker.evidence.identity import Identities, Ids
from heel.services.tracker.evidence.kalman import FootFilter
from heel.services.tracker.evidence.person import Person
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_people import (
    BLUE,
    GREEN,
    HEIGHT,
    RED,
    WIDTH,
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
    assert [track.identity_confidence for track in before] == [0.99, 0.99]
    assert all(track.identity_confidence < 0.98 for track in within)
    assert [track.identity_confidence for track in after] == [0.99, 0.99]


def test_after_twins_met_the_identity_is_as_sure_as_motion_makes_it() -> None:
    people = meeting(BLUE, BLUE, turn_back=False)
    after = both(run(people)[END - 1], people, END - 1)
    assert len(after) == 2
    for track in after:
        assert 0.8 < track.identity_confidence < 0.98
        assert track.runner_up_confidence > 0.02


def flat(colour: Colour) -> NDArray[np.uint8]:
    return np.full((80, 30, 3), colour, np.uint8)


SEEN = np.full((80, 30), 3, np.uint8)
BOX = (0.0, 0.0, 30.0, 80.0)


def test_looks_differ_by_colour_and_by_which_part_wears_it() -> None:
    turned = flat(RED)
    turned[40:] = GREEN
    upside_down = turned[::-1].copy()
    red, mixed, other = (look_of(each, SEEN, BOX) for each in (flat(RED), turned, upside_down))
    assert red is not None
    assert mixed is not None
    assert other is not None
    assert distance(red, red) == 0.0
    assert distance(red, mixed) > 0.1
    assert distance(mixed, other) > 0.3
    assert max(distance(red, other), distance(mixed, other)) <= 1.0


def test_too_few_pixels_give_no_look() -> None:
    hidden = SEEN.copy()
    hidden[:, 1:] = 0
    hidden[20:] = 0
    assert look_of(flat(RED), hidden, BOX) is None
    assert (
        look_of(np.zeros((HEIGHT, WIDTH, 3), np.uint8), SEEN, (-90.0, -90.0, -50.0, -9.0)) is None
    )


def test_a_gallery_knows_several_views_of_one_person() -> None:
    gallery = Gallery()
    red, green, blue = (look_of(flat(colour), SEEN, BOX) for colour in (RED, GREEN, BLUE))
    assert red is not None
    assert green is not None
    assert blue is not None
    assert gallery.distance(red) == 1.0
    for look in (red, green, red, green):
        gallery.add(look)
    assert gallery.distance(red) == pytest.approx(0.0, abs=1e-6)
    assert gallery.distance(green) == pytest.approx(0.0, abs=1e-6)
    assert gallery.distance(blue) > 0.1
    assert len(gallery) == 4


def test_blobs_whose_pixels_do_not_fit_the_evidence_are_tracked_all_the_same() -> None:
    tracker, people = Tracker(TrackerSettings()), meeting(RED, GREEN, turn_back=False)
    for seq in range(30):
        tracks = tracker.update(blobs_of(people, seq, width=150, height=2000))
    assert tracks.tracks


def person(number: int, x: float) -> Person:
    foot = FootFilter((x, 100.0), 50.0, 1.2)
    return Person(number, foot, 50.0, (x, 100.0), 1.0, confirmed=True)


def test_whoever_is_gone_can_be_only_one_of_those_who_met_them() -> None:
    """Two met somebody in red who is gone; both now look red, but only one can be them."""
    looks = [look_of(flat(colour), SEEN, BOX) for colour in (RED, GREEN, BLUE)]
    people = [person(number, 100.0 * number) for number in (1, 2, 3)]
    identities = Identities(Ids(4))
    for _ in range(6):
        for each, look in zip(people, looks, strict=True):
            assert look is not None
            identities.see(each, look)
    identities.decide(people, 1.0)
    for near, far in ((1, 0), (2, 0)):
        people[far].filter.move_to(people[near].foot, 50.0)
        identities.meet([people[far], people[near]], 0.37, 0.1)
    red = looks[0]
    assert red is not None
    for _ in range(6):
        for each in people[1:]:
            identities.see(each, red)
    identities.decide(people[1:], 3.0)
    ids = [each.id for each in people[1:]]
    assert 1 in ids
    assert len(set(ids)) == 2


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
