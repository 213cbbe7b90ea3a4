"""One click in a world with things that look like people, and what the robot makes of it.

Needs the extra `sim`: everything is told from pixels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from heel.schemas import FrameId, HeelError, Pointed, SimTruth, Target, TargetRequest, Track, Tracks
from heel.services.drive.core import Drive
from heel.services.follower.core import Follower
from heel.services.loops.scenarios.episode import StackSettings
from heel.services.loops.scenarios.loop import ClosedLoop
from heel.services.loops.scenarios.pixels import Camera, RenderedPixels
from heel.services.loops.user import Choose, View
from heel.services.simulator.render.props import mirror_images
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.script import Scenario
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount, Look, Obstacle, PersonState
from heel.services.simulator.walks import Leg
from heel.services.simulator.world import World

Aim = Literal["anything", "drawn person", "clothes", "coat stand", "mirror image", "person"]
"""What is clicked on: any place without a person, a thing that looks like one, or one."""
AIMS: tuple[Aim, ...] = get_args(Aim)
WORLDS = ("straight", "stands-still", "distractor-2", "crowd", "light-switch", "pillar", "twin")
OFF_PX = 40.0
"""An empty click is at least so far from everybody's true box."""
_CLICK_S = 1.0
"""When the click is made; chosen by hand: the picture has settled."""
_WATCHED_S = 8.0
"""Time from the click on that is watched: longer than a place is looked at without evidence."""
_DRIVES_MPS = 0.01
"""A robot that is slower stands."""
_SHOWN_FRAMES = 3
"""A box that is shown for fewer is a flicker nobody can click on; chosen by hand."""
_CHEST = 0.4
"""Share of a box above the place that is clicked on."""
_THINGS_CHEST_M = 1.2
"""Height above the ground at which things are clicked on: where a person's chest would be."""
_WALL: tuple[int, int, int] = (225, 225, 225)
"""Colour of what is put up; chosen by hand."""

Point = tuple[float, float]
Size = tuple[float, float, float]
_THINGS: dict[Look, Size] = {
    "drawn person": (1.0, 0.04, 2.0), "clothes": (0.4, 0.35, 1.75),
    "coat stand": (0.4, 0.4, 1.75), "glass": (3.0, 0.05, 2.1),
}  # fmt: skip
"""Width, depth and height in metres of things that may be taken for people."""


@dataclass(frozen=True, slots=True)
class Claim:
    """What one frame's box said after the click.

    Attributes:
        confidence: that it is the person that was chosen.
        proven: whether it was said to be a person.
        right: whether a person was under it; the one clicked on, if it was one.
    """

    confidence: float
    proven: bool
    right: bool


@dataclass(frozen=True, slots=True)
class ClickOutcome:
    """What became of one click.

    Attributes:
        box_s, proven_s: from the click to the first box that was right, and to proof; None: never.
        box_on_nothing: whether the target had a box without a person.
        driven: whether the robot drove after it.
        top_mps: its greatest speed then.
        reason: what the page said last.
    """

    world: str
    seed: int
    aim: Aim
    box_s: float | None
    proven_s: float | None
    box_on_nothing: bool
    driven: bool
    top_mps: float
    reason: str
    claims: tuple[Claim, ...] = field(repr=False)


def click_in(settings: StackSettings, name: str, seed: int, aim: Aim) -> ClickOutcome | None:
    """Play a world with one click in it; None where it has nothing of the kind to click on."""
    mount = CameraMount()
    world = _with_things(name, seed)
    follower, drive = Follower(settings.follower), Drive(settings.drive)
    with Camera(world, mount) as camera:
        eyes = _Watched(RenderedPixels(camera, settings.detector, settings.tracker))
        user = _OneClick(world, mount, aim, follower, eyes)
        ClosedLoop(world, mount, eyes, follower, drive, user=user).run()
    return user.outcome(name, seed)


class _Watched:
    """Perception whose newest tracks are kept."""

    def __init__(self, eyes: RenderedPixels) -> None:
        self._eyes = eyes
        self.tracks: tuple[Track, ...] = ()

    def see(self, frame: FrameId) -> Tracks:
        tracks = self._eyes.see(frame)
        self.tracks = tuple(track for track in tracks.tracks if track.shown)
        return tracks

    def point(self, pointed: Pointed) -> None:
        self._eyes.point(pointed)


class _OneClick:
    """Clicks once, and looks at what comes of it."""

    def __init__(
        self, world: World, mount: CameraMount, aim: Aim, follower: Follower, eyes: _Watched
    ) -> None:
        self._world, self._mount, self._aim = world, mount, aim
        self._follower, self._eyes = follower, eyes
        self._rng = np.random.default_rng([world.seed, AIMS.index(aim)])
        self._person = [person.role for person in world.people].index("target")
        self._clicked_s: float | None = None
        self._impossible = False
        self._box_s: float | None = None
        self._proven_s: float | None = None
        self._on_nothing_frames = 0
        self._driven = False
        self._top_mps = 0.0
        self._claims: list[Claim] = []

    def act(self, view: View, choose: Choose) -> None:
        if self._clicked_s is not None:
            self._watch(view.now_s - self._clicked_s, view.shown, view.people)
        elif view.now_s >= _CLICK_S and not self._impossible:
            place = self._place(view.truth)
            self._impossible = place is None
            if place is None:
                return
            self._clicked_s = view.now_s
            # A refusal is a right answer, too.
            with suppress(HeelError):
                choose(TargetRequest(mode="point", x_px=place[0], y_px=place[1]))

    def outcome(self, name: str, seed: int) -> ClickOutcome | None:
        if self._clicked_s is None:
            return None
        return ClickOutcome(
            name, seed, self._aim, self._box_s, self._proven_s,
            self._on_nothing_frames >= _SHOWN_FRAMES, self._driven, self._top_mps,
            self._follower.state.reason, tuple(self._claims),
        )  # fmt: skip

    def _watch(self, since_s: float, shown: Target, people: dict[int, int]) -> None:
        for track in self._eyes.tracks:
            if track.id == shown.track_id:
                on = people.get(track.id)
                right = on is not None and (self._aim != "person" or on == self._person)
                self._claims.append(Claim(track.identity_confidence, track.proven, right))
                self._note(since_s, track, on, right)

    def _note(self, since_s: float, track: Track, on: int | None, right: bool) -> None:
        if right and self._box_s is None:
            self._box_s = since_s
        if right and track.proven and self._proven_s is None:
            self._proven_s = since_s
        if on is None:
            self._on_nothing_frames += 1
            speed_mps = abs(self._follower.state.linear_mps)
            self._driven = self._driven or speed_mps > _DRIVES_MPS
            self._top_mps = max(self._top_mps, speed_mps)

    def _place(self, truth: SimTruth) -> Point | None:
        if self._aim == "person":
            box = truth.people[self._person].box_xyxy
            if box is None or truth.people[self._person].visible < 0.5:
                return None
            return (box[0] + box[2]) / 2, box[1] + _CHEST * (box[3] - box[1])
        if self._aim == "anything":
            places = iter(lambda: self._anywhere(), None)
        elif self._aim == "mirror image":
            robot = self._world.robot
            images = mirror_images(
                self._world.people, self._world.scenery.obstacles, (robot.x_m, robot.y_m)
            )
            places = iter([self._seen(image, 0.6 * image.height_m) for image in images])
        else:
            things = (o for o in self._world.scenery.obstacles if o.look == self._aim)
            places = iter([self._seen(thing, _THINGS_CHEST_M) for thing in things])
        return next((place for place in places if self._is_empty(place, truth)), None)

    def _anywhere(self) -> Point:
        x, y = self._rng.uniform((0, 0), (self._mount.width_px, self._mount.height_px)).tolist()
        return x, y

    def _seen(self, thing: Obstacle | PersonState, up_m: float) -> Point:
        """Where the camera sees a height above the place of a thing."""
        robot, mount = self._world.robot, self._mount
        x, y = thing.x_m - robot.x_m, thing.y_m - robot.y_m
        cosine, sine = math.cos(robot.heading_rad), math.sin(robot.heading_rad)
        ahead, left = x * cosine + y * sine, y * cosine - x * sine
        if ahead <= 0.3:
            return -1.0, -1.0
        focal_px = mount.width_px / (2 * math.tan(mount.horizontal_fov_rad / 2))
        return (
            mount.width_px / 2 - focal_px * left / ahead,
            mount.height_px / 2 - focal_px * (up_m - mount.height_m) / ahead,
        )  # fmt: skip

    def _is_empty(self, place: Point, truth: SimTruth) -> bool:
        x, y = place
        inside = 0 <= x <= self._mount.width_px and 0 <= y <= self._mount.height_px
        boxes = [person.box_xyxy for person in truth.people if person.box_xyxy is not None]
        return inside and all(
            max(left - x, x - right, top - y, y - bottom) >= OFF_PX
            for left, top, right, bottom in boxes
        )


def _with_things(name: str, seed: int) -> World:
    """A scenario cut to one click's time, with things that look like people where there is room."""
    plain = scenario(name, seed)
    script, rng = plain.scenario, np.random.default_rng([seed, 61])
    obstacles = list(script.scenery.obstacles)
    for look, size in _THINGS.items():
        thing = _put(script, tuple(obstacles), look, size, rng)
        if thing is not None:
            obstacles.append(thing)
    scenery = replace(script.scenery, obstacles=tuple(obstacles))
    return World(replace(script, scenery=scenery, duration_s=_CLICK_S + _WATCHED_S), seed)


def _put(
    script: Scenario, obstacles: tuple[Obstacle, ...], look: Look, size: Size,
    rng: np.random.Generator,
) -> Obstacle | None:  # fmt: skip
    """A thing before the robot, off everybody's way; None where there is no room."""
    robot, solids = script.robot, Solids(obstacles)
    ways = np.array(list(_ways(script)))
    x0, y0, x1, y1 = script.scenery.bounds_m
    reach = max(size[0], size[1]) / 2
    for _ in range(200):
        away_m = float(rng.uniform(3.0, 7.0) if look == "glass" else rng.uniform(2.2, 4.5))
        bearing = robot.heading_rad + float(rng.uniform(-0.7, 0.7))
        x, y = robot.x_m + away_m * math.cos(bearing), robot.y_m + away_m * math.sin(bearing)
        if not (x0 + reach < x < x1 - reach and y0 + reach < y < y1 - reach):
            continue
        on_way = np.hypot(*(ways - (x, y)).T).min() < reach + 0.6
        near = len(solids) and solids.clearance(np.array([[x, y]]))[0].min() < reach + 0.3
        if not on_way and not near:
            heading = bearing + math.pi / 2 + float(rng.uniform(-0.3, 0.3))
            return Obstacle("furniture", x, y, heading, *size, _WALL, look)
    return None


def _ways(script: Scenario) -> Iterator[Point]:
    """Points on everybody's way, a quarter of a metre apart, and on the robot's to the target."""
    robot = script.robot
    for actor in script.people:
        legs = [(leg.x_m, leg.y_m) for leg in actor.walk.legs if isinstance(leg, Leg)]
        here = (actor.x_m, actor.y_m)
        starts = [here, *legs] if actor.role != "target" else [(robot.x_m, robot.y_m), here, *legs]
        for start, end in zip(starts, [*starts[1:], starts[-1]], strict=True):
            steps = max(1, round(4 * math.dist(start, end)))
            for step in range(steps):
                share = step / steps
                yield (
                    start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
                )  # fmt: skip
