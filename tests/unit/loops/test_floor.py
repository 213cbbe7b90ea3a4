"""Shortest ways around boxes, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.services.loops.scenarios.floor import Floor
from heel.services.simulator.state import Obstacle


def box(
    x_m: float, y_m: float, length_m: float, width_m: float, heading_rad: float = 0.0
) -> Obstacle:
    return Obstacle(
        kind="wall",
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        length_m=length_m,
        width_m=width_m,
        height_m=2.0,
        colour=(0, 0, 0),
    )


# Around the corner (1, 1) of a square of 2 m in the origin: from (-2, 0) to (2, 0).
AROUND_THE_SQUARE_M = 2 * math.hypot(1, 1) + 2


@pytest.mark.parametrize(
    ("obstacles", "start", "end", "expected_m"),
    [
        pytest.param((), (0, 0), (3, 4), 5.0, id="nothing in the way"),
        pytest.param((box(0, 0, 2, 2),), (-2, 0), (2, 0), AROUND_THE_SQUARE_M, id="square"),
        pytest.param((box(0, 0, 2, 2),), (-2, 1.1), (2, 1.1), 4.0, id="past it"),
        pytest.param((box(0, 0, 2, 2),), (-2, 1), (2, 1), 4.0, id="along its side"),
        pytest.param(
            (box(0, 0, 4, 0.5, math.pi / 2),),
            (-1, 0),
            (1, 0),
            2 * math.hypot(0.75, 2) + 0.5,
            id="turned wall",
        ),
        # Two walls with gaps at opposite ends: through one gap, then through the other.
        pytest.param(
            (box(0, 1, 0.02, 4), box(1, -1, 0.02, 4)),
            (-1, 0),
            (2, 0),
            math.hypot(1, 1) * 2 + math.hypot(1, 2),
            id="zigzag",
        ),
        pytest.param(
            (box(0, 2, 8, 1), box(0, -2, 8, 1), box(4, 0, 1, 5), box(-4, 0, 1, 5)),
            (0, 0),
            (9, 0),
            9.0,
            id="shut in: the straight line",
        ),
    ],
)
def test_shortest_way(
    obstacles: tuple[Obstacle, ...],
    start: tuple[float, float],
    end: tuple[float, float],
    expected_m: float,
) -> None:
    floor = Floor(obstacles)

    lengths = floor.path_m(np.array([start, end], float), np.array([end, start], float))

    assert lengths == pytest.approx([expected_m] * 2, abs=0.03)
