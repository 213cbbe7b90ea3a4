"""Drivers by name: those of Heel, and those that another package brings along."""

from __future__ import annotations

from collections.abc import Callable
from importlib import metadata

from heel.schemas.errors import HeelError, SettingsError
from heel.services.drive.drivers.base import Driver, OdometryReading
from heel.services.drive.drivers.log import LogDriver
from heel.services.drive.drivers.record import RecordDriver
from heel.services.drive.drivers.simulated import SimulatedDriver

__all__ = ["ENTRY_POINTS", "Driver", "OdometryReading", "open_driver"]

ENTRY_POINTS = "heel.drivers"
"""Group of the entry points by which an installed package offers a driver."""
_OWN: dict[str, Callable[[str], Driver]] = {
    "log": LogDriver, "record": RecordDriver, "simulated": SimulatedDriver,
}  # fmt: skip


def open_driver(name: str, options: str) -> Driver:
    """Open a driver by name.

    Args:
        name: one of Heel's, or of an entry point that names a class or function which takes
            `options` and gives a `Driver`.
        options: what the driver is told.

    Raises:
        SettingsError: there is no such driver, or its options are wrong.
        HeelError: the driver cannot be opened.
    """
    if name in _OWN:
        return _OWN[name](options)
    installed = {point.name: point for point in metadata.entry_points(group=ENTRY_POINTS)}
    if name not in installed:
        known = ", ".join(sorted({*_OWN, *installed}))
        raise SettingsError(
            f"drive.driver = {name!r}: no such driver; known: {known}. A package brings its own "
            f"by an entry point of the group {ENTRY_POINTS}"
        )
    try:
        driver = installed[name].load()(options)
    except HeelError:
        raise
    except Exception as error:  # foreign code may raise anything
        raise HeelError(
            f"driver {name} ({installed[name].value}) cannot be opened: {_one_line(error)}: check "
            "--driver-options, the cable and that no other program uses the board"
        ) from error
    if not isinstance(driver, Driver):
        raise HeelError(
            f"driver {name} ({installed[name].value}) is a {type(driver).__name__}: derive it "
            "from heel.services.drive.drivers.Driver"
        )
    return driver


def _one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:200]
