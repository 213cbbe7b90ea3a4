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
