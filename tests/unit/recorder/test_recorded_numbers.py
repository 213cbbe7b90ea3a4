"""What is missing of a recording is counted by the numbers of its senders."""

from __future__ import annotations

import pytest

from heel.schemas import DriveState, EStop, MotionCommand, Stamp, encode, keys
from heel.services.recordings.numbers import Gaps, own_number
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import PRODUCER, WALL_NS, image, tracks


def message(key: str, sent: MotionCommand | DriveState | EStop, stamp: bytes | None) -> WireMessage:
    return WireMessage(key, sent.encoding(), encode(sent), stamp, WALL_NS)


def drive(seq: int) -> DriveState:
    return DriveState(
        seq=seq, state="waiting", reason="", estop=False, driver="log", linear_mps=0.0,
        angular_radps=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("seqs", "missing"),
    [([0, 1, 2], 0), ([4, 5], 0), ([0, 3], 2), ([0, 3, 1, 2, 4], 2), ([0, 2, 0, 1], 1)],
    ids=["whole", "begun late", "a gap", "late ones fill none", "begun anew"],
)
def test_gaps_between_what_came_are_counted(seqs: list[int], missing: int) -> None:
    gaps = Gaps()
    for seq in seqs:
        gaps.take(("camera", 1, seq))
    assert gaps.missing == missing


def test_senders_and_epochs_are_told_apart() -> None:
    gaps = Gaps()
    for number in (("a", 1, 0), ("b", 1, 7), ("a", 2, 90), ("a", 1, 2)):
        gaps.take(number)
    assert gaps.missing == 1


def test_pictures_commands_and_what_the_drive_says_have_numbers_of_their_own() -> None:
    assert own_number(image(5, epoch=3)) == (PRODUCER, 3, 5)
    stamp = encode(Stamp(producer="follower/main@00000002", t_sent_ns=WALL_NS, age_ns=0))
    command = MotionCommand(
        seq=9, linear_mps=0.0, angular_radps=0.0, ttl_s=0.5, state="idle", reason=""
    )
    number = own_number(message(keys.FOLLOW_COMMAND, command, stamp))
    assert number == ("follower/main@00000002", 0, 9)
    key = keys.TOPICS["drive"]
    assert own_number(message(key, drive(3), None)) == (key, 0, 3)


def test_what_has_the_number_of_a_picture_or_is_damaged_has_none() -> None:
    assert own_number(tracks(5)) is None
    broken = WireMessage(image(0).key, image(0).encoding, b"", b"\xc1", WALL_NS)
    assert own_number(broken) is None
    damaged = WireMessage("robot/drive", DriveState.encoding(), b"\xc1", None, WALL_NS)
    assert own_number(damaged) is None
