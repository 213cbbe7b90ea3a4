"""A motor board on a serial line that takes `V <m/s> <rad/s>` and answers `O <x> <y> <heading>`."""

from __future__ import annotations

import serial

from heel.services.drive.drivers import Driver, OdometryReading


class SerialMotorBoard(Driver):
    def __init__(self, options: str) -> None:
        self._port = serial.Serial(options, 115200, timeout=0, write_timeout=0.1)
        self._line, self._told = b"", (0.0, 0.0)

    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        self._port.write(f"V {linear_mps:.3f} {angular_radps:.3f}\n".encode())
        self._told = linear_mps, angular_radps

    def close(self) -> None:
        self._port.close()

    def odometry(self) -> OdometryReading | None:
        *lines, self._line = (self._line + self._port.read(256)).split(b"\n")
        where = [line.split()[1:] for line in lines if line.startswith(b"O ")]
        return OdometryReading(*map(float, where[-1]), *self._told) if where else None
