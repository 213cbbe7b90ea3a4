"""Many robots at once, told apart by the name before every key: who is there, and what each does.

Pure: the caller brings messages and the time. It is heard with a session that has no name of its
own, or the part of it that all these robots have in common.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from heel.schemas import DriveState, FollowState, Health, Target, decode, keys
from heel.services.runtime.chain import (
    CERTIFICATE,
    CHAIN,
    MISSING,
    ChainWatch,
    Part,
    Problem,
    describe,
    fails,
    page_of,
)
from heel.services.runtime.logs import printable
from heel.services.runtime.stops import HOLDS, STOP_DETAIL, Stops

if TYPE_CHECKING:
    import zenoh

TOPICS = {"health": f"**/{keys.ALL_HEALTH}", "state": f"**/{keys.FOLLOW_STATE}"}
"""What is listened to, beside `ALL_ALIVE`; neither pictures nor anything that comes with each."""
ALL_ALIVE = f"**/{keys.ALL_ALIVE}"
ROBOTS_PAGE = "robots"
"""Detail of the health, and instance, of a page that lists robots: it is no robot's part."""
_CHUNKS = {"health": 4, "state": 2, "alive": 3}
"""Of a key, behind the robot's name."""
_OF_A_ROBOT = frozenset((*CHAIN, "simulator", "ros2"))
"""Services of which one is enough to tell that there is a robot."""
_ONCE_A_FRAME = ("tracker", "detector", "capture", "simulator")
"""Services that send one message a frame, the last of the chain first."""
_MOST_ROBOTS = 256
"""Robots that are remembered; chosen by hand."""
_LONGEST_NAME = 128
"""Characters of a robot's name, as of the setting."""
_STATE_HOLDS_S = 2.0
"""Age up to which a state is told [s]; a follower sends five a second, a drive fifty. Chosen by
hand."""
_FIRST_WORD_S = 2.0
"""Seconds until a robot that is expected has to be heard: eight messages of health. Chosen by
hand."""


@dataclass
class RobotWatch:
    """What one robot's services say of themselves."""

    watch: ChainWatch = field(default_factory=ChainWatch)
    state: FollowState | None = None
    """The follower's newest."""
    state_s: float = float("-inf")
    """When it came, monotonic."""
    drive: DriveState | None = None
    """The drive's newest, where it is listened to."""
    drive_s: float = float("-inf")
    """When it came, monotonic."""

    @property
    def page(self) -> str | None:
        """Where its live page is, if one is served."""
        return _page_of(self.watch.parts.values())

    def lacks(
        self, expected: Iterable[str], now_s: float, stack: Collection[str] = ()
    ) -> list[Problem]:
        """Problems of the services that are present, and the services that are missing.

        Args:
            expected: services that have to be there.
            now_s: monotonic.
            stack: those of them of which nothing is known but that the settings name them.
        """
        found = self.watch.problems(now_s)
        wanted = set(expected)
        for part, state in self.watch.rows(now_s):
            if state == "ok" and part.health.details.get(MISSING):
                wanted |= set(part.health.details[MISSING].split(","))
        return found + [
            replace(one, words=f"{one.part}: not running, and the robot's stack has it")
            if one.part in stack else one
            for one in self.watch.missing(wanted, now_s)
        ]  # fmt: skip

    def state_now(self, now_s: float) -> FollowState | None:
        """The follower's state; None where its newest is too old to tell anything."""
        return self.state if now_s - self.state_s < _STATE_HOLDS_S else None

    def drive_now(self, now_s: float) -> DriveState | None:
        """The drive's state; None where its newest is too old to tell anything."""
        return self.drive if now_s - self.drive_s < _STATE_HOLDS_S else None

    def stops(self, now_s: float) -> Stops:
        """Whether drive and follower say that the emergency stop holds."""
        drive, follower = self.drive_now(now_s), self.state_now(now_s)
        drives = self._stops_of("drive", now_s)
        followers = self._stops_of("follower", now_s)
        # One's own message is the newer one; of several, health alone tells which it is of.
        if drive is not None and len(drives) < 2:
            drives = [drive.estop]
        if follower is not None and len(followers) < 2:
            followers = [follower.estop]
        return Stops(all(drives) if drives else None, all(followers) if followers else None)

    def _stops_of(self, service: str, now_s: float) -> list[bool]:
        return [
            part.health.details[STOP_DETAIL] == HOLDS
            for part, state in self.watch.rows(now_s)
            if part.health.service == service and state == "ok" and not part.stands_by
            and STOP_DETAIL in part.health.details
        ]  # fmt: skip

    def heard_s(self) -> float | None:
        """When a part was heard last, monotonic; None: never."""
        return max((part.heard_s for part in self.watch.parts.values()), default=None)


@dataclass
class Robots:
    """All robots of one router, by the name before their keys.

    Args:
        expected: names of robots that have to be there.
        stack: services that each of them has to have.
        begun_s: since when they are listened to, monotonic.
    """

    expected: tuple[str, ...] = ()
    stack: tuple[str, ...] = ()
    begun_s: float = float("-inf")
    malformed: int = 0
    """Messages that could not be read."""
    unlisted: int = 0
    """Messages of robots that found no place."""
    _robots: dict[str, RobotWatch] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._robots |= {name: RobotWatch() for name in self.expected}

    def hear(
        self, topic: str, key: str, payload: bytes, encoding: str, arrived_s: float
    ) -> None:  # fmt: skip
        """Take a message of `TOPICS`.

        Raises:
            MessageError: it cannot be read.
        """
        if topic == "state":
            state = decode(FollowState, payload, encoding)
            robot = self._of(key, topic)
            if robot is not None:
                robot.state, robot.state_s = state, arrived_s
            return
        health = decode(Health, payload, encoding)
        if ROBOTS_PAGE in health.details and health.service == "web":
            return
        robot = self._of(key, topic, new=health.service in _OF_A_ROBOT)
        if robot is not None:
            robot.watch.hear(health, arrived_s)

    def token(self, key: str, present: bool, now_s: float) -> None:
        """A liveliness token came or went."""
        *_, service, instance = key.split("/")
        if (service, instance) == ("web", ROBOTS_PAGE):
            return
        robot = self._of(key, "alive", new=present and service in _OF_A_ROBOT)
        if robot is not None:
            robot.watch.token(service, instance, present, now_s)

    def _of(self, key: str, topic: str, new: bool = True) -> RobotWatch | None:
        name = "/".join(key.split("/")[: -_CHUNKS[topic]])
        robot = self._robots.get(name)
        if robot is not None or not new:
            return robot
        if len(name) > _LONGEST_NAME or len(self._robots) >= _MOST_ROBOTS:
            self.unlisted += 1
            return None
        return self._robots.setdefault(name, RobotWatch())

    def rows(self, now_s: float) -> list[RobotRow]:
        """Every robot that was heard or is expected, by name."""
        return [self._row(name, now_s) for name in sorted(self._robots)]

    def _row(self, name: str, now_s: float) -> RobotRow:
        robot = self._robots[name]
        heard_s = robot.heard_s()
        parts = [part for part, state in robot.watch.rows(now_s) if state == "ok"]
        problems = robot.lacks(self.stack, now_s, self.stack)
        if not parts and now_s - self.begun_s > _FIRST_WORD_S:
            since = "" if heard_s is None else f" for {now_s - heard_s:.0f} s"
            problems = [Problem("robot", "gone", f"nothing is heard of it{since}")]
        # Each sends one message a frame, and the tracker is the last that does.
        rates = [
            part.health.rate_out_hz for service in _ONCE_A_FRAME
            for part in parts if part.health.service == service and not part.stands_by
        ]  # fmt: skip
        problems += [
            Problem(part.health.service, "fails",
                    f"{part.health.service}: {part.health.reason or part.health.state}")
            for part in parts if fails(part.health)
        ]  # fmt: skip
        return RobotRow(
            name=name,
            state=robot.state_now(now_s),
            stops=robot.stops(now_s),
            frames_per_s=rates[0] if rates else None,
            page=_page_of(parts),
            heard_age_s=None if heard_s is None else max(0.0, now_s - heard_s),
            problems=tuple(problems),
            notes=tuple(
                f"{part.health.service}: {part.health.details[CERTIFICATE]}"
                for part in parts if CERTIFICATE in part.health.details
            ),
        )  # fmt: skip


@dataclass(frozen=True)
class RobotRow:
    """What a person in charge of several robots wants to know of one.

    Attributes:
        name: before its keys; empty where it has none.
        state: of its follower; None: it says nothing at present.
        stops: whether the emergency stop holds, by drive and follower.
        frames_per_s: that are tracked; None: nobody says so.
        page: address of its live page.
        heard_age_s: since any part of it was heard; None: never.
        problems: what keeps it from following.
        notes: what has to be seen to soon.
    """

    name: str
    state: FollowState | None
    stops: Stops
    frames_per_s: float | None
    page: str | None
    heard_age_s: float | None
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Text of services is as they sent it, short of what a terminal would obey."""
        found: dict[str, Any] = {
            "name": self.name,
            "state": None,
            "frames_per_s": None if self.frames_per_s is None else round(self.frames_per_s, 1),
            "page": self.page,
            "heard_age_s": None if self.heard_age_s is None else round(self.heard_age_s, 1),
            "problems": describe(self.problems),
            "notes": [printable(one) for one in self.notes],
        } | self.stops.as_json()
        state = self.state
        if state is None:
            return found
        return found | {
            "state": state.state,
            "reason": printable(state.reason),
            "target": whom(state.target),
            "identity_confidence": state.identity_confidence,
            "distance_m": state.distance_m,
            "linear_mps": state.linear_mps,
            "tracks_age_s": state.tracks_age_s,
        }


def _page_of(parts: Iterable[Part]) -> str | None:
    return next((url for part in parts if (url := page_of(part.health))), None)


def let_through(session: zenoh.Session, resources: ExitStack) -> None:
    """Hear also where access rules allow a robot's own keys and refuse those of all robots.

    A router passes on what is asked for by a key that its rules allow; what then comes goes to all
    listeners of the session.
    """
    from zenoh.handlers import RingChannel

    for key in (keys.ALL_HEALTH, keys.FOLLOW_STATE):
        resources.callback(session.declare_subscriber(key, RingChannel(1)).undeclare)
    tokens = session.liveliness().declare_subscriber(keys.ALL_ALIVE, RingChannel(1))
    resources.callback(tokens.undeclare)


def whom(target: Target) -> str:
    """Who is followed, in few characters: `7`, `nearest`, `none`."""
    return target.mode if target.track_id is None else str(target.track_id)
