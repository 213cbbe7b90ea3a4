"""A newcomer comes forth from the box of a known person: on whom is the id then?"""

from __future__ import annotations

import pytest

from heel.schemas import Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_detections import (
    GREEN,
    RED,
    Colours,
    Person,
    follow,
    track_at,
)

SPEED = 40.0
FPS = 10.0
MET_S, APART_S, END_S = 4.0, 4.6, 9.0


def walker(
    colours: Colours, behind_px: float, seen_from_s: float, hidden: tuple[float, float] = (0, 0)
) -> Person:
    """A walk to the right at one speed, `behind_px` behind the first, seen in these times."""

    def where(t_s: float) -> tuple[float, float] | None:
        if t_s < seen_from_s or hidden[0] <= t_s < hidden[1]:
            return None
        apart = max(0.0, min(1.0, (t_s - APART_S) / 2.0))
        return 150.0 + SPEED * t_s - behind_px * apart, 400.0

    return Person(colours, where)


def tracks_of(first: Person, second: Person) -> list[Tracks]:
    return follow(Tracker(TrackerSettings()), [first, second], END_S, FPS)


def at(frames: list[Tracks], t_s: float, behind_px: float = 0.0) -> Track:
    seq = round(t_s * FPS)
    found = track_at(frames[seq], (150.0 + SPEED * seq / FPS - behind_px, 400.0))
    assert found is not None
    return found


def test_the_id_stays_with_the_person_that_its_gallery_is_of() -> None:
    frames = tracks_of(walker(RED, 0, 0.0), walker(GREEN, 110, APART_S + 0.8))
    chosen = at(frames, 3.5).id
    assert at(frames, 8.5).id == chosen
    assert at(frames, 8.5).identity_confidence > 0.9
    assert at(frames, 8.5, 110).id != chosen


def test_the_id_does_not_go_on_with_the_newcomer_that_took_over_the_box() -> None:
    taken = walker(RED, 110, 0.0, hidden=(MET_S, APART_S + 0.8))
    newcomer = walker(GREEN, 0, MET_S)
    frames = tracks_of(taken, newcomer)
    chosen = at(frames, 3.5).id
    assert at(frames, 8.5).id != chosen


def test_in_equal_clothes_the_id_stays_and_some_doubt_with_it() -> None:
    frames = tracks_of(walker(RED, 0, 0.0), walker(RED, 110, APART_S + 0.8))
    chosen = at(frames, 3.5).id
    late = at(frames, 8.5)
    assert late.id == chosen
    assert 0.5 < late.identity_confidence < 0.95


@pytest.mark.parametrize("colours", [RED, GREEN])
def test_while_nobody_is_seen_alone_the_confidence_says_that_it_is_open(colours: Colours) -> None:
    frames = tracks_of(walker(RED, 0, 0.0), walker(colours, 45, APART_S + 0.8))
    before = at(frames, 3.5)
    late = [track for track in frames[-1].tracks if track.id == before.id]
    assert before.identity_confidence > 0.95
    assert [0.5 < track.identity_confidence < 0.95 for track in late] == [True]
