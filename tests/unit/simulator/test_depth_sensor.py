"""The simulated depth camera: how it errs, where it sees nothing, and that it can be repeated."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from heel.services.simulator.depth_sensor import DepthSensor
from heel.services.simulator.state import CameraMount

MOUNT = CameraMount()
SHAPE = (240, 320)


def wall(metres: float) -> np.ndarray:
    return np.full(SHAPE, metres, np.float32)


def errors_m(metres: float, seed: int = 1) -> np.ndarray:
    told = DepthSensor(MOUNT, seed).measure(wall(metres), 1.0)
    return told[told > 0] / 1000 - metres


def test_errors_grow_with_the_square_of_the_distance() -> None:
    spread = [float(np.std(errors_m(metres))) for metres in (1.0, 2.0, 4.0)]
    assert spread[0] == pytest.approx(0.005, abs=0.002)
    for near, far in pairwise(spread):
        assert far == pytest.approx(4 * near, rel=0.15)


def test_each_camera_has_a_scale_error_of_its_own_of_about_a_hundredth() -> None:
    scales = [float(np.median(errors_m(2.0, seed))) / 2.0 for seed in range(20)]
    assert 0.004 < np.std(scales) < 0.02
    assert np.allclose(scales[3], np.median(errors_m(2.0, 3)) / 2.0)


def test_the_same_moment_gives_the_same_picture_and_another_one_another() -> None:
    one, two = DepthSensor(MOUNT, 1), DepthSensor(MOUNT, 1)
    one.measure(wall(3.0), 0.5)
    assert np.array_equal(one.measure(wall(2.0), 1.0), two.measure(wall(2.0), 1.0))
    assert not np.array_equal(one.measure(wall(2.0), 1.05), two.measure(wall(2.0), 1.0))


@pytest.mark.parametrize(("metres", "seen"), [(0.2, False), (0.5, True), (8.0, True), (11, False)])
def test_it_has_a_range(metres: float, seen: bool) -> None:
    told = DepthSensor(MOUNT, 1).measure(wall(metres), 1.0)
    assert (np.mean(told > 0) > 0.9) == seen
    assert (np.mean(told > 0) < 0.01) != seen


def test_beyond_all_ranges_is_no_measurement() -> None:
    assert DepthSensor(MOUNT, 1).measure(wall(0.0), 1.0).max() == 0


def test_a_thing_hides_a_strip_to_its_left_from_the_other_lens_and_its_edges_are_ragged() -> None:
    scene = wall(4.0)
    scene[:, 150:200] = 1.0
    told = DepthSensor(MOUNT, 1).measure(scene, 1.0)
    hidden = np.mean(told == 0, axis=0)
    # Disparities of 16 and 4 pixels in pictures of 640: 6 of the 320 depth pixels.
    assert hidden[145:150].min() == 1.0
    assert hidden[100:140].mean() < 0.1
    assert hidden[203:240].mean() < 0.1
    assert 0.3 < hidden[[199, 200]].mean() < 0.9
    assert hidden[155:195].mean() < 0.1
