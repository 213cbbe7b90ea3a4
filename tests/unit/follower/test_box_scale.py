"""The share by which somebody's box misleads about their distance, learned from ranges."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from heel.services.follower.box_scale import BoxScale


def learned(told_m: float, measured_m: Callable[[float], float], seconds: float) -> BoxScale:
    scale = BoxScale()
    for step in range(round(seconds / 0.05)):
        scale.learn(told_m, measured_m(0.05 * step), 0.05 * step)
    return scale


@pytest.mark.parametrize(
    ("measured_m", "expected"),
    [
        pytest.param(1.8, 0.9, id="somebody tall"),
        pytest.param(2.2, 1.1, id="somebody short"),
        pytest.param(1.4, 0.7, id="a box without feet"),
        pytest.param(0.4, 0.5, id="never less than half"),
        pytest.param(3.5, 1.0, id="a range that passes them"),
    ],
)
def test_it_becomes_what_the_ranges_say_of_a_person(measured_m: float, expected: float) -> None:
    assert learned(2.0, lambda _: measured_m, 8.0).scale == pytest.approx(expected, abs=0.01)


def test_somebody_who_crosses_in_front_changes_nothing() -> None:
    assert learned(2.0, lambda t_s: 1.0 if 1.0 < t_s < 1.9 else 2.0, 3.0).scale == 1.0


def test_what_was_learned_of_something_in_front_is_forgotten_behind_it() -> None:
    scale = learned(2.0, lambda t_s: 1.0 if t_s < 5.0 else 2.0, 15.0)
    assert scale.scale == pytest.approx(1.0, abs=0.01)


def test_a_tracker_that_tells_no_distance_at_all_ends_nothing() -> None:
    assert learned(0.0, lambda _: 1.0, 2.0).scale == 1.0
