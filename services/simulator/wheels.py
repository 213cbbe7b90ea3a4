"""What the simulated wheels are told: the drive's last word, while it is fresh."""

from __future__ import annotations

from heel.schemas import DriveState

TIMEOUT_S = 0.2
"""The drive speaks 50 times a second; wheels that hear nothing for so long stop by themselves."""


class Wheels:
    """Keeps the drive's last word and forgets it in time."""

    def __init__(self) -> None:
        self._told = (0.0, 0.0)
        self._heard_s = float("-inf")

    def hear(self, state: DriveState, now_s: float) -> None:
        """The drive has spoken, `now_s` by a monotonic clock."""
        self._told = (state.linear_mps, state.angular_radps)
        self._heard_s = now_s

    def speed(self, now_s: float) -> tuple[float, float]:
        """Metres and radians per second to be driven now; zeros when the drive is silent."""
        return self._told if now_s - self._heard_s <= TIMEOUT_S else (0.0, 0.0)

    def silent(self, now_s: float) -> bool:
        """Whether the drive has been heard before but not of late."""
        return TIMEOUT_S < now_s - self._heard_s < float("inf")
