from __future__ import annotations

import numpy as np
import pytest

from heel.services.simulator.render.effects import CameraEffects, CameraFilter

SIZE = (120, 160)
GREY = np.full((*SIZE, 3), 100, np.uint8)
NOTHING = CameraEffects(noise_grey=0, shutter_s=0, exposure_lag_s=0)


def camera(**changes: float) -> CameraFilter:
    values = {"noise_grey": 0.0, "shutter_s": 0.0, "exposure_lag_s": 0.0, "max_gain": 4.0}
    return CameraFilter(CameraEffects(**(values | changes)), SIZE, focal_px=80.0, seed=1)


def test_a_perfect_camera_changes_nothing() -> None:
    assert (camera().apply(GREY, 0.0, 1.0, 1.0) == GREY).all()


def test_noise_has_the_strength_asked_for_and_belongs_to_the_moment() -> None:
    one = camera(noise_grey=3.0)
    first = one.apply(GREY, 0.05, 1.0, 0.0)
    assert (first.astype(float) - 100).std() == pytest.approx(3.0, rel=0.1)
    assert first.mean() == pytest.approx(100, abs=0.2)
    other = one.apply(GREY, 0.10, 1.0, 0.0)
    assert (other != first).mean() > 0.5
    assert (camera(noise_grey=3.0).apply(GREY, 0.05, 1.0, 0.0) == first).all()


@pytest.mark.parametrize(("turn_radps", "width"), [(0.0, 1), (1.0, 5), (-1.0, 5), (2.0, 9)])
def test_turning_smears_along_the_rows(turn_radps: float, width: int) -> None:
    line = np.zeros_like(GREY)
    line[:, 80] = 240
    # 80 px focal length, 0.05 s: 4 px at 1 rad/s.
    blurred = camera(shutter_s=0.05).apply(line, 0.0, 1.0, turn_radps)
    assert np.count_nonzero(blurred[60, :, 0]) == width
    assert int(blurred[60, :, 0].sum()) == pytest.approx(240, abs=6)
    assert (blurred == blurred[:1]).all(), "not across them"


def test_exposure_follows_the_light_after_a_while() -> None:
    slow = camera(exposure_lag_s=0.5)
    assert slow.apply(GREY, 0.0, 1.0, 0.0).mean() == 100
    levels = [slow.apply(GREY, t_s, 0.5, 0.0).mean() for t_s in (0.05, 0.5, 5.0)]
    assert levels[0] < 60
    assert levels[0] < levels[1] < levels[2]
    assert levels[2] == pytest.approx(100, abs=1)
    assert slow.apply(GREY, 5.05, 1.0, 0.0).mean() > 150, "too bright when the light is back"


def test_gain_is_limited_and_noise_grows_with_it() -> None:
    dark = camera(noise_grey=2.0, max_gain=4.0)
    picture = dark.apply(GREY, 0.0, 0.1, 0.0).astype(float)
    assert picture.mean() == pytest.approx(40, abs=1)
    assert picture.std() == pytest.approx(4.0, rel=0.15)
