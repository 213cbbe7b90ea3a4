"""Sensors that speak and cannot be read: they are worse than none, for something is there."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

from heel.schemas import Odometry, Ranges
from heel.services.follower.settings import FollowerSettings

Sensor = Literal["ranges", "odometry", "camera"]
_HOLD_S: dict[Sensor, float] = {"ranges": 1.0, "odometry": 1.0, "camera": 3.0}
"""A message that cannot be read counts for so long. A sensor worth driving by sends four a second;
the camera's description is asked for every two seconds while there is none."""
_ALIKE_S = 0.4
"""Refused alike for so long is a sensor: it fails the same way every time, junk does not. And junk
is no reason to stand: else one message a second from any sender would hold the robot up."""
_VALUE = re.compile(r"[-+]?[0-9][0-9.e+-]*")
_FASTEST_MPS = 10.0
"""Twice what a command may order. Millimetres per second are soon beyond it."""
_FASTEST_RADPS = 20.0
"""Twice what a command may order. Degrees per second are soon beyond it."""
_FARTHEST_M = 100.0
"""If the nearest thing around is farther away, it is told in millimetres."""


def implausible_odometry(odometry: Odometry) -> str:
    """Which value no robot of this kind has, in words; "" if none."""
    if abs(odometry.linear_mps) > _FASTEST_MPS:
        return f"linear_mps is {odometry.linear_mps:g}: is it in metres per second?"
    if abs(odometry.angular_radps) > _FASTEST_RADPS:
        return f"angular_radps is {odometry.angular_radps:g}: is it in radians per second?"
    return ""


def implausible_ranges(ranges: Ranges) -> str:
    """Why the ranges say nothing, in words; "" if they do say something."""
    told = [sector.distance_m for sector in ranges.sectors if not math.isnan(sector.distance_m)]
    if not ranges.sectors:
        return "no sectors: the sensor sees nothing"
    if not told:
        return "every sector is nan: the sensor measures nothing"
    if math.inf > min(told) > _FARTHEST_M:
        return f"the nearest distance_m is {min(told):g}: is it in metres?"
    return ""


@dataclass(slots=True)
class _Heard:
    """What was heard last of a sensor."""

    good_s: float | None = None
    refused_s: float = -math.inf
    """The last message that counts."""
    reason: str = ""
    alike: str = ""
    alike_since_s: float = math.inf
    alike_s: float = -math.inf


MAX_ODOMETRY_AGE_S = 0.3
"""Older odometry is not used, the commands count then: three messages of a base at 10 Hz."""


class Sensors:
    """Remembers which sensor spoke last in a way that can be used.

    Args:
        settings: how old measurements may be.
    """

    def __init__(self, settings: FollowerSettings) -> None:
        self._heard: dict[Sensor, _Heard] = {name: _Heard() for name in _HOLD_S}
        self._fresh_s: dict[Sensor, float] = {
            "ranges": settings.max_ranges_age_s,
            "odometry": MAX_ODOMETRY_AGE_S,
            "camera": math.inf,
        }

    def good(self, sensor: Sensor, now_s: float) -> None:
        """A message that can be used."""
        self._heard[sensor].good_s = now_s

    def refused(self, sensor: Sensor, reason: str, now_s: float, known: bool = True) -> None:
        """A message that cannot be used.

        Args:
            sensor: the one that the topic is of.
            reason: why, in words.
            now_s: time of arrival.
            known: whether it names its sender, and is newer than all before; a message that does
                not counts if others before it were refused alike.
        """
        heard = self._heard[sensor]
        alike = _VALUE.sub("", reason)
        if alike != heard.alike or now_s - heard.alike_s > _HOLD_S[sensor]:
            heard.alike, heard.alike_since_s = alike, now_s
        heard.alike_s = now_s
        if known or now_s - heard.alike_since_s >= _ALIKE_S:
            heard.refused_s, heard.reason = now_s, reason

    def trouble(self, now_s: float) -> str:
        """Why the robot must not move: a sensor that speaks, none of it good of late; "" if none.

        One odd message beside good ones does not stop the robot.
        """
        for sensor, heard in self._heard.items():
            speaks = now_s - heard.refused_s <= _HOLD_S[sensor]
            good = heard.good_s is not None and now_s - heard.good_s <= self._fresh_s[sensor]
            if speaks and not good:
                return f"{sensor} cannot be read: {heard.reason}"
        return ""
