"""A tracker that stands by has the other one's people at every frame, or knows that it has not."""

from __future__ import annotations

import pytest

from heel.schemas import Blobs, Stamp, Tracks
from heel.services.runtime.streams import Received
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.shadow import Shadow
from tests.support.arrivals import PRODUCER
from tests.unit.tracker.test_tracker_state import walked_boxes

_STAMP = Stamp(producer=PRODUCER, t_sent_ns=0, age_ns=0)


class Pair:
    """A tracker that works, and one that stands by."""

    def __init__(self) -> None:
        self.leader = Tracker(TrackerSettings())
        self.shadow = Shadow(Tracker(TrackerSettings()))
        self.answers: list[Tracks] = []

    def lead(self, seq: int) -> tuple[Received[Blobs], Tracks]:
        blobs = walked_boxes(seq)
        self.answers.append(self.leader.update(blobs))
        return Received(blobs, _STAMP, 0.04 * seq), self.answers[-1]

    def both(self, *seqs: int) -> None:
        for seq in seqs:
            received, tracks = self.lead(seq)
            self.shadow.hear_blobs(received)
            self.shadow.hear_tracks(tracks)

    def give_state(self) -> None:
        state = self.leader.snapshot()
        assert state is not None
        self.shadow.restore(state, self.answers[-1].frame_id())


@pytest.fixture
def pair() -> Pair:
    made = Pair()
    made.both(*range(6))
    return made


def test_it_is_not_in_step_before_it_has_a_state(pair: Pair) -> None:
    assert pair.shadow.wants_state
    assert not pair.shadow.in_step
    pair.give_state()
    pair.both(6)
    assert pair.shadow.in_step
    assert not pair.shadow.wants_state


def test_a_state_that_comes_late_is_caught_up_with(pair: Pair) -> None:
    state, frame = pair.leader.snapshot(), pair.answers[-1].frame_id()
    assert state is not None
    pair.both(6, 7, 8)
    pair.shadow.restore(state, frame)
    assert pair.shadow.in_step


def test_a_frame_that_the_leader_left_out_is_left_out(pair: Pair) -> None:
    pair.give_state()
    pair.shadow.hear_blobs(Received(walked_boxes(6), _STAMP, 0.24))
    pair.both(7, 8)
    assert pair.shadow.in_step


def test_a_frame_that_never_came_here_is_noticed(pair: Pair) -> None:
    pair.give_state()
    _, tracks = pair.lead(6)
    pair.shadow.hear_tracks(tracks)
    pair.both(7)
    assert not pair.shadow.in_step
    assert pair.shadow.wants_state
    pair.give_state()
    pair.both(8)
    assert pair.shadow.in_step


def test_other_people_are_noticed(pair: Pair) -> None:
    pair.give_state()
    received, tracks = pair.lead(6)
    others = tuple(
        track.model_copy(update={"id": track.id + 1}) for track in tracks.tracks
    )  # fmt: skip
    assert others
    pair.shadow.hear_blobs(received)
    pair.shadow.hear_tracks(tracks.model_copy(update={"tracks": others}))
    assert not pair.shadow.in_step


def test_it_takes_over_with_the_frames_that_nobody_has_answered(pair: Pair) -> None:
    pair.give_state()
    pair.both(6)
    for seq in (7, 8):
        pair.shadow.hear_blobs(Received(walked_boxes(seq), _STAMP, 0.04 * seq))
    assert pair.shadow.oldest_unanswered_s == pytest.approx(0.28)
    answered = [tracks for _, tracks in pair.shadow.take_over()]
    assert answered == [pair.leader.update(walked_boxes(seq)) for seq in (7, 8)]
    assert pair.shadow.oldest_unanswered_s is None


def test_after_an_interruption_nobody_has_a_place_and_no_id_is_given_twice(pair: Pair) -> None:
    before = pair.answers[-1]
    pair.leader.interrupt()
    assert pair.leader.update(walked_boxes(7)).tracks == ()
    pair.both(*range(8, 30))
    known = {track.id for track in before.tracks}
    found = {track.id for track in pair.answers[-1].tracks}
    assert found & known, "people are known again"
    assert all(one in known or one > 200 for one in found)


def test_one_that_has_handed_over_is_in_step_with_its_successor(pair: Pair) -> None:
    successor, state = Tracker(TrackerSettings()), pair.leader.snapshot()
    assert state is not None
    successor.restore(state)
    shadow = Shadow(pair.leader)
    shadow.resume(pair.answers[-1].frame_id())
    assert shadow.in_step
    for seq in (6, 7):
        shadow.hear_blobs(Received(walked_boxes(seq), _STAMP, 0.04 * seq))
        shadow.hear_tracks(successor.update(walked_boxes(seq)))
        assert shadow.in_step
