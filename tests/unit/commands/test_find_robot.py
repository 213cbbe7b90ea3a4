"""Which robot or run a command without a name is meant for."""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from heel.schemas import SettingsError
from heel.services.commands import robot
from heel.services.commands.robot import RobotFlags
from heel.services.runtime import registry
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.registry import Run, registered

DEFAULT = "tcp/127.0.0.1:7447"


@pytest.fixture(autouse=True)
def nothing_else_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(robot, "_listens", lambda endpoint: endpoint != DEFAULT)


@pytest.fixture
def demo() -> Iterator[Run]:
    log = logging.getLogger("heel.test")
    with registered("demo", "distractor-3", "tcp/127.0.0.1:40001", (), log):
        yield registry.runs()[0]


def other(pid: int = 1) -> Run:
    return Run(pid=pid, started="x", kind="run", what="walk.mp4", endpoint="tcp/127.0.0.1:40002")


def test_without_a_run_it_is_the_default_router() -> None:
    where = RobotFlags().find()
    assert (where.router, where.run) == (DEFAULT, None)


def test_the_one_run_is_found(demo: Run) -> None:
    where = RobotFlags().find()
    assert (where.router, where.run) == (demo.endpoint, demo)


def test_what_is_named_wins_by_flag_environment_or_file(
    demo: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert RobotFlags(connect="tcp/10.0.0.1:7447").find().router == "tcp/10.0.0.1:7447"
    assert RobotFlags(connect=demo.endpoint).find().run == demo
    file = tmp_path / "heel.toml"
    file.write_text('[zenoh]\nconnect = ["tcp/10.0.0.2:7447"]\n')
    assert RobotFlags(config=file).find().router == "tcp/10.0.0.2:7447"
    monkeypatch.setenv("HEEL_ZENOH__CONNECT", DEFAULT)
    assert RobotFlags().find().router == DEFAULT


def test_of_several_none_is_guessed(demo: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "runs", lambda: [demo, other()])
    with pytest.raises(SettingsError, match=r"2 are possible.*--run \d+ .*--run 1 .*walk\.mp4"):
        RobotFlags().find()
    assert RobotFlags(run=1).find().router == "tcp/127.0.0.1:40002"
    assert RobotFlags(run=demo.pid).find().router == demo.endpoint
    with pytest.raises(SettingsError, match="no run of that process"):
        RobotFlags(run=77).find()


def test_a_run_is_named_by_its_robot(demo: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    red, blue = (other(n).model_copy(update={"robot": name, "endpoint": f"tcp/127.0.0.1:4100{n}"})
                 for n, name in enumerate(("red", "blue"), start=1))  # fmt: skip
    monkeypatch.setattr(registry, "runs", lambda: [demo, red, blue])
    assert RobotFlags(robot="blue").find().run == blue
    with pytest.raises(SettingsError, match=r"3 are possible.*--robot red \(heel run walk"):
        RobotFlags().find()
    with pytest.raises(SettingsError, match=r"no run of that name; .*--robot blue"):
        RobotFlags(robot="green").find()
    twin = blue.model_copy(update={"pid": 7})
    monkeypatch.setattr(registry, "runs", lambda: [blue, twin])
    with pytest.raises(SettingsError, match=r"several have that name: --run 2, --run 7"):
        RobotFlags(robot="blue").find()
    assert RobotFlags(robot="blue", run=7).find().run == twin


def test_who_should_be_there_is_said_by_the_run_or_by_the_settings(
    demo: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nstack = ["capture", "drive"]\n')
    elsewhere = RobotFlags(connect="tcp/10.0.0.1:7447", config=file)
    assert elsewhere.find().expected == ("capture", "drive")
    monkeypatch.setenv("HEEL_ROBOT__STACK", "tracker,follower")
    assert elsewhere.find().expected == ("tracker", "follower")
    assert RobotFlags().find().expected == demo.parts
    monkeypatch.setenv("HEEL_ROBOT__STACK", "no such/thing")
    with pytest.raises(SettingsError, match=r"robot\.stack.*heel status --help"):
        elsewhere.find()


def test_user_and_password_file_are_flags(tmp_path: Path) -> None:
    password = tmp_path / "password"
    password.write_text("secret\n")
    where = RobotFlags(connect=DEFAULT, user="heel", password_file=password).find()
    assert (where.zenoh.user, where.zenoh.secret()) == ("heel", "secret")
    with pytest.raises(SettingsError, match="go together"):
        RobotFlags(connect=DEFAULT, user="heel").find()


def test_a_run_beside_a_router_of_this_machine_is_not_guessed_either(
    demo: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot, "_listens", lambda _endpoint: True)
    with pytest.raises(SettingsError, match=f"--connect {DEFAULT}"):
        RobotFlags().find()
    assert RobotFlags(connect=DEFAULT).find().run is None


def test_a_run_that_cannot_be_reached_from_here_is_not_meant(
    demo: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot, "_listens", lambda endpoint: endpoint == DEFAULT)
    assert RobotFlags().find().router == DEFAULT
    monkeypatch.setattr(registry, "runs", lambda: [demo, other()])
    monkeypatch.setattr(robot, "_listens", lambda endpoint: endpoint == demo.endpoint)
    assert RobotFlags().find().run == demo


def test_whether_somebody_listens_is_asked_of_the_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert robot._listens(f"tcp/127.0.0.1:{port}")
    assert not robot._listens(f"tcp/127.0.0.1:{port}")
    assert not robot._listens("unixpipe/nowhere")
