"""A small world of points: people walk, a robot with inertia and latency does as it is told."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from heel.schemas import CameraInfo, MotionCommand, Odometry, Track, Tracks
from heel.services.follower.core import Follower
from heel.services.follower.own_motion import Pose
from heel.services.geometry.camera import GroundCamera, Pinhole

TRACKER = "tracker/main@00000001"
CAMERA = Pinhole.from_fov(640, 480, math.pi / 2).mounted(0.8, 0.0)
INFO = CameraInfo(
    stream="front", epoch=1, width=640, height=480, source_width=640, source_height=480, fps=20.0,
    source="a test", horizontal_fov_rad=math.pi / 2, mount_height_m=0.8, mount_pitch_rad=0.0,
)  # fmt: skip
STEP_S = 0.02
FRAME_S = 0.05
Walk = Callable[[float], tuple[float, float]]
"""Place (x, y) in metres at a time."""


@dataclass
class Sample:
    """What there was at one moment."""

    t_s: float
    distance_m: float
    bearing_rad: float
    command: MotionCommand
    nearest_m: float


@dataclass
class World:
    """Runs a follower with person 1 chosen at the first frame.

    Attributes:
        latency_s: from a picture to its tracks.
        command_s: from a command to the robot's beginning to do it; inertia comes on top.
        hidden: who is out of sight, at a time, whatever the geometry says.
    """

    walks: Mapping[int, Walk]
    follower: Follower
    latency_s: float = 0.06
    command_s: float = 0.06
    inertia_s: float = 0.1
    noise_px: float = 1.0
    odometry: bool = False
    height_m: float = 1.7
    hidden: Callable[[int, float], bool] = lambda _id, _t: False
    pose: Pose = field(default_factory=Pose)

    def run(self, seconds: float, seed: int = 1) -> list[Sample]:
        """Drive from standstill; one sample per control step."""
        random = np.random.default_rng(seed)
        self.follower.set_camera(INFO)
        coming: deque[tuple[float, Tracks]] = deque()
        told: deque[tuple[float, float, float]] = deque()
        velocity = np.zeros(2)
        wished = np.zeros(2)
        newest_s, due_s, samples = None, 0.0, []
        for step in range(round(seconds / STEP_S)):
            t = step * STEP_S
            if t >= due_s - 1e-9:
                coming.append((t, self._picture(t, random)))
                due_s += FRAME_S
            while coming and coming[0][0] + self.latency_s <= t + 1e-9:
                newest_s, tracks = coming.popleft()
                self.follower.observe(tracks, TRACKER)
                if self.follower.target.track_id is None and self.follower.target.mode == "none":
                    self.follower._choice._set("id", 1, "chosen")
            if self.odometry:
                self.follower.observe_odometry(
                    Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0,
                             linear_mps=float(velocity[0]), angular_radps=float(velocity[1])), t,
                )  # fmt: skip
            command = self.follower.step(t, None if newest_s is None else t - newest_s)
            told.append((t + self.command_s, command.linear_mps, command.angular_radps))
            while told and told[0][0] <= t + 1e-9:
                wished = np.array(told.popleft()[1:])
            velocity += (wished - velocity) * min(1.0, STEP_S / self.inertia_s)
            self.pose = self.pose.moved(float(velocity[0]), float(velocity[1]), STEP_S)
            ahead, left = self.pose.seen(*self.walks[1](t))
            nearest = min(math.hypot(*self.pose.seen(*walk(t))) for walk in self.walks.values())
            samples.append(
                Sample(t, math.hypot(ahead, left), math.atan2(left, ahead), command, nearest)
            )
        return samples

    def _picture(self, t: float, random: np.random.Generator) -> Tracks:
        """The boxes of everybody in view, with noise, cut at the borders."""
        people = []
        for number, walk in self.walks.items():
            place = self.pose.seen(*walk(t))
            if place[0] < 0.2 or self.hidden(number, t):
                continue
            box = CAMERA.person_boxes(place, self.height_m) + random.normal(0, self.noise_px, 4)
            left, right = max(0.0, float(box[0])), min(640.0, float(box[2]))
            if right - left < 8:
                continue
            people.append(
                Track(
                    id=number,
                    state="tracked",
                    velocity_pxps=(0.0, 0.0),
                    area_px=1.0,
                    span_px=1.0,
                    box_xyxy=(left, max(0.0, float(box[1])), right, min(480.0, float(box[3]))),
                    identity_confidence=1.0,
                    shown=True,
                )
            )
        seq = round(t / FRAME_S)
        return Tracks(
            stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=round(t * 1e9), width=640,
            height=480, source_width=640, source_height=480, tracks=tuple(people),
        )  # fmt: skip


def camera() -> GroundCamera:
    """The camera of this world."""
    return CAMERA
