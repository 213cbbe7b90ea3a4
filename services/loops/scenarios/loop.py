"""The closed loop on a simulated clock: world, perception, follower, drive, and back."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heel.schemas import FrameId, MotionCommand, SimTruth, Target, TargetRequest, Tracks
from heel.services.drive.core import Drive
from heel.services.follower.core import Follower
from heel.services.loops.judge import people_by_track
from heel.services.loops.scenarios.perception import STREAM, Perception, Senses, camera_info
from heel.services.loops.scenarios.witness import Moment, Witness
from heel.services.loops.user import Chooser, User
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World

if TYPE_CHECKING:
    from heel.services.loops.scenarios.pixels import Film

CONTROL_MS = 20
"""Follower and drive both run at 50 Hz, as their processes do."""
TRACKS_AGE_MS = 60
"""From acquisition to the follower's having the tracks."""
RANGES_MS = 60
_TRACKER = "tracker/main@00000000"
_FOLLOWER = "follower/main@00000000"


@dataclass(frozen=True, slots=True)
class _Sighting:
    """Tracks on their way to the follower, and what really was to be seen."""

    due_ms: int
    t_capture_ms: int
    tracks: Tracks
    truth: SimTruth
    people: dict[int, int]


class ClosedLoop:
    """One episode; the clock only moves by `run`.

    Args:
        world: before its first step.
        mount: the robot's camera.
        perception: sees this world.
        follower: nobody chosen yet.
        drive: waiting.
        film: gets every picture; None for none.
        senses: what the robot has besides the camera.
        user: chooses; None for somebody who clicks on the target.
    """

    def __init__(
        self, world: World, mount: CameraMount, perception: Perception, follower: Follower,
        drive: Drive,
        film: Film | None = None, senses: Senses | None = None, user: Chooser | None = None,
    ) -> None:  # fmt: skip
        self._world = world
        self._mount = mount
        self._perception = perception
        self._follower = follower
        self._drive = drive
        self._film = film
        self._ranges = senses is None or senses.ranges
        self._frame_ms = round(1000 / mount.fps)
        self._witness = Witness(world)
        self._user: Chooser = User() if user is None else user
        self._visible = [0.0] * len(world.people)
        self._sightings: deque[_Sighting] = deque()
        self._newest: _Sighting | None = None
        self._command: MotionCommand | None = None
        self._speed = (0.0, 0.0)
        self._frames = self._controls = 0
        follower.set_camera(camera_info(mount, senses is None or senses.calibrated))

    def run(self) -> Witness:
        """Go on until the scenario is over or the robot touches somebody."""
        now_ms = 0
        while not (self._world.finished or self._world.contacts):
            if now_ms % self._frame_ms == 0:
                self._take_picture(now_ms)
            if now_ms % CONTROL_MS == 0:
                self._control(now_ms)
            next_ms = min(_after(now_ms, self._frame_ms), _after(now_ms, CONTROL_MS))
            self._world.step((next_ms - now_ms) / 1000, *self._speed)
            now_ms = next_ms
        # The moment at which it ended belongs to it.
        self._record()
        return self._witness

    def _take_picture(self, now_ms: int) -> None:
        if not self._world.camera_on:
            return
        frame = FrameId(
            stream=STREAM, epoch=1, seq=self._frames, index=self._frames,
            t_capture_ns=now_ms * 1_000_000,
        )  # fmt: skip
        truth = self._world.truth(self._frames, self._mount)
        tracks = self._perception.see(frame)
        self._visible = [person.visible for person in truth.people]
        self._sightings.append(
            _Sighting(now_ms + TRACKS_AGE_MS, now_ms, tracks, truth, people_by_track(truth, tracks))
        )
        if self._film is not None:
            self._film.add(tracks, self._follower.state)
        self._frames += 1

    def _control(self, now_ms: int) -> None:
        now_s = now_ms / 1000
        # The drive's timer is not the follower's: it obeys the command of the round before.
        if self._command is not None:
            self._drive.take(self._command, _FOLLOWER, now_s)
        told = self._drive.step(now_s)
        self._speed = (told.linear_mps, told.angular_radps)
        self._observe(now_ms)
        age_s = None if self._newest is None else (now_ms - self._newest.t_capture_ms) / 1000
        self._command = self._follower.step(now_s, age_s)
        self._record()
        self._controls += 1

    def _observe(self, now_ms: int) -> None:
        now_s = now_ms / 1000
        self._follower.observe_odometry(self._world.odometry(self._controls), now_s)
        if self._ranges and now_ms % RANGES_MS == 0:
            self._follower.observe_ranges(self._world.ranges(self._controls), now_s)
        while self._sightings and self._sightings[0].due_ms <= now_ms:
            newest = self._newest = self._sightings.popleft()
            self._follower.observe(newest.tracks, _TRACKER)
            self._user.act(now_s, self._choose, self._follower.target, newest.truth, newest.people)

    def _choose(self, request: TargetRequest) -> Target:
        target = self._follower.choose(request)
        if (pointed := self._follower.pointed) is not None:
            self._perception.point(pointed)
        return target

    def _record(self) -> None:
        on = {} if self._newest is None else self._newest.people
        moment = Moment.of_world(self._world, self._visible)
        self._witness.record(moment, self._follower.state, on)


def _after(now_ms: int, period_ms: int) -> int:
    """The next multiple of the period."""
    return (now_ms // period_ms + 1) * period_ms
