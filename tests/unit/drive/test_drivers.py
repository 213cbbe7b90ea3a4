"""Drivers by name, Heel's own and somebody else's, and what is said when there is none."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from heel.schemas.errors import HeelError, SettingsError
from heel.services.drive.drivers import open_driver

MODULE = """
from heel.services.drive.drivers import Driver
class Board(Driver):
    def __init__(self, options):
        self.options = options
    def set_velocity(self, linear_mps, angular_radps):
        pass
def unplugged(options):
    raise OSError("no such port")
def nothing(options):
    return None
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed distribution that offers drivers."""
    (tmp_path / "some_board.py").write_text(MODULE)
    info = tmp_path / "some_board-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-board\nVersion: 1.0\n")
    names = {"board": "Board", "unplugged": "unplugged", "nothing": "nothing", "gone": "Gone"}
    lines = "".join(f"{name} = some_board:{what}\n" for name, what in names.items())
    (info / "entry_points.txt").write_text(f"[heel.drivers]\n{lines}")
    monkeypatch.syspath_prepend(str(tmp_path))


def test_an_installed_package_brings_its_driver(package: None) -> None:
    driver = open_driver("board", "/dev/ttyUSB0")
    assert vars(driver) == {"options": "/dev/ttyUSB0"}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("unplugged", "driver unplugged (some_board:unplugged) cannot be opened: OSError: no such"),
        ("nothing", "is a NoneType: derive it"),
        ("gone", "cannot be opened: AttributeError"),
    ],
)
def test_a_driver_that_cannot_be_had_is_one_line(name: str, words: str, package: None) -> None:
    with pytest.raises(HeelError) as caught:
        open_driver(name, "")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_driver_names_those_there_are() -> None:
    with pytest.raises(SettingsError, match=r"'wheels': no such driver; known: log, record, sim"):
        open_driver("wheels", "")


@pytest.mark.parametrize(
    ("options", "words"), [("", "name its file"), ("/nowhere/wheels.txt", "No such file")]
)
def test_a_record_needs_a_file_it_can_write(options: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        open_driver("record", options)


def test_a_record_has_one_line_for_every_change(tmp_path: Path) -> None:
    driver = open_driver("record", str(tmp_path / "wheels.txt"))
    for _ in range(3):
        driver.set_velocity(0.5, -0.25)
    driver.stop()
    driver.stop()
    driver.close()
    rows = [line.split() for line in (tmp_path / "wheels.txt").read_text().splitlines()]
    assert [row[1:] for row in rows] == [["0.5", "-0.25"], ["0", "0"]]
    assert int(rows[0][0]) <= int(rows[1][0])


def test_the_log_says_what_is_news(caplog: pytest.LogCaptureFixture) -> None:
    driver = open_driver("log", "")
    with caplog.at_level(logging.INFO, "heel.drive.wheels"):
        for linear_mps in (0.0, 0.02, 0.04, 0.5, 0.55, 0.0, 0.0):
            driver.set_velocity(linear_mps, 0.0)
    assert [record.args for record in caplog.records] == [(0.02, 0.0), (0.5, 0.0), (0.0, 0.0)]


def test_the_simulated_robot_obeys_the_topic_and_not_the_driver() -> None:
    driver = open_driver("simulated", "")
    driver.set_velocity(0.5, 0.0)
    assert driver.odometry() is None
