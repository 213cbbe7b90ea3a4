"""Hostile messages are what they are said to be: unreadable, a rival's, or a leap."""

from __future__ import annotations

import msgpack
import pytest

from benchmarks.hostile.mutations import CAMERA, STAMPED, TOPICS, Mutations, Wire, readable
from benchmarks.hostile_messages import Outcome, table_of
from heel.schemas import MotionCommand, Stamp, Tracks, encode, keys

PRODUCER = "tracker/main@00000001"


@pytest.fixture
def mutations() -> Mutations:
    stamp = encode(Stamp(producer=PRODUCER, t_sent_ns=1, age_ns=0))
    tracks = Tracks(stream=CAMERA, epoch=1, seq=7, index=7, t_capture_ns=1, width=64, height=48,
                    source_width=64, source_height=48)  # fmt: skip
    command = MotionCommand(seq=9, linear_mps=0.5, angular_radps=0.0, ttl_s=0.5,
                            state="following", reason="", frame=None)  # fmt: skip
    recorded = {
        keys.tracks(CAMERA): [Wire("", encode(tracks), Tracks.encoding(), stamp)],
        keys.blobs(CAMERA): [Wire("", encode(tracks), Tracks.encoding(), stamp)],
        keys.FOLLOW_COMMAND: [Wire("", encode(command), MotionCommand.encoding(), stamp)],
    }
    return Mutations(recorded, seed=3)


def test_junk_is_refused_by_whoever_reads_it_and_reaches_every_topic(mutations: Mutations) -> None:
    drawn = [mutations.draw("junk") for _ in range(600)]
    assert not any(readable(wire) for wire in drawn)
    assert {wire.key for wire in drawn} == set(TOPICS)
    assert keys.FOLLOW_ESTOP not in TOPICS, "what cannot be read there stops the robot"


def test_rivals_are_well_formed_and_never_under_the_true_name(mutations: Mutations) -> None:
    for wire in (mutations.draw("rival") for _ in range(200)):
        assert wire.attachment is not None
        assert msgpack.unpackb(wire.attachment)["producer"] != PRODUCER


def test_leaps_are_the_true_producers_with_a_number_that_nobody_reaches(
    mutations: Mutations,
) -> None:
    for wire in (mutations.draw("leap") for _ in range(50)):
        assert wire.key in STAMPED
        assert wire.attachment is not None
        assert msgpack.unpackb(wire.attachment)["producer"] == PRODUCER
        assert msgpack.unpackb(wire.payload)["seq"] >= 2**40


def test_the_same_seed_draws_the_same(mutations: Mutations) -> None:
    again = Mutations(mutations._recorded, seed=3)
    assert [again.draw("junk") for _ in range(20)] == [mutations.draw("junk") for _ in range(20)]


def test_the_table_tells_of_each_process_and_of_faults() -> None:
    outcome = Outcome(
        messages=1000, seconds=2.0, ended=(), longest_silence_s={"tracks": 0.5},
        following_before=0.9, following_during=0.8, following_after=0.9, not_following={},
        target_kept=False, growth_mb={"drive": 1.5, "router": 0.25}, log_kb=1.0,
        lines_s={"drive: follow/command": 0.92},
    )  # fmt: skip
    told = table_of(outcome)
    assert "| drive | +1.5 | 0.92 |\n| router | +0.2 | - |" in told
    assert "Faults: another target." in told
