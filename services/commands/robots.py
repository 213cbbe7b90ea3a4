"""`heel status --all`: every robot of a router, and every run on this machine, in one line each."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from heel.schemas import HeelError, MessageError
from heel.services.commands.columns import aligned
from heel.services.commands.robot import TIMEOUT_S, Where, session_with
from heel.services.commands.screen import Screen
from heel.services.runtime.logs import printable
from heel.services.runtime.robots import ALL_ALIVE, TOPICS, RobotRow, Robots, whom

if TYPE_CHECKING:
    from heel.services.runtime.inbox import Inbox

_TURN_S = 0.05
"""Seconds between two looks at what has come, of a second that is listened to; chosen by hand."""
_COLUMNS = ("robot", "state", "target", "sure", "e-stop", "m/s", "frames/s", "age ms", "page")
_NO_NAME = "(no name)"
"""Of a robot whose keys have no name before them."""


@dataclass
class RobotsOf:
    """The robots of one router, as far as it can be heard."""

    where: Where
    robots: Robots
    inbox: Inbox | None
    failure: str = ""
    """Why it cannot."""

    def take(self) -> None:
        """All messages that have come."""
        import zenoh

        if self.inbox is None:
            return
        while (arrival := self.inbox.get(0.0)) is not None:
            if arrival.topic == "alive":
                there = arrival.sample.kind == zenoh.SampleKind.PUT
                self.robots.token(arrival.key, there, arrival.arrived_s)
                continue
            try:
                self.robots.hear(arrival.topic, arrival.key, arrival.payload, arrival.encoding,
                                 arrival.arrived_s)  # fmt: skip
            except MessageError:
                self.robots.malformed += 1

    def rows(self, now_s: float) -> list[tuple[str, RobotRow]]:
        """Every robot with the name by which a user knows it."""
        return [(self._known_as(row.name), row) for row in self.robots.rows(now_s)]

    def _known_as(self, name: str) -> str:
        own = self.where.zenoh.namespace
        if self.where.run is not None:
            # Of its own router, so that it needs no name on the bus.
            own = self.where.run.robot or f"{self.where.run.kind} {self.where.run.pid}"
        return "/".join(one for one in (own, name) if one) or _NO_NAME

    @property
    def problem(self) -> str:
        """What keeps all of its robots from being heard; empty: nothing."""
        if self.failure:
            return self.failure
        if self.where.run is not None and not self.robots.rows(time.monotonic()):
            return f"heel {self.where.run.kind} (process {self.where.run.pid}): nothing is heard"
        return ""


@contextmanager
def listening_to(places: list[tuple[Where, tuple[str, ...]]]) -> Iterator[list[RobotsOf]]:
    """Hear all robots of some routers.

    Args:
        places: each router, with the names of robots that have to be there.
    """
    with ExitStack() as stack:
        yield [_opened(where, expected, stack) for where, expected in places]


def _opened(where: Where, expected: tuple[str, ...], stack: ExitStack) -> RobotsOf:
    from heel.services.runtime import qos
    from heel.services.runtime.inbox import Inbox
    from heel.services.runtime.robots import let_through

    robots = Robots(expected, where.expected, time.monotonic())
    try:
        session = stack.enter_context(session_with(where))
    except HeelError as error:
        return RobotsOf(where, robots, None, str(error))
    inbox = stack.enter_context(Inbox(session))
    for topic, key in TOPICS.items():
        inbox.subscribe(topic, key, qos.HEALTH)
    inbox.subscribe_alive("alive", ALL_ALIVE)
    let_through(session, stack)
    return RobotsOf(where, robots, inbox)


def listen(heard: list[RobotsOf], for_s: float, stopped: Callable[[float], bool]) -> None:
    """Take what comes for so many seconds.

    Args:
        heard: the routers.
        for_s: seconds.
        stopped: waits so many seconds, and tells whether the command is to end.
    """
    until_s = time.monotonic() + for_s
    while (left_s := until_s - time.monotonic()) > 0 and not stopped(min(_TURN_S, left_s)):
        for one in heard:
            one.take()


def lines(heard: list[RobotsOf], now_s: float) -> list[str]:
    """One line a robot, then what is wrong with each."""
    table: list[tuple[str, ...]] = [_COLUMNS]
    told: list[str] = []
    for one in heard:
        for name, row in one.rows(now_s):
            table.append(_line(printable(name, 40), row))
            told += [f"{printable(name, 40)}: {printable(problem.words)}"
                     for problem in row.problems]  # fmt: skip
            told += [f"{printable(name, 40)}: {printable(note)}" for note in row.notes]
        if one.problem:
            told.append(printable(one.problem, 300))
    many = sum(one.robots.unlisted for one in heard)
    told += [f"messages of further robots, which are not listed: {many}"] if many else []
    return [*aligned(table, right=frozenset((3, 5, 6, 7))), *(["", *told] if told else [])]


def _line(name: str, row: RobotRow) -> tuple[str, ...]:
    state, problems = row.state, row.problems
    lacks = ", ".join(dict.fromkeys(problem.part for problem in problems))
    doing = f"lacks {lacks}" if problems else ("-" if state is None else state.state)
    rate = "-" if row.frames_per_s is None else f"{row.frames_per_s:.1f}"
    page, stop = row.page or "-", row.stops.short
    if state is None:
        return name, doing, "-", "-", stop, "-", rate, "-", page
    sure = "-" if state.identity_confidence is None else f"{state.identity_confidence:.0%}"
    age = "-" if state.tracks_age_s is None else f"{1e3 * state.tracks_age_s:.0f}"
    return (name, doing, whom(state.target), sure, stop,
            f"{state.linear_mps:.2f}", rate, age, page)  # fmt: skip


def as_json(heard: list[RobotsOf], now_s: float) -> dict[str, Any]:
    """The same for machines."""
    return {
        "robots": [
            row.as_json() | {
                "name": name, "namespace": row.name, "router": one.where.router,
                "run": None if one.where.run is None else one.where.run.pid,
            }
            for one in heard for name, row in one.rows(now_s)
        ],
        "routers": [
            {"router": one.where.router, "problem": one.problem or None} for one in heard
        ],
    }  # fmt: skip


def is_wrong(heard: list[RobotsOf], now_s: float) -> bool:
    """Whether any robot lacks anything, drive and follower differ, or any router is away."""
    return any(one.problem for one in heard) or any(
        row.problems or row.stops.differ for one in heard for _, row in one.rows(now_s)
    )


def show_all(
    places: list[tuple[Where, tuple[str, ...]]], as_object: bool, watch: bool,
    first_s: float, every_s: float,
) -> bool:  # fmt: skip
    """Show all robots, once or again and again; whether anything is wrong.

    Raises:
        HeelError: there is no robot at all.
    """
    from heel.services.runtime.stop_signals import stop_signals

    with (
        stop_signals(TIMEOUT_S) as stop,
        listening_to(places) as heard,
        Screen(plain=as_object or not watch) as screen,
    ):
        listen(heard, first_s, stop.wait)
        while not stop.is_set():
            now_s = time.monotonic()
            if not watch and not any(one.rows(now_s) or one.failure for one in heard):
                raise HeelError(
                    "no robot is heard at "
                    + ", ".join(one.where.router for one in heard)
                    + ": start its services with --namespace NAME"
                )
            if as_object:
                indent = None if watch else 2
                screen.show([json.dumps(as_json(heard, now_s), indent=indent)])
            else:
                screen.show(lines(heard, now_s))
            if not watch:
                return is_wrong(heard, now_s)
            listen(heard, every_s, stop.wait)
    return False
