"""ROS messages to Heel's and back: numbers in, schema objects out, and no ROS needed.

Messages are taken by their fields, so that rclpy's, a recording's or a test's do alike. Frames are
those of REP 103: x ahead, y left, angles to the left; ranges those of REP 117.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from heel.schemas import CameraInfo, Health, HeelError, Odometry, RangeSector, Tracks
from heel.schemas.frame import LensModel
from heel.schemas.robot import MAX_RANGE_M, MAX_SECTORS
from heel.services.geometry.camera import camera_from_info, resized
from heel.services.geometry.person import locate_person
from heel.services.runtime.chain import BEATS_MISSED

_JUMP_M = 2.0
"""Metres between two odometry messages from which the robot's own frame was set anew; chosen by
hand: no robot drives as far in the tenths of a second between two."""


def lens_of(info: Any, width_px: int, height_px: int) -> LensModel | None:
    """The lens of a sensor_msgs/CameraInfo, for pictures of a size; None: not calibrated.

    Raises:
        HeelError: a model of distortion that is not read, or numbers that cannot be.
    """
    matrix = [float(value) for value in info.k]
    if len(matrix) != 9 or not all(map(math.isfinite, matrix)) or matrix[0] <= 0 or matrix[4] <= 0:
        return None  # all zeros: REP 104's "not calibrated"
    if not (info.width and info.height):
        return None
    across, down = width_px / int(info.width), height_px / int(info.height)
    coefficients = [float(value) for value in info.d]
    name = str(info.distortion_model)
    fisheye = name in ("equidistant", "fisheye")
    if not fisheye and name not in ("", "plumb_bob", "rational_polynomial"):
        raise HeelError(
            f"distortion model {name[:40]!r} is not read: plumb_bob, rational_polynomial and "
            "equidistant are"
        )
    most = 4 if fisheye else 8
    if not all(map(math.isfinite, coefficients)) or any(coefficients[most:]):
        raise HeelError(
            f"distortion {coefficients} of {name}: up to {most} finite numbers are read"
        )
    return LensModel(
        model="equidistant" if fisheye else "plumb_bob",
        focal_px=(matrix[0] * across, matrix[4] * down),
        centre_px=(matrix[2] * across, matrix[5] * down), coefficients=tuple(coefficients[:most]),
    )  # fmt: skip


def sectors_of(scan: Any, yaw_rad: float = 0.0) -> tuple[RangeSector, ...]:
    """Sectors of a sensor_msgs/LaserScan, neighbouring rays together where there are too many.

    A sector is as free as its nearest ray; one of rays that measured nothing says so.

    Args:
        scan: the message. yaw_rad: where the scanner looks, left is positive.

    Raises:
        HeelError: angles that cannot be.
    """
    start, step = float(scan.angle_min), float(scan.angle_increment)
    ranges = np.asarray(scan.ranges, np.float64)
    if not (math.isfinite(start) and math.isfinite(step)) or step == 0.0 or abs(step) > math.pi:
        raise HeelError(f"scan from {start:g} rad in steps of {step:g} rad: no scanner turns so")
    if not len(ranges):
        return ()
    least, most = float(scan.range_min), float(scan.range_max)
    most = min(most, MAX_RANGE_M) if most > 0 else MAX_RANGE_M
    free = np.where(ranges > most, np.inf, ranges)
    free = np.where((ranges < least) & np.isfinite(ranges), -np.inf, free)
    group = -(-len(free) // MAX_SECTORS)
    count = -(-len(free) // group)
    padded = np.full(count * group, np.nan)
    padded[: len(free)] = free
    rows = padded.reshape(count, group)
    nearest = np.where(np.isnan(rows), np.inf, rows).min(axis=1)
    nearest = np.where(np.isnan(rows).all(axis=1), np.nan, nearest)
    width = min(abs(step) * group, 2 * math.pi)
    middle = start + step * (np.arange(count) * group + (group - 1) / 2) + yaw_rad
    return tuple(
        RangeSector(
            bearing_rad=math.remainder(bearing, 2 * math.pi), width_rad=width, distance_m=distance
        )
        for bearing, distance in zip(middle.tolist(), nearest.tolist(), strict=True)
    )


def yaw_of(orientation: Any) -> float:
    """Heading of a quaternion, radians, left is positive."""
    x, y, z, w = (float(getattr(orientation, name)) for name in "xyzw")
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


class OdometryReader:
    """nav_msgs/Odometry to places since the first message, which never jump."""

    def __init__(self) -> None:
        self._seq = 0
        self._frame: tuple[float, float, float] | None = None
        """The robot's own pose at which its frame was set last."""
        self._origin = self._said = (0.0, 0.0, 0.0)
        """What was said of the pose then, and last."""
        self._last = (0.0, 0.0)

    def read(self, message: Any) -> Odometry | None:
        """The message; None where it holds a number that is none."""
        pose, twist = message.pose.pose, message.twist.twist
        x, y, heading = float(pose.position.x), float(pose.position.y), yaw_of(pose.orientation)
        linear, angular = float(twist.linear.x), float(twist.angular.z)
        if not all(map(math.isfinite, (x, y, heading, linear, angular))):
            return None
        if self._frame is None or math.hypot(x - self._last[0], y - self._last[1]) > _JUMP_M:
            self._frame, self._origin = (x, y, heading), self._said
        self._last = x, y
        at_x, at_y, at_heading = self._said = self._place(self._frame, (x, y, heading))
        self._seq += 1
        return Odometry(
            seq=self._seq - 1, x_m=at_x, y_m=at_y, heading_rad=at_heading, linear_mps=linear,
            angular_radps=angular,
        )  # fmt: skip

    def _place(
        self, start: tuple[float, float, float], now: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """Place since the first message, by the way since the frame was set."""
        origin = self._origin
        ahead, left = now[0] - start[0], now[1] - start[1]
        turn = origin[2] - start[2]
        cosine, sine = math.cos(turn), math.sin(turn)
        return (
            origin[0] + ahead * cosine - left * sine, origin[1] + ahead * sine + left * cosine,
            math.remainder(now[2] + turn, 2 * math.pi),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PersonThere:
    """One person as ROS is told of them.

    Attributes:
        x_m, y_m: ahead and to the left of the robot; None where nothing tells the distance.
        box_xyxy: pixels of the published picture.
        chosen: whether it is the one to be followed.
    """

    id: int
    x_m: float | None
    y_m: float | None
    box_xyxy: tuple[float, float, float, float]
    confidence: float
    chosen: bool


def people_of(tracks: Tracks, info: CameraInfo | None, chosen_id: int | None) -> list[PersonThere]:
    """The people of a frame that a user is shown.

    Args:
        tracks: of the frame.
        info: of the camera; without it only a measured distance and bearing make a place.
        chosen_id: of the person to be followed.
    """
    camera = None if info is None else camera_from_info(resized(info, tracks.width, tracks.height))
    yaw_rad = 0.0 if info is None else info.mount_yaw_rad or 0.0
    people = []
    for track in tracks.tracks:
        if not track.shown:
            continue
        seen = None if camera is None else locate_person(track.box_xyxy, camera)
        distance_m = seen.distance_m if track.distance_m is None and seen else track.distance_m
        bearing_rad = seen.bearing_rad if track.bearing_rad is None and seen else track.bearing_rad
        x_m = y_m = None
        if distance_m is not None and bearing_rad is not None:
            x_m = distance_m * math.cos(bearing_rad + yaw_rad)
            y_m = distance_m * math.sin(bearing_rad + yaw_rad)
        people.append(PersonThere(track.id, x_m, y_m, track.box_xyxy, track.identity_confidence,
                                  track.id == chosen_id))  # fmt: skip
    return people


@dataclass(frozen=True, slots=True)
class PartStatus:
    """One entry of a diagnostic_msgs/DiagnosticArray."""

    name: str
    level: int
    message: str
    values: dict[str, str]


OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/DiagnosticStatus."""
_LEVELS = {"starting": WARN, "ok": OK, "degraded": WARN, "error": ERROR, "ended": STALE}
_COUNTERS = ("rate_in_hz", "rate_out_hz", "received", "sent", "dropped", "malformed", "busy_ms_p95",
             "age_ms_p95", "cpu_s", "rss_mb", "uptime_s")  # fmt: skip


def status_of(health: Health, silent_s: float) -> PartStatus:
    """What a service last said of itself.

    Args:
        health: the message.
        silent_s: since it came. A part that misses `BEATS_MISSED` messages is stale.
    """
    level, message = _LEVELS[health.state], health.reason or health.state
    if health.state != "ended" and silent_s > BEATS_MISSED * health.period_s:
        level, message = STALE, f"silent for {silent_s:.1f} s"
    values = {name: f"{getattr(health, name):g}" for name in _COUNTERS}
    return PartStatus(
        f"heel: {health.service}/{health.instance}", level, message, values | health.details
    )
