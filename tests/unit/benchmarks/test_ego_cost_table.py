"""What the cost table says of measured frames, and which frames are measured."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.ego_cost import SIZE, STEPS, Pictures, measure, row
from heel.schemas import FrameId


def wall(frames: int) -> Pictures:
    image = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    for index in range(frames):
        frame = FrameId(
            stream="front", epoch=1, seq=index, index=index, t_capture_ns=index * 40_000_000
        )
        yield frame, np.roll(image, 2 * index, axis=1)


def test_every_frame_but_the_first_ten_is_measured() -> None:
    spent = measure(wall(13))
    assert set(spent) == set(STEPS)
    assert all(len(values) == 3 and min(values) > 0.0 for values in spent.values())


@pytest.mark.parametrize(
    ("times", "cell"), [([5.0], "5.0 (p95 5.0)"), ([1, 2, 3], "2.0 (p95 2.9)")]
)
def test_a_row_has_median_and_95th_percentile(times: list[float], cell: str) -> None:
    line = row("wall", dict.fromkeys(STEPS, times))
    assert line == f"| wall | {len(times)} | {cell} | {cell} |"
