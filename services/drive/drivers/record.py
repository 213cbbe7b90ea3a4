"""A driver that writes down when the wheels are told what, for measurements."""

from __future__ import annotations

import os
import time

from heel.schemas.errors import SettingsError
from heel.services.drive.drivers.base import Driver


class RecordDriver(Driver):
    """Appends `monotonic_ns linear_mps angular_radps` to the file named by the options.

    One line for every change, written through at once. The clock is common to all processes of
    a machine (CLOCK_MONOTONIC).

    Raises:
        SettingsError: no file is named, or it cannot be written.
    """

    def __init__(self, options: str = "") -> None:
        if not options:
            raise SettingsError("driver record: name its file with --driver-options FILE")
        try:
            self._file = os.open(options, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as error:
            raise SettingsError(
                f"driver record: {options}: {error.strerror}: name another file"
            ) from None
        self._told: tuple[float, float] | None = None

    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        """Write a line if this is a change."""
        if (linear_mps, angular_radps) == self._told:
            return
        line = b"%d %.9g %.9g\n" % (time.monotonic_ns(), linear_mps, angular_radps)
        os.write(self._file, line)
        self._told = (linear_mps, angular_radps)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)
