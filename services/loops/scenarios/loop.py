"""The closed loop on a simulated clock: world, perception, follower, drive, and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heel.schemas import DriveState, FrameId, Ranges, SimTruth, Target, TargetRequest, Tracks
from heel.services.drive.core import Drive
from heel.services.follower.core import Follower
from heel.services.loops.control_loop import CONTROL_NS, Body, ControlLoop
from heel.services.loops.judge import people_by_track
from heel.services.loops.scenarios.perception import STREAM, Perception, Senses, camera_info
from heel.services.loops.scenarios.witness import Moment, Witness
from heel.services.loops.user import Chooser, User, View
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World

if TYPE_CHECKING:
    from heel.services.loops.scenarios.pixels import Film

_MS = 1_000_000
"""Nanoseconds."""
_CONTROL_MS = CONTROL_NS // _MS
_RANGES_MS = 60
"""Range sensors measure in every third round, as the simulator's process lets them."""


@dataclass(frozen=True, slots=True)
class _Picture:
    """What really was to be seen in a picture.

    Attributes:
        truth: everybody.
        people: index of the person by track id.
    """

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
        user: chooses; None for `User`, which clicks on the target.
        ranges: measures in place of the world's ring where the robot has none; None for nothing.
    """

    def __init__(
        self, world: World, mount: CameraMount, perception: Perception, follower: Follower,
        drive: Drive,
        film: Film | None = None, senses: Senses | None = None, user: Chooser | None = None,
        ranges: Callable[[int], Ranges | None] | None = None,
    ) -> None:  # fmt: skip
        self._world = world
        self._mount = mount
        self._perception = perception
        self._follower = follower
        self._control = ControlLoop(follower, drive, self._look)
        self._film = film
        ring = senses is None or senses.ranges
        self._ranges = world.ranges if ring else ranges
        self._frame_ms = round(1000 / mount.fps)
        self._witness = Witness(world)
        self._user: Chooser = User() if user is None else user
        self._visible = [0.0] * len(world.people)
        self._people: dict[int, int] = {}
        self._speed = (0.0, 0.0)
        self._now_ms = self._frames = self._rounds = 0
        follower.set_camera(camera_info(mount, senses is None or senses.calibrated))

    def run(self) -> Witness:
        """Go on until the scenario is over or the robot touches a person."""
        while not (self._world.finished or self._world.contacts):
            if self._now_ms % self._frame_ms == 0:
                self._take_picture()
            if self._now_ms % _CONTROL_MS == 0:
                self._control.round(self._now_ms * _MS, self._move)
                self._record()
                self._rounds += 1
            next_ms = min(_after(self._now_ms, self._frame_ms), _after(self._now_ms, _CONTROL_MS))
            self._world.step((next_ms - self._now_ms) / 1000, *self._speed)
            self._now_ms = next_ms
        # The moment at which it ended belongs to it.
        self._record()
        return self._witness

    def _take_picture(self) -> None:
        if not self._world.camera_on:
            return
        frame = FrameId(
            stream=STREAM, epoch=1, seq=self._frames, index=self._frames,
            t_capture_ns=self._now_ms * _MS,
        )  # fmt: skip
        truth = self._world.truth(self._frames, self._mount)
        tracks = self._perception.see(frame)
        self._visible = [person.visible for person in truth.people]
        picture = _Picture(truth, people_by_track(truth, tracks))
        self._control.show(frame.t_capture_ns, tracks, picture)
        if self._film is not None:
            self._film.add(tracks, self._follower.state)
        self._frames += 1

    def _move(self, told: DriveState) -> Body:
        self._speed = (told.linear_mps, told.angular_radps)
        odometry = self._world.odometry(self._rounds)
        measures = self._ranges is not None and self._now_ms % _RANGES_MS == 0
        return Body(odometry, self._ranges(self._rounds) if self._ranges and measures else None)

    def _look(self, tracks: Tracks, picture: _Picture) -> None:
        self._people = picture.people
        view = View(self._now_ms / 1000, self._follower.target, picture.truth, picture.people)
        self._user.act(view, self._choose)

    def _choose(self, request: TargetRequest) -> Target:
        target = self._follower.choose(request)
        if (pointed := self._follower.pointed) is not None:
            self._perception.point(pointed)
        return target

    def _record(self) -> None:
        moment = Moment.of_world(self._world, self._visible)
        self._witness.record(moment, self._follower.state, self._people)


def _after(now_ms: int, period_ms: int) -> int:
    """The next multiple of the period."""
    return (now_ms // period_ms + 1) * period_ms
