"""The settings that are given for robots of ROS are ones that Heel takes."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import yaml

from heel.services.follower.settings import FollowerServiceSettings
from heel.services.ros2.settings import Ros2Settings
from heel.services.runtime.settings import load_settings

FOLDER = Path(__file__).parents[3] / "examples/ros2"
FILES = sorted(FOLDER.glob("*.toml"))


@pytest.mark.parametrize("file", FILES, ids=[file.stem for file in FILES])
def test_the_settings_of_each_robot_are_taken(file: Path) -> None:
    written = tomllib.loads(file.read_text("utf-8"))
    assert set(written) <= {"ros2", "follower"}
    bridge = load_settings("ros2", Ros2Settings, {}, file).service
    assert {name: getattr(bridge, name) for name in written["ros2"]} == written["ros2"]
    follower = load_settings("follower", FollowerServiceSettings, {}, file).service
    for name, value in written.get("follower", {}).items():
        assert getattr(follower, name) == value


def test_each_robot_of_the_guide_has_a_file_and_a_hand_goes_before_heel() -> None:
    assert {file.stem for file in FILES} == {"turtlebot4", "clearpath", "unitree_go2", "nav2"}
    mux = yaml.safe_load((FOLDER / "twist_mux.yaml").read_text("utf-8"))
    topics = mux["twist_mux"]["ros__parameters"]["topics"]
    assert topics["joystick"]["priority"] > topics["heel"]["priority"]
    # A killed bridge sends no zero.
    assert 0 < topics["heel"]["timeout"] <= 0.5
