"""Where the robot is and was, by odometry where there is any, else by what it was told."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

from heel.schemas import Odometry

_HISTORY_S = 2.0
"""Seconds of own motion that are remembered: more than tracks may be old."""
_LONGEST_STEP_S = 0.5
"""Commands expire: a robot that was not told anything for longer stands still."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Place and heading in a plane that does not move; where its origin lies means nothing."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def moved(self, linear_mps: float, angular_radps: float, dt_s: float) -> Pose:
        """Where the robot is after going on like that."""
        middle = self.heading_rad + angular_radps * dt_s / 2
        return Pose(
            self.x_m + linear_mps * dt_s * math.cos(middle),
            self.y_m + linear_mps * dt_s * math.sin(middle),
            self.heading_rad + angular_radps * dt_s,
        )

    def place(self, distance_m: float, bearing_rad: float) -> tuple[float, float]:
        """The place that the robot sees at a distance and bearing."""
        angle = self.heading_rad + bearing_rad
        return self.x_m + distance_m * math.cos(angle), self.y_m + distance_m * math.sin(angle)

    def seen(self, x_m: float, y_m: float) -> tuple[float, float]:
        """A place as the robot sees it: metres ahead and to the left."""
        ahead, left = self.turned(x_m - self.x_m, y_m - self.y_m)
        return ahead, left

    def turned(self, dx: float, dy: float) -> tuple[float, float]:
        """A direction or velocity in the robot's axes."""
        cosine, sine = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return cosine * dx + sine * dy, cosine * dy - sine * dx


class OwnMotion:
    """Integrates the robot's velocity into poses and remembers them for two seconds.

    Only differences over some seconds are used, so drift does not matter.

    Args:
        delay_s: how long the robot takes to do what it is told.
        odometry_age_s: older odometry does not count.
    """

    def __init__(self, delay_s: float, odometry_age_s: float) -> None:
        self._delay_s = delay_s
        self._odometry_age_s = odometry_age_s
        self._pose = Pose()
        self._now_s: float | None = None
        self._told: deque[tuple[float, float, float]] = deque()
        self._poses: deque[tuple[float, Pose]] = deque()
        self._odometry: tuple[float, Odometry] | None = None

    @property
    def pose(self) -> Pose:
        """Where the robot is now."""
        return self._pose

    def odometry(self, odometry: Odometry, now_s: float) -> None:
        """Take what the robot says of its velocity."""
        self._odometry = now_s, odometry

    def told(self, now_s: float, linear_mps: float, angular_radps: float) -> None:
        """Remember a command that goes out now."""
        self._told.append((now_s, linear_mps, angular_radps))

    def advance(self, now_s: float) -> None:
        """Go on to the present; time never runs backwards here."""
        if self._now_s is not None and now_s > self._now_s:
            dt_s = min(now_s - self._now_s, _LONGEST_STEP_S)
            self._pose = self._pose.moved(*self._velocity(now_s), dt_s)
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        self._poses.append((self._now_s, self._pose))
        while self._poses[0][0] < self._now_s - _HISTORY_S:
            self._poses.popleft()

    def pose_at(self, t_s: float) -> Pose:
        """Where the robot was; for times before what is remembered, the oldest pose."""
        times = [time_s for time_s, _ in self._poses]
        after = bisect_right(times, t_s)
        if after == 0:
            return self._poses[0][1] if self._poses else self._pose
        if after == len(times):
            return self._pose
        (t0, a), (t1, b) = self._poses[after - 1], self._poses[after]
        share = (t_s - t0) / (t1 - t0)
        return Pose(
            a.x_m + share * (b.x_m - a.x_m),
            a.y_m + share * (b.y_m - a.y_m),
            a.heading_rad + share * (b.heading_rad - a.heading_rad),
        )

    def pose_soon(self) -> Pose:
        """Where the robot will be when what it is told now takes effect."""
        if not self._told:
            return self._pose
        _, linear_mps, angular_radps = self._told[-1]
        return self._pose.moved(linear_mps, angular_radps, self._delay_s)

    def _velocity(self, now_s: float) -> tuple[float, float]:
        if self._odometry is not None and now_s - self._odometry[0] <= self._odometry_age_s:
            return self._odometry[1].linear_mps, self._odometry[1].angular_radps
        effective_s = now_s - self._delay_s
        while len(self._told) > 1 and self._told[1][0] <= effective_s:
            self._told.popleft()
        if not self._told or self._told[0][0] > effective_s:
            return 0.0, 0.0
        return self._told[0][1], self._told[0][2]
