"""The loop over ROS: which picture tracks are of, when a robot stands, and the tables."""

from __future__ import annotations

import math

import pytest

from benchmarks.ros.nodes import STAGES
from benchmarks.ros.stack import _seq_of, stands_after
from benchmarks.ros2 import Arm, table
from benchmarks.ros2_loop import kills_table

STAMPS = [0, 50_000_000, 100_000_000]


@pytest.mark.parametrize(
    ("t_ns", "seq"),
    [(0, 0), (49_000_000, 1), (51_000_000, 1), (75_000_000, None), (119_000_000, 2),
     (121_000_000, None), (-30_000_000, None)],
)  # fmt: skip
def test_tracks_are_of_the_picture_with_their_stamp(t_ns: int, seq: int | None) -> None:
    assert _seq_of(STAMPS, t_ns) == seq
    assert _seq_of([], t_ns) is None


def test_the_base_stands_once_it_hears_zero_or_nothing_for_a_while() -> None:
    heard = [(1.0, 0.5, 0.0), (2.1, 0.5, 0.0), (2.3, 0.0, 0.2)]
    assert math.isclose(stands_after([*heard, (2.4, 0.0, 0.0), (2.5, 0.0, 0.0)], 2.0), 0.4)
    assert math.isclose(stands_after(heard, 2.0), 0.5)
    assert math.isclose(stands_after([*heard, (2.9, 0.0, 0.0)], 2.0), 0.5)
    assert stands_after([*heard, (2.4, 0.0, 0.0)], 2.6) == 0.0
    assert stands_after([], 2.0) == 0.0


def test_the_tables_say_what_was_measured() -> None:
    assert "| all | 3 | 20 | 30 | 1000 |" in kills_table({"drive": [10.0, 30.0], "ros2": [20.0]})
    arm = Arm()
    arm.note(dict.fromkeys(STAGES, (1.0, 2.0)), 100, 90, 0.5)
    arm.note(dict.fromkeys(STAGES, (3.0, 4.0)), 100, 100, 1.5)
    assert "| some | 2.0 | 3.0 | 2.0 | 3.0 | 2.0 | 3.0 | 200 | 10 | 10.0 |" in table({"some": arm})
