"""When a process that stands by takes over though it has never heard one that sends."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from types import SimpleNamespace

import pytest
import zenoh

from heel.schemas import Stamp
from heel.services.runtime import succession
from heel.services.runtime.succession import StandingBy

T_S = 1000.0
_TURN_S = 0.05


class Clock:
    """Time that goes on when it is told to."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.now_s = T_S
        patch.setattr(succession.time, "monotonic", lambda: self.now_s)


class Tokens:
    """The session's tokens, as far as one that stands by asks for them."""

    def __init__(self) -> None:
        self.tell: list[Callable[[object], None]] = []

    def liveliness(self) -> Tokens:
        return self

    def declare_subscriber(
        self, _key: str, tell: Callable[[object], None], history: bool
    ) -> SimpleNamespace:
        self.tell.append(tell)
        return SimpleNamespace(undeclare=lambda: None)

    def come(self, *instances: str, gone: bool = False) -> None:
        kind = zenoh.SampleKind.DELETE if gone else zenoh.SampleKind.PUT
        for instance in instances:
            for tell in self.tell:
                tell(SimpleNamespace(key_expr=f"alive/tracker/{instance}", kind=kind))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def standing(tokens: Tokens, instance: str) -> StandingBy:
    # Only its tokens are asked for.
    return StandingBy(tokens, f"tracker/{instance}@00000001", ExitStack())  # type: ignore[arg-type]


def taken_over_after_s(clock: Clock, one: StandingBy, most_s: float = 20.0) -> float | None:
    """Seconds after the beginning at which it takes over, where input comes without an answer."""
    while clock.now_s - T_S < most_s:
        if one.is_due(T_S, ready=False):
            return clock.now_s - T_S
        clock.now_s += _TURN_S
    return None


def test_one_that_is_alone_waits_two_seconds(clock: Clock) -> None:
    tokens = Tokens()
    one = standing(tokens, "a")
    tokens.come("a")
    assert taken_over_after_s(clock, one) == pytest.approx(2.0, abs=0.11)


def test_of_those_that_start_together_one_takes_over_and_the_others_follow(clock: Clock) -> None:
    tokens = Tokens()
    both = {name: standing(tokens, name) for name in ("b", "a")}
    tokens.come("b", "a")
    due: dict[str, float] = {}
    while not due and clock.now_s < T_S + 20.0:
        due = {name: clock.now_s - T_S for name, one in both.items() if one.is_due(T_S, False)}
        clock.now_s += _TURN_S
    assert due == {"a": pytest.approx(3.0, abs=0.11)}
    both["b"].hear(Stamp(producer="tracker/a@00000001", t_sent_ns=1, age_ns=0), clock.now_s)
    # From here on it is answered, and b stands by as usual.
    assert not both["b"].is_due(None, True)
    assert both["b"].told(True, "").startswith("ready: in step with tracker/a")


def test_the_next_one_goes_where_the_first_is_hung(clock: Clock) -> None:
    tokens = Tokens()
    one = standing(tokens, "b")
    tokens.come("a", "b")
    assert taken_over_after_s(clock, one) == pytest.approx(5.0, abs=0.11)


def test_without_input_there_is_nothing_to_take_over(clock: Clock) -> None:
    tokens = Tokens()
    one = standing(tokens, "a")
    tokens.come("a", "b")
    for _ in range(400):
        clock.now_s += _TURN_S
        assert not one.is_due(None, False)
