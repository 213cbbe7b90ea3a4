"""Looks of people: the description, galleries, what a distance is worth, and contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from heel.services.tracker.people import kalman
from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH, cut_out, describe, distances
from heel.services.tracker.people.contacts import Contacts
from heel.services.tracker.people.geometry import FloatArray, boxes_to_measurements
from heel.services.tracker.people.identity import Identity
from heel.services.tracker.people.kalman import measurement_variance
from heel.services.tracker.people.looks import Gallery, LookModel, nearest_views
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.recall import Recall
from heel.services.tracker.people.track import Track
from tests.unit.tracker.drawn_detections import BLUE, GREEN, RED, Colours, patch

ALMOST_RED: Colours = ((32, 34, 197), (62, 51, 42))
BOX = np.array([[100.0, 100.0, 180.0, 300.0]])


def looks(colours: Colours, count: int, seed: int = 0) -> FloatArray:
    return describe([patch(colours, seed + k) for k in range(count)])


def person(track_id: int, colours: Colours) -> Track:
    track = Track(np.zeros((4, 2)), np.zeros((4, 2, 2)), 0.9, 0.0, 0.0, 0.0, track_id=track_id)
    for look in looks(colours, 10, 100 * track_id):
        track.gallery.add(look)
    return track


def test_looks_have_unit_length_and_do_not_depend_on_who_else_is_described() -> None:
    patches = [patch(colours, 1) for colours in (RED, GREEN, BLUE)]
    together = describe(patches)
    assert np.linalg.norm(together, axis=1) == pytest.approx(np.ones(3))
    for look, one in zip(together, patches, strict=True):
        np.testing.assert_allclose(describe([one])[0], look)


def test_nobody_and_tiny_patches_have_a_look_without_colour() -> None:
    assert describe([]).shape == (0, DESCRIPTOR_LENGTH)
    tiny = describe([np.zeros((5, 2, 3), np.uint8), np.full((4, 90, 3), 255, np.uint8)])
    assert len(np.unique(tiny)) == 1


def test_a_box_over_the_edge_is_cut_to_the_picture() -> None:
    image = np.zeros((100, 80, 3), np.uint8)
    sizes = [
        one.shape[:2] for one in cut_out(image, np.array([[-9, 50, 20, 120.0], [90, 0, 99, 9]]))
    ]
    assert sizes == [(50, 20), (9, 0)]


@pytest.mark.parametrize("scale", [1, 3])
def test_the_same_person_is_nearer_than_another_at_any_size(scale: int) -> None:
    large = [patch(RED, k).repeat(scale, 0).repeat(scale, 1) for k in range(5)]
    same = distances(looks(RED, 5, 50), describe(large))
    other = distances(looks(BLUE, 5, 50), describe(large))
    assert same.max() < other.min()


def test_a_gallery_takes_a_new_view_for_a_new_look_and_not_more_than_it_may() -> None:
    gallery = Gallery()
    for colours in (RED, RED, GREEN, BLUE):
        gallery.add(looks(colours, 1)[0])
    assert (len(gallery.views), gallery.looks) == (3, 4)
    for seed in range(40):
        rng = np.random.default_rng(seed).random(DESCRIPTOR_LENGTH) ** 8
        gallery.add(rng / np.linalg.norm(rng))
    assert len(gallery.views) == 5
    copy = gallery.copy()
    gallery.add(looks(RED, 1)[0])
    assert copy.looks == gallery.looks - 1


def test_an_empty_gallery_says_nothing() -> None:
    assert nearest_views([Gallery(), Gallery()], looks(RED, 3)).tolist() == [[1.0] * 3] * 2
    assert LookModel().compare([Gallery()], looks(RED, 2)).tolist() == [[0.0, 0.0]]


def test_what_a_look_is_worth_is_bounded_and_learned() -> None:
    model, people = LookModel(), [person(1, RED), person(2, GREEN)]
    for seed in range(60):
        both = np.concatenate([looks(RED, 1, 500 + seed), looks(GREEN, 1, 900 + seed)])
        model.learn([one.gallery for one in people], both)
    odds = model.compare([people[0].gallery], np.concatenate([looks(RED, 3), looks(BLUE, 3)]))[0]
    assert (odds[:3] > 2).all()
    assert (odds[3:] < -2).all()
    assert model.log_odds(np.array([0.0, 1.0])).tolist() == pytest.approx([6.0, -12.0])


def alone(track: Track, place: FloatArray) -> Measurement:
    """A box (4,) of its own, as of the filter's axes."""
    return Measurement(track, place, measurement_variance(place[None])[0])


def meet(
    first: Track, second: Track, seen: tuple[Colours, Colours], frames: int = 30,
    places: Sequence[FloatArray] | None = None,
) -> None:  # fmt: skip
    """Two who could be taken for each other at time 0 are seen alone, in these clothes."""
    at = places or [track.mean[:, 0] for track in (first, second)]
    contacts = Contacts(LookModel())
    contacts.touch(first, second, 0.0)
    first.confidence = second.confidence = 0.5
    assert contacts.among(first)
    known = {id(first), id(second)}
    for frame in range(1, frames):
        now = np.concatenate([looks(colours, 1, 300 + frame) for colours in seen])
        boxes = [alone(track, place) for track, place in zip((first, second), at, strict=True)]
        contacts.decide(boxes, now, known, 0.1 * frame, 0.1)
    assert not contacts.among(first)


@pytest.mark.parametrize(
    ("second", "seen", "ids", "sure"),
    [
        (GREEN, (RED, GREEN), (1, 2), True),
        (GREEN, (GREEN, RED), (2, 1), True),
        (ALMOST_RED, (RED, ALMOST_RED), (1, 2), False),
    ],
    ids=["kept", "exchanged", "twins"],
)
def test_who_is_who_after_a_contact(
    second: Colours, seen: tuple[Colours, Colours], ids: tuple[int, int], sure: bool
) -> None:
    one, other = person(1, RED), person(2, second)
    meet(one, other, seen)
    assert (one.track_id, other.track_id) == ids
    assert (one.confidence > 0.9) == (other.confidence > 0.9) == sure
    assert all(0 <= track.runner_up <= 1 for track in (one, other))


@pytest.mark.parametrize(("exchanged", "ids"), [(False, (1, 2)), (True, (2, 1))])
def test_twins_of_which_one_is_nearer_are_told_apart_by_size(
    exchanged: bool, ids: tuple[int, int]
) -> None:
    far, near = person(1, RED), person(2, RED)
    near.mean[2, 0] += 0.7
    places = [track.mean[:, 0].copy() for track in (far, near)]
    meet(far, near, (RED, RED), places=places[::-1] if exchanged else places)
    assert (far.track_id, near.track_id) == ids
    assert far.confidence > 0.9 < near.confidence


def test_a_copy_beyond_all_pictures_tells_nothing_of_a_contact() -> None:
    one, other = person(1, RED), person(2, GREEN)
    contacts = Contacts(LookModel())
    contacts.touch(one, other, 0.0)
    for copy in contacts.ahead():
        copy.mean[:, 0] = np.nan
    boxes = [alone(track, track.mean[:, 0]) for track in (one, other)]
    for frame in range(1, 30):
        now = np.concatenate([looks(colours, 1, frame) for colours in (RED, GREEN)])
        contacts.decide(boxes, now, {id(one), id(other)}, 0.1 * frame, 0.1)
    assert not contacts.among(one)
    assert one.confidence > 0.9


def test_a_contact_ends_when_one_of_the_two_is_forgotten() -> None:
    one, other = person(1, RED), person(2, GREEN)
    contacts = Contacts(LookModel())
    contacts.touch(one, other, 0.0)
    contacts.decide([], np.zeros((0, DESCRIPTOR_LENGTH)), {id(one)}, 0.1, 0.1)
    assert not contacts.among(one)


@pytest.mark.parametrize(
    ("seen", "ids"), [((RED, GREEN), (1, 2)), ((GREEN, RED), (2, 1))], ids=["kept", "exchanged"]
)
def test_a_contact_goes_on_with_the_track_that_is_taken_for_one_of_the_two(
    seen: tuple[Colours, Colours], ids: tuple[int, int]
) -> None:
    """Hidden after the contact and known again by place: the other may be that one in view."""
    one, other, back = person(1, RED), person(2, GREEN), person(0, seen[1])
    contacts = Contacts(LookModel())
    contacts.touch(one, other, 0.0)
    back.become(other, 0.9)
    contacts.go_on(other, back)
    assert contacts.among(back)
    assert not contacts.among(other)
    boxes = [alone(track, track.mean[:, 0]) for track in (one, back)]
    for frame in range(1, 30):
        now = np.concatenate([looks(colours, 1, 300 + frame) for colours in seen])
        contacts.decide(boxes, now, {id(one), id(back)}, 0.1 * frame, 0.1)
    assert not contacts.among(one)
    assert (one.track_id, back.track_id) == ids


def test_a_contact_with_the_track_that_one_is_taken_for_has_nothing_left_to_decide() -> None:
    one, other = person(1, RED), person(2, GREEN)
    contacts = Contacts(LookModel())
    contacts.touch(one, other, 0.0)
    contacts.go_on(other, one)
    assert not contacts.among(one)


def test_both_are_in_doubt_while_a_contact_is_open() -> None:
    """A box that may be the other's makes the other's next box as doubtful."""
    one, other = person(1, RED), person(2, ALMOST_RED)
    contacts = Contacts(LookModel())
    one.doubt(rivals=0.5, best=0.5, memory=1.0)
    contacts.touch(one, other, 0.0)
    contacts.decide([], np.zeros((0, DESCRIPTOR_LENGTH)), {id(one), id(other)}, 0.0, 0.1)
    assert one.confidence == pytest.approx(0.5)
    assert other.confidence == pytest.approx(0.5)
    assert other.runner_up == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("missing", "at_edge", "low", "high"),
    [
        (None, True, 1.0, 1.0),
        (GREEN, True, 0.95, 1.0),
        (ALMOST_RED, True, 0.85, 0.97),
        (ALMOST_RED, False, 0.98, 1.0),
    ],
)
def test_who_is_back_may_be_a_missing_person_of_the_same_look(
    missing: Colours | None, at_edge: bool, low: float, high: float
) -> None:
    others = [] if missing is None else [person(2, missing)]
    sure = Identity(reassure=0.0).back(person(1, RED), looks(RED, 1)[0], others, at_edge)
    assert low <= sure <= high


def doubted(seen: Colours, other: Colours, seconds: float = 4.0) -> Track:
    """A red person of whom motion is not sure, seen alone in these clothes; somebody is missing."""
    identity = Identity(reassure=1.0)
    track, missing = person(1, RED), person(2, other)
    track.confirmed = missing.confirmed = True
    track.confidence = 0.5
    known = [track, missing]
    for k in range(round(10 * seconds)):
        one = Measurement(track, BOX[0], BOX[0], look=looks(seen, 1, 500 + k)[0])
        identity.reassure([one], known, 0.1)
        identity.learn(Measured([one]), (known, []), (0.1 * k, 0.1))
    return track


@pytest.mark.parametrize(
    ("seen", "other", "settled"),
    [
        (RED, GREEN, True),
        (RED, ALMOST_RED, False),
        (BLUE, GREEN, False),
        (GREEN, GREEN, False),
    ],
    ids=["as known", "with a twin about", "like nobody known", "like who is missing"],
)
def test_looks_settle_a_doubt_and_raise_none(seen: Colours, other: Colours, settled: bool) -> None:
    sure = doubted(seen, other).confidence
    assert sure > 0.9 if settled else sure == pytest.approx(0.5, abs=0.25)
    assert sure >= 0.5


def test_who_is_in_doubt_goes_on_being_learned_but_that_does_not_settle_the_doubt() -> None:
    track = doubted(BLUE, GREEN)
    view = looks(BLUE, 1)
    assert nearest_views([track.gallery], view)[0, 0] < 0.3
    assert track.vouched is not None
    assert nearest_views([track.vouched], view)[0, 0] > 0.4


@pytest.mark.parametrize(
    ("first", "second", "now"),
    [(None, RED, 2), (RED, RED, 1), (GREEN, RED, 2)],
    ids=["nobody known so far", "as much the one as the other", "rather the other"],
)
def test_who_was_known_again_is_another_one_only_by_looks_that_fit_better(
    first: Colours | None, second: Colours, now: int
) -> None:
    recall = Recall(LookModel(), (640, 480), trust=0.75)
    place = kalman.initial_state(boxes_to_measurements(BOX))
    away = Track.born(place[0][0], place[1][0], 0.9, 0.0)
    away.become(person(2, second), 1.0)
    away.confirmed = True
    recall.lose(away, pictures=True)
    aside = kalman.initial_state(boxes_to_measurements(BOX + np.array([100.0, 0.0, 100.0, 0.0])))
    back = Track.born(aside[0][0], aside[1][0], 0.9, 20.0)
    back.track_id, back.confirmed, back.hits = 1, True, 8
    if first is not None:
        back.become(person(1, first), 1.0)
    back.gallery.add(looks(RED, 1, 7)[0])
    claims = recall.recognised([], [back], 20.0, places=True, pictures=True)
    assert [claim.known.track_id for claim in claims if claim.holds] == [2] * (now == 2)
