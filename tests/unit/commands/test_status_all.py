"""`heel status --all`: which routers it looks at, and a line a robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.schemas import SettingsError
from heel.services.commands import robot
from heel.services.commands.robot import RobotFlags, Where
from heel.services.commands.robots import RobotsOf, as_json, is_wrong, lines
from heel.services.runtime import registry
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.registry import Run
from heel.services.runtime.robots import Robots
from heel.services.runtime.settings import ZenohSettings
from tests.unit.runtime.test_robots import T_S, health, say, whole

DEFAULT = "tcp/127.0.0.1:7447"


def run(pid: int, name: str = "") -> Run:
    return Run(pid=pid, started="x", kind="demo", what="w", endpoint=f"tcp/127.0.0.1:4000{pid}",
               robot=name, parts=("tracker", "follower"))  # fmt: skip


@pytest.fixture(autouse=True)
def two_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(robot, "_listens", lambda endpoint: endpoint != DEFAULT)
    monkeypatch.setattr(registry, "runs", lambda: [run(1, "red"), run(2)])


def test_all_are_the_runs_here_and_the_default_router_if_it_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = RobotFlags().find_all()
    assert [where.router for where, _ in found] == ["tcp/127.0.0.1:40001", "tcp/127.0.0.1:40002"]
    monkeypatch.setattr(robot, "_listens", lambda endpoint: True)
    assert [where.router for where, _ in RobotFlags().find_all()][-1] == DEFAULT
    named = RobotFlags(connect="tcp/10.0.0.1:7447").find_all()
    assert [where.router for where, _ in named] == ["tcp/10.0.0.1:7447"]


def test_robots_of_the_settings_are_looked_for_though_no_router_is_there(tmp_path: Path) -> None:
    file = tmp_path / "heel.toml"
    file.write_text('[robot]\nrobots = ["r1", "r2"]\nstack = ["drive"]\n')
    where, expected = RobotFlags(config=file).find_all()[-1]
    assert (where.router, where.expected, expected) == (DEFAULT, ("drive",), ("r1", "r2"))


def test_all_is_not_one_and_nothing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingsError, match="leave out --robot and --run"):
        RobotFlags(robot="red").find_all()
    monkeypatch.setattr(registry, "runs", list)
    with pytest.raises(SettingsError, match=r"no router at .*--connect"):
        RobotFlags().find_all()


def heard(where: Where, *names: str) -> RobotsOf:
    robots = Robots()
    for name in names:
        whole(robots, name)
    return RobotsOf(where, robots, None)


def test_a_line_a_robot_and_what_is_wrong_below() -> None:
    building = heard(Where(ZenohSettings(), None), "r1", "r2")
    demo = heard(Where(ZenohSettings(), run(1, "red")), "")
    nameless = heard(Where(ZenohSettings(), run(2)), "")
    told = lines([building, demo, nameless], T_S)
    assert [line.split()[0] for line in told] == ["robot", "r1", "r2", "red", "demo"]
    assert told[1].split() == [
        "r1", "following", "7", "90%", "no", "0.40", "25.0", "50", "-",
    ]  # fmt: skip
    assert not is_wrong([building, demo, nameless], T_S)

    say(building.robots, "r2", health("tracker", state="error", reason="full\x1b[2J"))
    told = lines([building], T_S)
    assert told[2].split()[:3] == ["r2", "lacks", "tracker"]
    assert told[-1] == "r2: tracker: full\\x1b[2J"
    assert is_wrong([building], T_S)
    assert [one["problems"] != [] for one in as_json([building], T_S)["robots"]] == [False, True]


def test_a_router_that_is_away_is_wrong() -> None:
    away = RobotsOf(Where(ZenohSettings(), run(1)), Robots(), None, "the router does not answer")
    assert is_wrong([away], T_S)
    assert lines([away], T_S)[-1] == "the router does not answer"
    assert as_json([away], T_S)["routers"][0]["problem"] == "the router does not answer"
