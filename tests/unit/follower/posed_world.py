"""A small world of people who bend, sit and crouch, seen by a camera mounted anyhow.

The follower's core alone, with a robot that obeys late; boxes are those of a true pinhole at the
true height and pitch, which the follower may or may not be told.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from heel.schemas import CameraInfo, Odometry, Ranges, TargetRequest, Track, Tracks
from heel.schemas.robot import RangeSector
from heel.services.follower.core import Follower
from heel.services.follower.own_motion import Pose
from heel.services.follower.settings import FollowerSettings
from heel.services.geometry.camera import Pinhole

TRACKER = "tracker/main@00000001"
STEP_S, FRAME_S = 0.02, 0.05
TRACKS_AGE_S, LAG_S = 0.06, 0.1
CONTACT_M = 0.45
_SIZE = (640, 480)
Span = Callable[[float], tuple[float, float]]
"""Lower and upper end of what is seen of somebody, m above ground, at a time."""


def still(x_m: float, y_m: float = 0.0) -> Callable[[float], tuple[float, float]]:
    """Somebody who stands there."""
    return lambda _t_s: (x_m, y_m)


def upright(_t_s: float) -> tuple[float, float]:
    """Feet and head of an adult."""
    return 0.0, 1.7


def change(
    low_m: float, high_m: float, from_s: float = 6.0, within_s: float = 1.0,
    until_s: float = math.inf, tall_m: float = 1.7,
) -> Span:  # fmt: skip
    """Lower and upper end of what is seen of somebody who changes posture, and perhaps back."""

    def span(t_s: float) -> tuple[float, float]:
        share = min(max((t_s - from_s) / within_s, 0.0), 1.0)
        share = min(share, 1.0 - min(max((t_s - until_s) / within_s, 0.0), 1.0))
        return low_m * share, tall_m + (high_m - tall_m) * share

    return span


@dataclass(frozen=True)
class Body:
    """A person: where they are, what is seen of them, and how wide they are."""

    place: Callable[[float], tuple[float, float]]
    span: Span = upright
    width_m: Callable[[float], float] = lambda _t_s: 0.5


@dataclass(frozen=True)
class Eye:
    """The camera, and what the follower is told of it.

    Attributes:
        noise: of every edge, as a share of the box's height.
        flicker: share of frames in which a box lacks its lowest part.
    """

    calibrated: bool = False
    height_m: float = 0.8
    pitch_deg: float = 0.0
    fov_deg: float = 60.0
    noise: float = 0.01
    flicker: float = 0.0

    def lens(self) -> Pinhole:
        """Without mounting."""
        return Pinhole.from_fov(*_SIZE, math.radians(self.fov_deg))

    def info(self) -> CameraInfo:
        """What the camera says of itself."""
        return CameraInfo(
            stream="front", epoch=1, width=_SIZE[0], height=_SIZE[1], source_width=_SIZE[0],
            source_height=_SIZE[1], fps=20.0, source="a test",
            horizontal_fov_rad=math.radians(self.fov_deg),
            mount_height_m=self.height_m if self.calibrated else None,
            mount_pitch_rad=math.radians(self.pitch_deg) if self.calibrated else None,
        )  # fmt: skip


@dataclass
class Moment:
    """What there was at one moment; `told_m` by the follower, `least_m` to anybody in sight."""

    t_s: float
    distance_m: float
    told_m: float | None
    state: str
    linear_mps: float
    driven_to_m: float


@dataclass
class PosedWorld:
    """Runs a follower with the first of the people chosen."""

    people: Mapping[int, Body]
    eye: Eye = field(default_factory=Eye)
    ranges: bool = False
    odometry: bool = True
    settings: FollowerSettings = field(default_factory=FollowerSettings)
    hidden: Callable[[int, float], bool] = lambda _id, _t: False

    def run(self, seconds: float, seed: int = 0) -> list[Moment]:
        """Drive from standstill; one moment per control step."""
        self._random = np.random.default_rng(seed)
        follower = Follower(self.settings)
        follower.set_camera(self.eye.info())
        coming: deque[tuple[float, Tracks]] = deque()
        told: deque[tuple[float, float, float]] = deque()
        newest_s: float | None = None
        pose, linear, angular, wished = Pose(), 0.0, 0.0, (0.0, 0.0)
        moments = []
        for step in range(round(seconds / STEP_S)):
            t_s = step * STEP_S
            if step % round(FRAME_S / STEP_S * 2) in (0, round(FRAME_S / STEP_S)):
                coming.append((t_s, self._picture(t_s, pose)))
            while coming and coming[0][0] + TRACKS_AGE_S <= t_s + 1e-9:
                newest_s, tracks = coming.popleft()
                follower.observe(tracks, TRACKER)
                first = next(iter(self.people))
                if follower.target.track_id is None and any(t.id == first for t in tracks.tracks):
                    follower.choose(TargetRequest(mode="id", track_id=first))
            if self.odometry:
                follower.observe_odometry(
                    Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=linear,
                             angular_radps=angular), t_s,
                )  # fmt: skip
            if self.ranges and step % 3 == 0:
                follower.observe_ranges(self._ranges(t_s, pose), t_s)
            command = follower.step(t_s, None if newest_s is None else t_s - newest_s)
            told.append((t_s + LAG_S, command.linear_mps, command.angular_radps))
            while told and told[0][0] <= t_s + 1e-9:
                wished = told.popleft()[1:]
            linear += min(max(wished[0] - linear, -0.1), 0.1)
            angular += min(max(wished[1] - angular, -0.2), 0.2)
            pose = pose.moved(linear, angular, STEP_S)
            moments.append(self._moment(t_s, pose, linear, follower))
        return moments

    def _moment(self, t_s: float, pose: Pose, linear_mps: float, follower: Follower) -> Moment:
        places = {number: pose.seen(*body.place(t_s)) for number, body in self.people.items()}
        away = {number: math.hypot(*place) for number, place in places.items()}
        half = math.radians(self.eye.fov_deg / 2)
        driven_to_m = min(
            (away[number] for number, (ahead, left) in places.items()
             if abs(math.atan2(left, ahead)) < half and linear_mps * ahead / away[number] > 0.02
             and not self.hidden(number, t_s)),
            default=math.inf,
        )  # fmt: skip
        first = next(iter(self.people))
        return Moment(t_s, away[first], follower.state.distance_m, follower.state.state,
                      linear_mps, driven_to_m)  # fmt: skip

    def _picture(self, t_s: float, pose: Pose) -> Tracks:
        people = []
        for number, body in self.people.items():
            box = self._box(body, t_s, pose)
            if box is not None and not self.hidden(number, t_s):
                people.append(
                    Track(
                        id=number,
                        state="tracked",
                        velocity_pxps=(0.0, 0.0),
                        area_px=1.0,
                        span_px=1.0,
                        box_xyxy=box,
                        identity_confidence=1.0,
                        shown=True,
                    )
                )
        seq = round(t_s / STEP_S)
        return Tracks(
            stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=round(t_s * 1e9),
            width=_SIZE[0], height=_SIZE[1], source_width=_SIZE[0], source_height=_SIZE[1],
            tracks=tuple(people),
        )  # fmt: skip

    def _box(self, body: Body, t_s: float, pose: Pose) -> tuple[float, float, float, float] | None:
        eye = self.eye
        ahead, left = pose.seen(*body.place(t_s))
        if ahead < 0.15:
            return None
        low_m, high_m = body.span(t_s)
        camera = eye.lens().mounted(eye.height_m, math.radians(eye.pitch_deg))
        rows = [float(camera.pixels([ahead, left, z])[1]) for z in (high_m, low_m)]
        column = float(camera.pixels([ahead, left, (low_m + high_m) / 2])[0])
        below_m = eye.height_m - (low_m + high_m) / 2
        depth = ahead * math.cos(camera.pitch_rad) + below_m * math.sin(camera.pitch_rad)
        if not all(map(math.isfinite, (*rows, column))) or depth < 0.1:
            return None
        half = camera.focal_px * body.width_m(t_s) / (2 * depth)
        error = eye.noise * (rows[1] - rows[0]) * self._random.standard_normal(4)
        if self._random.random() < eye.flicker:
            rows[1] -= 0.2 * (rows[1] - rows[0])
        return _cut(
            (column - half + error[0] / 2, rows[0] + error[1], column + half + error[2] / 2,
             rows[1] + error[3])
        )  # fmt: skip

    def _ranges(self, t_s: float, pose: Pose) -> Ranges:
        width = 2 * math.pi / 36
        places = [pose.seen(*body.place(t_s)) for body in self.people.values()]
        sectors = []
        for index in range(36):
            bearing = math.remainder(index * width, 2 * math.pi)
            nearest = 8.0
            for ahead, left in places:
                away = math.hypot(ahead, left)
                off = abs(math.remainder(math.atan2(left, ahead) - bearing, 2 * math.pi))
                if off < math.atan2(0.2, max(away, 0.01)) + width / 2:
                    nearest = min(nearest, max(0.0, away - 0.2))
            sectors.append(RangeSector(bearing_rad=bearing, width_rad=width, distance_m=nearest))
        return Ranges(seq=round(t_s / STEP_S), sectors=tuple(sectors))


def _cut(box: Sequence[float]) -> tuple[float, float, float, float] | None:
    left, right = (min(max(box[side], 0.0), float(_SIZE[0])) for side in (0, 2))
    top, bottom = (min(max(box[side], 0.0), float(_SIZE[1])) for side in (1, 3))
    return (left, top, right, bottom) if right - left > 4 and bottom - top > 8 else None
