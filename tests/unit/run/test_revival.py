"""Which services of a live run are started again, when, and how often at most."""

from __future__ import annotations

import logging

import pytest

from heel.schemas import Health, HeelError
from heel.services.run.bounds import MOST_STARTS, WITHIN_S
from heel.services.run.revival import Revival
from heel.services.run.silence import HUNG_S
from tests.unit.schemas.examples import EXAMPLES

LOG = logging.getLogger("heel.test")
TURN_S = 0.1


class FakeChildren:
    """Processes that end and freeze when told to."""

    def __init__(self) -> None:
        self.codes: dict[str, int | None] = {"tracker": None, "follower": None}
        self.frozen: set[str] = set()
        self.started: list[str] = []

    def exit_code(self, name: str) -> int | None:
        return self.codes[name]

    def is_running(self, name: str) -> bool:
        return self.codes[name] is None and name not in self.frozen

    def start_again(self, name: str) -> None:
        self.started.append(name)
        self.codes[name] = None
        self.frozen.discard(name)

    def last_words(self, name: str) -> str:
        return f"; {name}'s last words"


class World:
    """A run that looks ten times a second, whose services speak as often."""

    def __init__(self) -> None:
        self.children = FakeChildren()
        self.revival = Revival(("tracker", "follower"), LOG)
        self.now_s = 0.0
        self.hangs: set[str] = set()
        self.late_now = False
        self.late = 0
        """Messages of a process that hung, read after its end."""
        self.hung_s = 0.0

    def go_on(self, seconds: float) -> None:
        for _ in range(round(seconds / TURN_S)):
            self.now_s += TURN_S
            self.hung_s = self.hung_s + TURN_S if self.hangs else 0.0
            for name in ("tracker", "follower"):
                if self.children.is_running(name):
                    self.revival.heard(self._health(name), self.now_s)
            if self.revival.look(self.children, self.now_s):  # type: ignore[arg-type]
                self.late_now = True
                for _ in range(self.late):
                    self.revival.heard(self._health("tracker"), self.now_s)
                self.late_now = False
                self.hangs.clear()

    def _health(self, name: str) -> Health:
        starts = len(self.children.started) - (name in self.hangs and self.late_now)
        producer = f"{name}/main@{starts:08x}"
        age_s = self.hung_s if name in self.hangs else 0.01
        health = next(one for one in EXAMPLES if isinstance(one, Health))
        return health.model_copy(
            update={"service": name, "loop_age_s": age_s, "state": "ok", "producer": producer}
        )


@pytest.mark.parametrize("code", [-9, -11, 1])
def test_one_that_was_killed_or_crashed_is_started_again_at_once(code: int) -> None:
    world = World()
    world.go_on(5.0)
    world.children.codes["tracker"] = code
    world.go_on(TURN_S)
    assert world.children.started == ["tracker"]
    assert world.revival.counts == {"tracker": 1}
    world.go_on(60.0)
    assert world.children.started == ["tracker"]


@pytest.mark.parametrize("code", [0, 2])
def test_one_that_ended_in_order_or_was_set_up_wrongly_is_not(code: int) -> None:
    world = World()
    world.go_on(5.0)
    world.children.codes["tracker"] = code
    world.go_on(20.0)
    assert world.children.started == []


def test_one_that_is_frozen_is_replaced_within_a_second_or_two() -> None:
    world = World()
    world.go_on(5.0)
    world.children.frozen.add("follower")
    world.go_on(0.8)
    assert world.children.started == [], "for a moment anybody may stop a process"
    world.go_on(0.7)
    assert world.children.started == ["follower"]
    world.go_on(60.0)
    assert world.children.started == ["follower"]


def test_one_whose_loop_hangs_is_replaced_though_it_goes_on_to_speak() -> None:
    world = World()
    world.late = 3
    world.go_on(5.0)
    world.hangs.add("tracker")
    world.go_on(HUNG_S - 0.5)
    assert world.children.started == []
    world.go_on(1.0)
    assert world.children.started == ["tracker"]
    world.go_on(60.0)
    assert world.children.started == ["tracker"]


def test_one_that_crashes_again_and_again_ends_the_run_with_its_last_words() -> None:
    world = World()
    for _ in range(MOST_STARTS):
        world.children.codes["tracker"] = -11
        world.go_on(2.0)
    assert len(world.children.started) == MOST_STARTS
    world.children.codes["tracker"] = -11
    with pytest.raises(HeelError, match=r"tracker ended with code -11 once more.*last words"):
        world.go_on(2.0)


def test_one_that_crashes_now_and_then_is_started_for_ever() -> None:
    world = World()
    for _ in range(3 * MOST_STARTS):
        world.children.codes["tracker"] = -9
        world.go_on(WITHIN_S / MOST_STARTS + 1.0)
    assert len(world.children.started) == 3 * MOST_STARTS


def test_a_run_that_was_paused_itself_replaces_nobody() -> None:
    """Ctrl-Z and `fg`: what the services said meanwhile is not read yet."""
    world = World()
    world.go_on(5.0)
    world.children.frozen.update(("tracker", "follower"))
    world.go_on(0.5)
    world.now_s += 100.0
    world.revival.look(world.children, world.now_s)  # type: ignore[arg-type]
    world.children.frozen.clear()
    world.go_on(20.0)
    assert world.children.started == []
