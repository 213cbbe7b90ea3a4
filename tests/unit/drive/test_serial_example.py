"""The example of a motor board, on a pseudo terminal instead of a cable."""

from __future__ import annotations

import importlib
import os
import pty
import tomllib
from collections.abc import Iterator

import pytest

from heel.services.drive.drivers import ENTRY_POINTS, Driver, OdometryReading
from tests.support.network import wait_until
from tests.support.processes import REPOSITORY

EXAMPLES = REPOSITORY / "examples"


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Driver, int]]:
    """The driver as its entry point names it, and the board's end of the line."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    project = tomllib.loads((EXAMPLES / "pyproject.toml").read_text())["project"]
    module, _, name = project["entry-points"][ENTRY_POINTS]["serial-board"].partition(":")
    far, near = pty.openpty()
    driver = getattr(importlib.import_module(module), name)(os.ttyname(near))
    yield driver, far
    driver.close()
    os.close(near)
    os.close(far)


def test_the_board_is_told_velocities_and_stops(board: tuple[Driver, int]) -> None:
    driver, far = board
    driver.set_velocity(0.5, -0.25)
    driver.stop()
    told = b""
    while told.count(b"\n") < 2:
        told += os.read(far, 100)
    assert told.split(b"\n")[:2] == [b"V 0.500 -0.250", b"V 0.000 0.000"]


def test_the_board_says_where_it_is(board: tuple[Driver, int]) -> None:
    driver, far = board
    driver.set_velocity(0.5, 0.0)
    assert driver.odometry() is None
    os.write(far, b"O 0 0 0\nO 1.5 -0.5 0.1\nO 2")
    found: list[OdometryReading] = []

    def heard() -> bool:
        found.extend(filter(None, [driver.odometry()]))
        return bool(found)

    wait_until(heard, "the odometry")
    assert found[-1] == OdometryReading(1.5, -0.5, 0.1, 0.5, 0.0)
