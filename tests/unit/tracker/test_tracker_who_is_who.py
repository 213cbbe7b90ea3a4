"""Every rule of who is who, without pictures: looks are vectors, people are placed by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heel.services.tracker.evidence.appearance import Look
from heel.services.tracker.evidence.contacts import group_of, meet
from heel.services.tracker.evidence.identity import Identities, Ids
from heel.services.tracker.evidence.kalman import FootFilter
from heel.services.tracker.evidence.lifecycle import at_border, is_torn
from heel.services.tracker.evidence.odds import Verdict, among, decide, look_nats
from heel.services.tracker.evidence.person import CERTAIN, Person

HEIGHT, RATIO, DT_S = 50.0, 0.37, 0.1
KINDS = 6


def look(kind: int, share: float = 0.0, other: int = 0) -> Look:
    """Looks of different kinds are 1 apart; `share` of another kind brings them nearer."""
    bins = np.zeros((9, 12), np.float32)
    bins[:, kind] = 1.0 - share
    bins[:, other] += share
    return bins.ravel()


def person(number: int, x: float, y: float = 100.0) -> Person:
    foot = FootFilter((x, y), HEIGHT, 1.2)
    return Person(number, foot, HEIGHT, (x, y), 1.0, confirmed=True, seen_foot=(x, y))


class Scene:
    """People with galleries, and the time."""

    def __init__(self, kinds: Sequence[int]) -> None:
        self.people = [person(number, 60.0 * number) for number in range(1, len(kinds) + 1)]
        self.ids = Ids(len(kinds) + 1)
        self.identities = Identities(self.ids)
        self.now_s = 0.0
        self.show(kinds, 12)

    def show(self, kinds: Sequence[int | Look], times: int = 12) -> None:
        """Everybody is seen in the open."""
        for _ in range(times):
            for each, kind in zip(self.people, kinds, strict=True):
                self.identities.see(each, look(kind) if isinstance(kind, int) else kind)
            self.decide()

    def decide(self) -> None:
        self.now_s += DT_S
        self.identities.decide(self.people, self.now_s)

    def hide(self, *members: int, for_s: float = 0.5) -> None:
        """These people stand in one another's way."""
        group = [self.people[index] for index in members]
        for each in group:
            each.filter.move_to(group[0].foot, HEIGHT)
            each.seen_foot = each.foot
            each.in_view = 0.3
        for _ in range(round(for_s / DT_S)):
            self.identities.meet(group, RATIO, DT_S)

    @property
    def found(self) -> list[int]:
        return [each.id for each in self.people]


@pytest.mark.parametrize(
    ("before", "after", "ids"),
    [
        ([0, 1], [0, 1], [1, 2]),
        ([0, 1], [1, 0], [2, 1]),
        ([0, 1, 2], [0, 1, 2], [1, 2, 3]),
        ([0, 1, 2], [1, 2, 0], [2, 3, 1]),
        ([0, 1, 2, 3], [3, 2, 1, 0], [4, 3, 2, 1]),
        ([0, 0], [0, 0], [1, 2]),
    ],
    ids=["pass", "exchanged", "three", "three exchanged", "four exchanged", "twins"],
)
def test_after_a_merge_looks_say_who_is_who(
    before: list[int], after: list[int], ids: list[int]
) -> None:
    scene = Scene(before)
    scene.hide(*range(len(before)))
    scene.show(after)
    assert scene.found == ids
    assert not any(each.rivals for each in scene.people)


def test_those_who_did_not_meet_are_not_exchanged() -> None:
    scene = Scene([0, 1, 2])
    scene.hide(0, 1)
    scene.show([1, 0, 2])
    assert scene.found == [2, 1, 3]


def test_a_contact_is_not_decided_before_everybody_is_seen_again() -> None:
    scene = Scene([0, 1])
    scene.hide(0, 1)
    for _ in range(9):
        scene.identities.see(scene.people[0], look(1))
        scene.decide()
    assert scene.found == [1, 2]
    assert scene.people[0].rivals


def test_where_nothing_tells_nobody_keeps_the_id() -> None:
    """Twins who stood behind one another for half a minute."""
    scene = Scene([0, 0])
    scene.hide(0, 1, for_s=30.0)
    scene.show([0, 0], times=3)
    assert scene.found == [1, 2]  # more looks might tell
    scene.show([0, 0], times=6)
    assert not {1, 2} & set(scene.found)
    assert len(set(scene.found)) == 2


def test_the_longer_hidden_the_less_sure() -> None:
    sure = []
    for for_s in (0.2, 1.0, 4.0):
        scene = Scene([0, 0])
        scene.hide(0, 1, for_s=for_s)
        scene.show([0, 0])
        sure.append(scene.people[0].identity_confidence)
        assert scene.people[0].runner_up_confidence == pytest.approx(1.0 - sure[-1], abs=0.02)
    assert sure == sorted(sure, reverse=True)
    assert sure[0] > 0.95
    assert sure[-1] < 0.8


@pytest.mark.parametrize(
    ("kind", "x", "border", "hidden_s", "recalled"),
    [
        (0, 70.0, False, 2.0, True),
        (0, 70.0, False, 15.0, True),
        (0, 70.0, False, 300.0, False),
        (1, 70.0, False, 2.0, False),
        (0, 900.0, False, 2.0, False),
        (0, 70.0, True, 2.0, True),
    ],
    ids=["same looks", "after 15 s", "too long ago", "other looks", "too far", "at the border"],
)
def test_a_newcomer_takes_the_id_of_somebody_lost_if_the_evidence_is_there(
    kind: int, x: float, border: bool, hidden_s: float, recalled: bool
) -> None:
    scene = Scene([0])
    lost = scene.people[0]
    lost.missed_frames, lost.missed_s = 9, 0.9
    scene.decide()
    scene.now_s += hidden_s
    newcomer = person(scene.ids.take(), x)
    newcomer.born_at_border = border
    scene.people = [newcomer]
    scene.show([kind])
    assert (scene.found == [1]) is recalled
    assert newcomer.identity_confidence <= CERTAIN


def test_somebody_still_looked_for_is_replaced_by_who_turned_out_to_be_them() -> None:
    scene = Scene([0])
    lost = scene.people[0]
    lost.missed_frames, lost.missed_s = 9, 0.9
    scene.decide()
    newcomer = person(scene.ids.take(), 80.0)
    scene.people = [lost, newcomer]
    for _ in range(5):
        scene.identities.see(newcomer, look(0))
        scene.decide()
    assert newcomer.id == 1
    assert lost.is_replaced
    assert not newcomer.is_replaced


def test_a_few_bad_looks_take_no_identity_away() -> None:
    """The looks of a person who stands behind a lamp post are the lamp post's."""
    scene = Scene([0, 1])
    scene.hide(0, 1)
    scene.show([5, 1], times=3)
    scene.show([0, 1])
    assert scene.found == [1, 2]


def test_somebody_who_looks_like_nobody_known_gets_a_new_id() -> None:
    scene = Scene([0, 1])
    scene.people[0].identity_confidence = 0.7
    scene.hide(0, 1)
    scene.show([5, 1])
    assert scene.found == [3, 2]


def beside(gains: Sequence[float], x: float = 70.0, newcomer_gain: float = 1.0) -> bool:
    one, newcomer = person(1, 50.0), person(2, x)
    one.gains.extend(gains)
    newcomer.gain = newcomer_gain
    return is_torn(one, newcomer)


@pytest.mark.parametrize(
    ("gains", "x", "newcomer_gain", "torn"),
    [
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 70.0, 1.0, True),
        ([1.4] * 20 + [1.4, 1.4, 1.35, 1.4], 70.0, 1.0, False),
        ([1.0] * 20 + [1.4] * 4 + [1.4, 1.0, 1.0, 1.0], 70.0, 1.0, False),
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 200.0, 1.0, False),
        ([1.4] * 20 + [0.5, 0.4, 0.3, 0.3], 70.0, 1.0, False),
        ([1.4] * 20 + [1.4, 1.0, 0.95, 0.95], 70.0, 0.2, False),
        ([1.4, 1.0, 0.95], 70.0, 1.0, False),
    ],
    ids=["pair", "passer-by", "known alone before", "far", "hidden", "newcomer unclear", "too new"],
)
def test_a_box_was_a_pair_if_a_newcomer_takes_over_what_it_explained(
    gains: list[float], x: float, newcomer_gain: float, torn: bool
) -> None:
    assert beside(gains, x, newcomer_gain) is torn


def test_the_id_of_a_pair_goes_and_contacts_know_the_new_one() -> None:
    scene = Scene([0, 1])
    scene.hide(0, 1)
    scene.identities.give_up(scene.people[0], scene.people)
    assert scene.found == [3, 2]
    assert list(scene.people[1].rivals) == [3]
    scene.show([0, 1])
    assert scene.found == [3, 2]


@pytest.mark.parametrize(
    ("x", "y", "border"),
    [(100, 120, False), (15, 120, True), (310, 120, True), (100, 55, True), (100, 235, True)],
)
def test_people_come_and_go_at_the_border(x: float, y: float, border: bool) -> None:
    assert at_border(person(1, x, y), (240, 320), RATIO) is border


def test_a_contact_joins_all_who_met_through_others() -> None:
    people = [person(number, 100.0 + 8.0 * number) for number in (1, 2, 3)] + [person(4, 300.0)]
    meet(people, RATIO, DT_S)
    by_id = {each.id: each for each in people}
    assert group_of(people[0], by_id) == [1, 2, 3]
    assert group_of(people[3], by_id) == [4]


def test_odds_of_looks_are_even_at_the_distance_that_says_nothing() -> None:
    assert among([look_nats(0.24)], 0.5).confidence == pytest.approx(0.5, abs=0.02)
    assert among([look_nats(0.1)], 0.5).confidence > 0.95
    assert among([look_nats(0.4)], 0.5).confidence < 0.1


def test_a_stranger_is_none_of_those_known() -> None:
    verdicts = decide(np.array([[20.0, 20.0], [1.0, 20.0]]), [3.0, 9.0])
    assert verdicts[0] == Verdict(-1, 0.0, 0.0)
    assert verdicts[1].column == 0
    assert verdicts[1].confidence > 0.99


COSTS = st.integers(1, 5).flatmap(
    lambda n: st.lists(st.lists(st.floats(0, 60), min_size=n, max_size=n), min_size=n, max_size=n)
)


@settings(max_examples=60, deadline=None)
@given(COSTS)
def test_verdicts_are_a_one_to_one_assignment_with_fair_confidence(
    costs: list[list[float]],
) -> None:
    nats = np.array(costs)
    verdicts = decide(nats, [10.0] * len(nats))
    known = [verdict.column for verdict in verdicts if verdict.column >= 0]
    assert len(set(known)) == len(known)
    for verdict in verdicts:
        assert 0.0 <= verdict.confidence <= 1.0
        assert 0.0 <= verdict.runner_up <= 1.0
        assert verdict.confidence + verdict.runner_up <= 1.0 + 1e-9


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["hide", "show", "lose", "come"]),
        st.integers(0, 3),
        st.integers(0, 3),
        st.integers(0, KINDS - 1),
    ),
    max_size=25,
)


@settings(max_examples=40, deadline=None)
@given(STEPS)
def test_whatever_happens_ids_are_unique_and_confidence_is_a_probability(
    steps: list[tuple[str, int, int, int]],
) -> None:
    scene = Scene([0, 1, 2])
    for action, first, second, kind in steps:
        count = len(scene.people)
        if action == "come" or count < 2:
            scene.people.append(person(scene.ids.take(), 40.0 * kind))
        elif action == "lose":
            scene.people.pop(first % count)
        elif action == "hide" and first % count != second % count:
            scene.hide(first % count, second % count, for_s=0.3 * (kind + 1))
        else:
            scene.show([(kind + index) % KINDS for index in range(count)], times=3)
        scene.people = [each for each in scene.people if not each.is_replaced]
        assert len(set(scene.found)) == len(scene.found)
        assert max(scene.found, default=0) < scene.ids.next
        for each in scene.people:
            assert 0.0 < each.identity_confidence <= 1.0
            assert 0.0 <= each.runner_up_confidence <= 1.0
            assert math.isfinite(each.identity_confidence)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]], ids=str)
def test_the_order_of_people_does_not_matter(order: list[int]) -> None:
    scene = Scene([0, 1, 2])
    scene.hide(0, 1, 2)
    people = list(scene.people)
    scene.people = [people[index] for index in order]
    scene.show([[1, 2, 0][index] for index in order])
    assert [each.id for each in people] == [2, 3, 1]
