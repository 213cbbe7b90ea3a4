"""A newcomer comes forth from the box of a known person: on whom is the id then?"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Track, Tracks
from heel.services.tracker.core import Tracker
from heel.services.tracker.people.appearance import describe
from heel.services.tracker.people.looks import LookModel
from heel.services.tracker.people.track import Track as PersonTrack
from heel.services.tracker.people.verification import Verifications
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_detections import (
    GREEN,
    RED,
    Colours,
    Person,
    follow,
    patch,
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


def test_a_doubt_that_stays_open_for_long_keeps_a_bounded_number_of_looks() -> None:
    model = LookModel()
    doubts = Verifications(model)
    known, newcomer = (
        PersonTrack(mean(x), np.zeros((4, 2, 2)), 0.9, 0.0, 0.0, 0.0) for x in (0, 60)
    )
    known.confirmed, newcomer.hits = True, 3
    looks = describe([patch(RED, seed) for seed in range(12)])
    for look in looks:
        known.remember(look, 0.0)
    doubts.note_newcomers([known, newcomer], 0.0)
    assert doubts.open(known)
    for _ in range(1000):
        assert doubts.decide([newcomer], looks[:1], 0.04) == []
    assert doubts.open(known)
    (doubt,) = doubts._open.values()
    assert [len(odds) for odds in doubt.theirs.values()] == [128]


def mean(x_px: float) -> NDArray[np.float64]:
    """State of a person 200 pixels high and 80 wide that stands there."""
    state = np.zeros((4, 2))
    state[:, 0] = x_px, 300.0, np.log(200.0), np.log(0.4)
    return state
