"""The drive's own socket for the emergency stop."""

from __future__ import annotations

import logging
import os
import shutil
import socket
import stat
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from heel.schemas import DriveState, EStop
from heel.services.runtime.stop_socket import StopSocket, drives_here
from tests.support.network import wait_until

ROBOT = "r1"
STOP = EStop(engaged=True, source="test", id="a" * 16)


class LoopOfADrive:
    """Goes round 50 times a second unless it hangs."""

    def __init__(self) -> None:
        self.pressed: list[EStop] = []
        self.hangs = False
        self._rounds = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def told(self) -> tuple[DriveState, int]:
        state = DriveState(
            seq=self._rounds, state="stopped", reason="", estop=bool(self.pressed), driver="log",
            linear_mps=0.0, angular_radps=0.0,
        )  # fmt: skip
        return state, self._rounds

    def _run(self) -> None:
        while not self._ending.wait(0.02):
            self._rounds += not self.hangs

    def close(self) -> None:
        self._ending.set()
        self._thread.join(5.0)


@pytest.fixture
def loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LoopOfADrive]:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path))
    made = LoopOfADrive()
    with StopSocket(ROBOT, made.pressed.append, made.told, logging.getLogger("test")):
        yield made
    made.close()
    assert not list(tmp_path.glob("*.sock")), "the socket goes with its drive"


def the_socket(folder: Path) -> Path:
    (path,) = folder.glob("*.sock")
    return path


def test_it_is_there_again_where_its_folder_was_deleted(loop: LoopOfADrive, tmp_path: Path) -> None:
    shutil.rmtree(tmp_path)
    wait_until(lambda: bool(drives_here(ROBOT, None, 2.0)), "the socket in the folder made anew")
    (answer,) = drives_here(ROBOT, STOP, 2.0)
    assert answer.state is not None
    assert loop.pressed == [STOP]


def test_it_stops_and_answers_what_the_wheels_are_told(loop: LoopOfADrive) -> None:
    (asked,) = drives_here(ROBOT, None, 2.0)
    assert asked.state is not None
    assert (asked.pid, asked.state.estop, loop.pressed) == (os.getpid(), False, [])
    (answer,) = drives_here(ROBOT, STOP, 2.0)
    assert answer.state is not None
    assert answer.state.estop
    assert loop.pressed == [STOP]


def test_it_is_for_its_owner_and_its_robot_alone(loop: LoopOfADrive, tmp_path: Path) -> None:
    assert stat.S_IMODE(the_socket(tmp_path).stat().st_mode) == 0o600
    assert drives_here("r2", STOP, 2.0) == []
    assert loop.pressed == []


@pytest.mark.parametrize("words", [b"stop!", b"x" * 5000, b"\xc1", b"{}"])
def test_what_cannot_be_read_stops(loop: LoopOfADrive, tmp_path: Path, words: bytes) -> None:
    _send(the_socket(tmp_path), words)
    deadline_s = time.monotonic() + 5.0
    while not loop.pressed and time.monotonic() < deadline_s:
        time.sleep(0.01)
    (pressed,) = loop.pressed
    assert pressed.engaged


def test_nothing_is_released_here(loop: LoopOfADrive) -> None:
    drives_here(ROBOT, EStop(engaged=False, source="test"), 2.0)
    assert all(message.engaged for message in loop.pressed)


def test_a_drive_that_hangs_is_told_from_one_that_is_not_there(loop: LoopOfADrive) -> None:
    loop.hangs = True
    started_s = time.monotonic()
    (answer,) = drives_here(ROBOT, STOP, 1.0)
    assert answer.state is None
    assert time.monotonic() - started_s < 3.0
    assert loop.pressed == [STOP], "it stops when it goes on"


def test_clients_that_say_nothing_keep_nobody_else_out(loop: LoopOfADrive, tmp_path: Path) -> None:
    idle = [_connected(the_socket(tmp_path)) for _ in range(3)]
    (answer,) = drives_here(ROBOT, STOP, 5.0)
    assert answer.state is not None
    for one in idle:
        one.close()


def test_what_a_killed_drive_left_behind_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path))
    left = tmp_path / f"drive-{ROBOT}-999999.sock"
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(left))
    assert drives_here(ROBOT, STOP, 1.0) == []
    assert not left.exists()


def test_a_folder_that_cannot_be_used_leaves_the_drive_its_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path / "file" / "run"))
    with StopSocket(ROBOT, lambda message: None, lambda: (None, 0), logging.getLogger("test")):
        assert "stops come by Zenoh only" in caplog.text


def _connected(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX)
    made.settimeout(5.0)
    made.connect(str(path))
    return made


def _send(path: Path, words: bytes) -> None:
    with _connected(path) as call:
        call.sendall(words)
        call.shutdown(socket.SHUT_WR)
