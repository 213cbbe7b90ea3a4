"""The drive as a process: what it obeys, what it refuses, and how it stops."""

from __future__ import annotations

import math
import os
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgpack
import pytest
import zenoh

from heel.schemas import (
    DriveState,
    EndOfStream,
    EStop,
    MotionCommand,
    Odometry,
    decode,
    encode,
    keys,
)
from heel.services.runtime import qos
from heel.services.runtime.places import robot_name
from heel.services.runtime.publishing import Latched
from heel.services.runtime.settings import ZenohSettings
from heel.services.runtime.stop_socket import drives_here
from tests.support import network
from tests.support.driving import OTHER, Robot, drive_process, motion, next_seq, stamp
from tests.support.network import wait_until
from tests.support.processes import REPOSITORY, finished, running
from tests.support.service_faults import FAULTS, Put, broken

BOARD = """
import pathlib, time
from heel.services.drive.drivers import Driver, OdometryReading
class Board(Driver):
    def __init__(self, options):
        self.file, _, self.fault = options.partition("|")
    def set_velocity(self, linear_mps, angular_radps):
        if linear_mps and self.fault == "raise":
            raise OSError("the board is gone")
        if linear_mps and self.fault == "hang":
            time.sleep(60)
    def stop(self):
        pathlib.Path(self.file).write_text("stopped")
    def odometry(self):
        return OdometryReading(1.0, 2.0, 7.0, 0.5, 0.0)
"""


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture(scope="module")
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as client:
        yield client


@pytest.fixture(scope="module")
def robot(endpoint: str, session: zenoh.Session) -> Iterator[Robot]:
    with drive_process(endpoint, session) as made:
        wait_until(lambda: made.health is not None, "health", 30.0)
        yield made


@pytest.fixture
def board(tmp_path: Path) -> dict[str, str]:
    """Environment in which a package is installed that brings the driver `board`."""
    (tmp_path / "some_board.py").write_text(BOARD)
    info = tmp_path / "some_board-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-board\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[heel.drivers]\nboard = some_board:Board\n")
    return {"PYTHONPATH": os.pathsep.join([str(REPOSITORY), str(tmp_path)])}


def put(session: zenoh.Session, message: Put) -> None:
    session.put(
        message.key, message.payload, encoding=message.encoding, attachment=message.attachment,
        congestion_control=zenoh.CongestionControl.BLOCK,
    )  # fmt: skip


def press(session: zenoh.Session, engaged: bool, name: str = "") -> None:
    estop = EStop(engaged=engaged, source="test", id=name)
    put(session, Put(keys.FOLLOW_ESTOP, encode(estop), estop.encoding()))


def is_written(folder: Path) -> bool:
    """Whether a stop is written down: the wheels know it a moment earlier."""
    return any(file.suffix != ".new" for file in folder.glob("estop-*"))


GOOD = {
    "command": Put(keys.FOLLOW_COMMAND, encode(motion(0)), MotionCommand.encoding(), stamp()),
    "estop": Put(
        keys.FOLLOW_ESTOP, encode(EStop(engaged=False, source="test")), EStop.encoding()
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("topic", GOOD)
def test_bad_messages_are_counted_and_move_nothing(
    robot: Robot, session: zenoh.Session, topic: str, fault: str
) -> None:
    before = robot.refused()
    put(session, broken(GOOD[topic], topic, fault))
    wait_until(lambda: robot.refused() == before + 1, "the count in health")
    assert robot.process.alive
    assert not robot.drives()
    assert "Traceback" not in robot.process.stderr()
    if topic == "estop":
        wait_until(lambda: robot.stopped, "what cannot be read stops")
        press(session, False)
        wait_until(lambda: not robot.stopped, "the release")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308])
def test_numbers_that_are_none_are_refused_by_name(
    robot: Robot, session: zenoh.Session, value: float
) -> None:
    before = robot.refused()
    spoilt = msgpack.packb(motion(next_seq()).model_dump() | {"linear_mps": value})
    put(session, Put(keys.FOLLOW_COMMAND, spoilt, MotionCommand.encoding(), stamp()))
    wait_until(lambda: robot.refused() == before + 1, "the count in health")
    assert not robot.drives()
    assert any("command: linear_mps: " in line for line in robot.complaints("warning"))


def test_it_drives_while_commands_come_and_stands_when_they_stop(robot: Robot) -> None:
    with robot.commanded(first_seq=next_seq()):
        wait_until(robot.drives, "driving")
    wait_until(lambda: robot.stands_because("no command for 0.5 s"), "the watchdog")


def test_of_two_who_command_the_first_is_obeyed_and_both_are_named(robot: Robot) -> None:
    with robot.commanded(first_seq=next_seq(), linear_mps=0.2):
        wait_until(robot.drives, "driving")
        with robot.commanded(OTHER, linear_mps=0.9):
            wait_until(
                lambda: robot.health is not None and "two producers" in robot.health.reason,
                "the problem in health",
            )
            assert robot.newest is not None
            assert robot.newest.linear_mps <= 0.2
            assert robot.health is not None
            assert OTHER in robot.health.reason
    wait_until(lambda: robot.stands_because("no command"), "the watchdog")


def test_one_command_far_ahead_silences_nobody(robot: Robot, session: zenoh.Session) -> None:
    last = encode(motion(2**63 - 1, 0.0, 0.0))
    with robot.commanded(first_seq=next_seq()):
        wait_until(robot.drives, "driving")
        put(session, Put(keys.FOLLOW_COMMAND, last, MotionCommand.encoding(), stamp()))
        ends_s = time.monotonic() + 0.7
        while time.monotonic() < ends_s:
            time.sleep(0.01)
            assert robot.newest is not None
            assert not robot.newest.reason.startswith("told to"), "it obeyed"
        wait_until(robot.drives, "driving on")


def test_commands_that_are_all_refused_are_a_problem_in_health(
    robot: Robot, session: zenoh.Session
) -> None:
    again = Put(
        keys.FOLLOW_COMMAND, encode(motion(next_seq())), MotionCommand.encoding(), stamp()
    )  # fmt: skip

    def told() -> bool:
        put(session, again)
        time.sleep(0.05)
        reason = "" if robot.health is None else robot.health.reason
        return "follow/command: every message is refused" in reason

    wait_until(told, "the problem in health")
    assert not robot.drives()


def test_a_second_drive_is_named(robot: Robot, session: zenoh.Session) -> None:
    other = DriveState(
        seq=0, state="stopped", reason="test", estop=False, driver="log", linear_mps=0.0,
        angular_radps=0.0,
    )  # fmt: skip
    twin = stamp("drive/other@00000003")

    def told() -> bool:
        put(session, Put(keys.ROBOT_DRIVE, encode(other), other.encoding(), twin))
        time.sleep(0.05)
        reason = "" if robot.health is None else robot.health.reason
        return "two on robot/drive" in reason and "drive/other@00000003: stop one" in reason

    wait_until(told, "both names in health")


def test_the_end_of_the_commands_is_a_stop(robot: Robot, session: zenoh.Session) -> None:
    with robot.commanded(first_seq=next_seq()):
        wait_until(robot.drives, "driving")
    end = EndOfStream(stream="front", epoch=1, frames=9, reason="test")
    put(session, Put(keys.FOLLOW_COMMAND, encode(end), end.encoding()))
    wait_until(lambda: robot.stands_because("the commands have ended"), "the end")


def test_an_emergency_stop_holds_and_is_told_to_those_who_ask(
    robot: Robot, session: zenoh.Session
) -> None:
    with robot.commanded(first_seq=next_seq()):
        wait_until(robot.drives, "driving")
        press(session, True)
        wait_until(lambda: robot.stands_because("emergency stop"), "the stop")
        (reply,) = list(session.get(keys.FOLLOW_ESTOP, timeout=5.0))
        assert reply.ok is not None
        assert decode(EStop, reply.ok.payload.to_bytes(), str(reply.ok.encoding)).engaged
        press(session, False)
        wait_until(robot.drives, "driving again")


def test_a_release_that_names_another_engagement_releases_nothing(
    robot: Robot, session: zenoh.Session
) -> None:
    old, new = "0" * 16, "1" * 16
    press(session, True, old)
    press(session, False, old)
    press(session, True, new)
    wait_until(lambda: robot.stopped, "the stop")
    for name in (old, ""):
        press(session, False, name)
    wait_until(lambda: "releases nothing" in robot.process.stderr(), "the refusal")
    assert robot.stopped
    press(session, False, new)
    wait_until(lambda: not robot.stopped, "the release")


def test_the_stop_socket_stops_and_tells_what_is_true(
    robot: Robot, session: zenoh.Session, endpoint: str
) -> None:
    """Also while Zenoh brings nothing; others hear of it from the drive."""
    name = robot_name(ZenohSettings(connect=(endpoint,)))
    with network.collected(session, keys.FOLLOW_ESTOP) as told:
        with robot.commanded(first_seq=next_seq()):
            wait_until(robot.drives, "driving")
            (asked,) = drives_here(name, None, 2.0)
            assert asked.state is not None
            assert not asked.state.estop
            assert asked.state.linear_mps > 0.0
            stop = EStop(engaged=True, source="test", id="2" * 16)
            (answer,) = drives_here(name, stop, 2.0)
            assert answer.state is not None
            assert (answer.state.estop, answer.state.linear_mps) == (True, 0.0)
        assert decode(EStop, told.get(timeout=5.0).payload.to_bytes()) == stop
        press(session, False, stop.id)
        wait_until(lambda: not robot.stopped, "the release")


def test_a_stop_outlives_everybody_who_holds_it(tmp_path: Path) -> None:
    folder = {"HEEL_RUNTIME_DIR": str(tmp_path)}
    with network.router() as own, network.client(own) as client:
        with drive_process(own, client, **folder) as robot:
            press(client, True, "3" * 16)
            wait_until(lambda: robot.stopped and is_written(tmp_path), "the stop")
            robot.process.stop(signal.SIGKILL, 5.0)
        with drive_process(own, client, **folder) as robot, robot.commanded():
            wait_until(lambda: robot.stands_because("emergency stop"), "the stop")
            press(client, False, "3" * 16)
            wait_until(robot.drives, "driving again")


def test_a_stop_outlives_the_run_folder_where_a_disk_is_named(tmp_path: Path) -> None:
    """As where all containers of a robot, or its computer, are started anew."""
    disk = str(tmp_path / "disk")
    with network.router() as own, network.client(own) as client:
        before, after = (
            {"HEEL_RUNTIME_DIR": str(tmp_path / name), "HEEL_STATE_DIR": disk}
            for name in ("before", "after")
        )
        with drive_process(own, client, **before) as robot:
            press(client, True, "4" * 16)
            wait_until(lambda: robot.stopped and is_written(tmp_path / "disk"), "the stop")
            robot.process.stop(signal.SIGKILL, 5.0)
        with drive_process(own, client, **after) as robot, robot.commanded():
            wait_until(lambda: robot.stands_because("emergency stop"), "the stop")
            press(client, False, "4" * 16)
            wait_until(robot.drives, "driving again")


@pytest.mark.parametrize("pressed_before", [True, False], ids=["held", "pressed after"])
def test_a_stop_outlives_a_run_folder_that_was_deleted_under_the_drive(
    tmp_path: Path, pressed_before: bool
) -> None:
    """As with a session that ends, or a clean-up of `/tmp`: the note is written anew."""
    folder = tmp_path / "run"
    with network.router() as own, network.client(own) as client:
        with drive_process(own, client, HEEL_RUNTIME_DIR=str(folder)) as robot:
            wait_until(lambda: robot.newest is not None, "the drive")
            if pressed_before:
                press(client, True, "5" * 16)
                wait_until(lambda: is_written(folder), "the note")
            shutil.rmtree(folder)
            press(client, True, "5" * 16)
            wait_until(lambda: robot.stopped, "the stop")
            wait_until(lambda: is_written(folder), "the note in the folder made anew")
            robot.process.stop(signal.SIGKILL, 5.0)
        with drive_process(own, client, HEEL_RUNTIME_DIR=str(folder)) as robot, robot.commanded():
            wait_until(lambda: robot.stands_because("emergency stop"), "the stop")


def test_a_drive_that_starts_while_the_stop_holds_stands() -> None:
    with network.router() as own, network.client(own) as client:
        with Latched(client, keys.FOLLOW_ESTOP, qos.ESTOP) as kept:
            kept.keep(EStop(engaged=True, source="before"))
            with drive_process(own, client) as robot, robot.commanded():
                wait_until(lambda: robot.stands_because("emergency stop"), "the stop")


@pytest.mark.parametrize("commanded", [False, True], ids=["nothing comes", "commands come"])
def test_a_stop_that_went_by_is_asked_for(commanded: bool) -> None:
    """As after a link that was down: the stop was published meanwhile, and somebody knows it."""
    with network.router() as own, network.client(own) as client, ExitStack() as commands:
        with drive_process(own, client) as robot:
            wait_until(lambda: robot.newest is not None, "the drive")
            if commanded:
                commands.enter_context(robot.commanded())
                wait_until(robot.drives, "driving")
            with Latched(client, keys.FOLLOW_ESTOP, qos.ESTOP) as kept:
                kept.keep(EStop(engaged=True, source="meanwhile"))
                wait_until(lambda: robot.stands_because("emergency stop"), "the stop")


def test_a_follower_that_starts_while_the_drive_holds_the_stop_stands() -> None:
    with network.router() as own, network.client(own) as client:
        with drive_process(own, client) as robot:
            wait_until(lambda: robot.newest is not None, "the drive")
            press(client, True)
            wait_until(lambda: robot.stands_because("emergency stop"), "the stop")
            with network.collected(client, keys.FOLLOW_COMMAND) as commands:
                with running("-m", "heel.services.follower", "--connect", own):
                    sample = commands.get(timeout=30.0)
    command = decode(MotionCommand, sample.payload.to_bytes(), str(sample.encoding))
    assert (command.state, command.reason) == ("stopped", "emergency stop")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
def test_a_signal_is_zero_at_the_wheels_and_exit_code_0(
    number: signal.Signals, tmp_path: Path
) -> None:
    record = tmp_path / "wheels.txt"
    with network.router() as own, network.client(own) as client:
        flags = ("--driver", "record", "--driver-options", str(record))
        with drive_process(own, client, *flags) as robot, robot.commanded():
            wait_until(robot.drives, "driving")
            code, took_s = robot.process.stop(number, 10.0)
            assert (code, took_s < 2.0) == (0, True), robot.process.stderr()
            wait_until(lambda: robot.stands_because("the drive ends"), "the last word")
    assert record.read_text().splitlines()[-1].split()[1:] == ["0", "0"]


@pytest.mark.parametrize(
    ("fault", "words"),
    [("raise", "driver failed: OSError: the board is gone"), ("hang", "driver hangs: one call")],
)
def test_a_driver_in_trouble_is_a_stop_one_error_and_exit_code_1(
    fault: str, words: str, board: dict[str, str], tmp_path: Path
) -> None:
    told = tmp_path / "told.txt"
    flags = ("--driver", "board", "--driver-options", f"{told}|{fault}")
    with network.router() as own, network.client(own) as client:
        with drive_process(own, client, *flags, **board) as robot:
            wait_until(lambda: told.exists(), "the first stop")
            told.write_text("")
            with robot.commanded():
                assert robot.process.wait(10.0) == 1
            assert told.read_text() == "stopped"
            (complaint,) = robot.complaints("error")
            assert words in complaint
            assert "Traceback" not in robot.process.stderr()
            wait_until(lambda: robot.stands_because(words), "the last word")


def test_odometry_of_the_driver_is_published(board: dict[str, str], tmp_path: Path) -> None:
    flags = ("--driver", "board", "--driver-options", str(tmp_path / "told.txt"))
    with network.router() as own, network.client(own) as client:
        with network.collected(client, keys.ROBOT_ODOMETRY) as samples:
            with drive_process(own, client, *flags, **board):
                sample = samples.get(timeout=network.DEADLINE_S)
    odometry = decode(Odometry, sample.payload.to_bytes(), str(sample.encoding))
    assert (odometry.x_m, odometry.y_m, odometry.linear_mps) == (1.0, 2.0, 0.5)
    assert odometry.heading_rad == pytest.approx(7.0 - 2 * math.pi)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--driver", "wheels"), "'wheels': no such driver; known: log, record, simulated"),
        (("--driver", "record"), "name its file with --driver-options"),
        (("--delivery", "lossless"), "drive.delivery = 'lossless'"),
        (("--rate-hz", "1"), "drive.rate_hz"),
    ],
)
def test_wrong_settings_are_one_line_and_exit_code_2(
    endpoint: str, flags: tuple[str, ...], words: str
) -> None:
    code, out, err = finished("-m", "heel.services.drive", "--connect", endpoint, *flags)
    assert (code, out) == (2, "")
    assert words in err.splitlines()[-1]
