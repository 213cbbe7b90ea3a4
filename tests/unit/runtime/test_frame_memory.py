"""Frames in shared memory: a pool made to measure, and the frame itself where there is no room."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import pytest
import zenoh
from zenoh.shm import ShmProvider, ZShmMut

from heel.services.runtime.frame_memory import FrameMemory

LOG = logging.getLogger("heel.test")
FRAME = bytes(range(256)) * 64


def own_segments() -> set[str]:
    """Segments that this process maps and that still have their names: other tests run beside."""
    return set(re.findall(r"/dev/shm/\S+\.zenoh$", Path("/proc/self/maps").read_text(), re.M))


@pytest.mark.parametrize("frame", [FRAME, FRAME[:-383]], ids=["aligned", "odd"])
def test_as_many_frames_are_held_as_asked_for_and_the_next_goes_as_it_is(frame: bytes) -> None:
    memory = FrameMemory(3, LOG)
    held = [memory.hold(frame) for _ in range(4)]
    assert [type(each) for each in held] == [ZShmMut, ZShmMut, ZShmMut, bytes]
    assert {bytes(each) for each in held} == {frame}


def test_a_receiver_that_is_behind_gets_more_room_up_to_a_bound(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    memory = FrameMemory(2, LOG, most_frames=6)
    held = [memory.hold(FRAME) for _ in range(7)]
    assert [type(each) for each in held] == [ZShmMut] * 6 + [bytes]
    assert {bytes(each) for each in held} == {FRAME}
    assert [record.args for record in caplog.records] == [(4,), (6,)]
    del held
    assert isinstance(memory.hold(FRAME), ZShmMut)


def test_room_that_is_not_to_be_had_is_asked_for_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    memory = FrameMemory(1, LOG, most_frames=4)
    first = memory.hold(FRAME)

    class Nothing:
        @staticmethod
        def default_backend(_bytes: int) -> ShmProvider:
            raise zenoh.ZError("no room")

    monkeypatch.setattr("heel.services.runtime.frame_memory.ShmProvider", Nothing)
    assert [memory.hold(FRAME) for _ in range(3)] == [FRAME] * 3
    assert len(caplog.records) == 1
    del first
    assert isinstance(memory.hold(FRAME), ZShmMut)


def test_a_buffer_that_was_read_is_used_again() -> None:
    memory = FrameMemory(1, LOG)
    for _ in range(5):
        assert isinstance(memory.hold(FRAME), ZShmMut)


def test_larger_frames_get_a_pool_of_their_own_and_the_frames_before_stay() -> None:
    memory = FrameMemory(3, LOG)
    first = memory.hold(FRAME)
    segments = own_segments()
    larger = [memory.hold(3 * FRAME) for _ in range(2)]
    assert all(isinstance(each, ZShmMut) for each in [*larger, memory.hold(FRAME)])
    assert segments
    assert segments <= own_segments()
    assert bytes(first) == FRAME


def test_without_shared_memory_frames_go_as_they_are_and_that_is_said_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Nothing:
        @staticmethod
        def default_backend(_bytes: int) -> ShmProvider:
            raise zenoh.ZError("no room")

    monkeypatch.setattr("heel.services.runtime.frame_memory.ShmProvider", Nothing)
    memory = FrameMemory(2, LOG)
    assert [memory.hold(FRAME) for _ in range(3)] == [FRAME] * 3
    (record,) = caplog.records
    assert "raise the limit on locked memory" in record.message
