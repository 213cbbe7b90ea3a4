"""The working size, and how frames get there."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.detector.scene import WorkSize


@pytest.mark.parametrize(
    ("frame", "work"),
    [
        ((320, 240), (320, 240)),
        ((640, 480), (480, 360)),
        ((768, 576), (480, 360)),
        ((1280, 720), (480, 270)),
        ((1920, 1080), (480, 270)),
        ((1921, 1081), (480, 270)),
        ((1, 1), (1, 1)),
        ((40, 16384), (5, 2048)),
    ],
    ids=str,
)
def test_frames_are_shrunk_to_the_working_size_and_stay_where_they_were(
    frame: tuple[int, int], work: tuple[int, int]
) -> None:
    size = WorkSize.of_frame(*frame, 480)
    assert (size.width, size.height) == work
    image = np.zeros((frame[1], frame[0], 3), np.uint8)
    image[: frame[1] // 2] = 200
    small = size.shrink(image).astype(np.float64)
    assert small.shape == (work[1], work[0], 3)
    assert small.sum(0)[0, 0] * size.scale_y == pytest.approx(image[:, 0, 0].sum(), rel=0.01)
