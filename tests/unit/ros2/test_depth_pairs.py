"""Which picture depth is of, and what it shows in the way."""

from __future__ import annotations

import math
from types import SimpleNamespace as Fields

import numpy as np
import pytest

from heel.schemas import CameraInfo, Header, HeelError
from heel.schemas.image import RAW
from heel.services.ros2.depth import DepthPairs, nearest, obstacles


def header(seq: int) -> Header:
    return Header(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=0, width=64, height=48,
        source_width=64, source_height=48, image_encoding=RAW, producer="ros2/main@00000001",
    )  # fmt: skip


def ros(at_ms: int) -> Fields:
    return Fields(stamp=Fields(sec=at_ms // 1000, nanosec=at_ms % 1000 * 10**6))


def depth(at_ms: int, width: int = 32, height: int = 24) -> Fields:
    return Fields(
        header=ros(at_ms), encoding="16UC1", width=width, height=height, step=2 * width,
        data=np.full((height, width), at_ms % 65536, np.uint16).tobytes(), is_bigendian=0,
    )  # fmt: skip


def test_depth_belongs_to_the_picture_of_its_time_even_if_it_comes_later() -> None:
    pairs = DepthPairs()
    for seq in range(3):
        pairs.picture(ros(1000 + 50 * seq), header(seq))
    found = pairs.depth(depth(1052))
    assert found is not None
    assert found[0].seq == 1
    assert found[1].shape == (24, 32)
    assert pairs.depth(None) is None
    assert pairs.depth(depth(1053)) is None, "a picture has one depth"


def test_depth_that_comes_first_waits_for_its_picture_and_the_newest_counts() -> None:
    pairs = DepthPairs()
    assert pairs.depth(depth(1000)) is None
    assert pairs.depth(depth(1050)) is None
    pairs.picture(ros(1050), header(7))
    found = pairs.depth(None)
    assert found is not None
    assert (found[0].seq, found[1].max()) == (7, 1050)


def test_depth_of_another_time_is_of_no_picture() -> None:
    assert nearest([], 5) is None
    assert nearest([0], 50_000_000) is None
    assert nearest([0, 60_000_000], 50_000_000) == 1
    assert nearest([0, 0, 0], 0) == 2, "clocks that are not set: the newest"


def test_depth_that_is_not_aligned_is_refused_with_the_remedy() -> None:
    pairs = DepthPairs()
    pairs.picture(ros(1000), header(0))
    with pytest.raises(HeelError, match="not aligned to pictures of 64x48: name the topic of ali"):
        pairs.depth(depth(1000, width=43))


def test_obstacles_need_the_mounting() -> None:
    info = CameraInfo(
        stream="front", epoch=1, width=64, height=48, source_width=64, source_height=48, fps=30.0,
        source="test", horizontal_fov_rad=math.pi / 2,
    )  # fmt: skip
    wall = np.full((48, 64), 1500, np.uint16)
    assert obstacles(wall, info) is None
    sectors = obstacles(wall, info.model_copy(update={"mount_height_m": 0.3, "mount_pitch_rad": 0}))
    assert sectors is not None
    ahead = min(sectors, key=lambda sector: abs(sector.bearing_rad))
    assert ahead.distance_m == pytest.approx(1.5, abs=0.01)
