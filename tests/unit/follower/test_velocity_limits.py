"""A limited velocity reaches what is wished, without overshoot, whatever the steps are."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heel.services.follower.limits import LimitedVelocity

_ROUNDING = 1e-6


def run(made: LimitedVelocity, wished: float, seconds: float, dt_s: float = 0.02) -> list[float]:
    return [made.towards(wished, dt_s) for _ in range(round(seconds / dt_s))]


@pytest.mark.parametrize("wished", [1.0, -1.0, 0.3, 0.0])
@pytest.mark.parametrize("dt_s", [0.005, 0.02, 0.1])
def test_it_gets_there_and_does_not_pass(wished: float, dt_s: float) -> None:
    made = LimitedVelocity(1.0, 2.0, 8.0)
    path = run(made, wished, 3.0, dt_s)
    assert path[-1] == pytest.approx(wished, abs=1e-3)
    assert max(map(abs, path)) <= abs(wished) + _ROUNDING


def test_speeding_up_and_slowing_down_have_limits_of_their_own() -> None:
    made = LimitedVelocity(1.0, 2.0, 100.0)
    up = run(made, 2.0, 4.0)
    assert max(b - a for a, b in pairwise(up)) / 0.02 == pytest.approx(1.0, rel=1e-3)
    down = run(made, 0.0, 4.0)
    assert max(a - b for a, b in pairwise(down)) / 0.02 == pytest.approx(2.0, rel=1e-3)
    assert min(down) >= -_ROUNDING


def test_a_stop_is_immediate_and_starts_from_rest() -> None:
    made = LimitedVelocity(1.0, 2.0, 8.0)
    run(made, 1.0, 2.0)
    made.stop()
    assert made.velocity == 0.0
    assert made.towards(1.0, 0.02) <= 8.0 * 0.02 * 0.02 + _ROUNDING


def test_no_time_no_change() -> None:
    made = LimitedVelocity(1.0, 2.0, 8.0)
    run(made, 1.0, 0.5)
    before = made.velocity
    assert made.towards(-1.0, 0.0) == before


@settings(deadline=None, derandomize=True, max_examples=200)
@given(
    wishes=st.lists(
        st.tuples(st.floats(-1, 2), st.floats(0.001, 0.2), st.integers(1, 20)), max_size=30
    ),
    acceleration=st.floats(0.1, 10), braking=st.floats(0.1, 10), jerk=st.floats(0.5, 100),
)  # fmt: skip
def test_limits_hold_for_any_wishes_and_steps(
    wishes: list[tuple[float, float, int]], acceleration: float, braking: float, jerk: float
) -> None:
    made = LimitedVelocity(acceleration, braking, jerk)
    velocity = change = 0.0
    for wished, dt_s, steps in wishes:
        for _ in range(steps):
            now = made.towards(wished, dt_s)
            rate = (now - velocity) / dt_s
            assert -1 - _ROUNDING <= now <= 2 + _ROUNDING
            assert abs(rate) <= max(acceleration, braking) + _ROUNDING
            assert abs(rate - change) <= jerk * dt_s + _ROUNDING / dt_s
            velocity, change = now, rate
