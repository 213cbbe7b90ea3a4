"""A mounting that is known gives the scene's scale at once, and nothing changes it."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.geometry.calibration_file import Calibration
from heel.services.tracker.core import Tracker, configured
from heel.services.tracker.evidence.line import line_of
from heel.services.tracker.evidence.scale import Line, SceneScale
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker.drawn_people import RED, follow, straight

HIGH = Calibration(mount_height_m=8.0, mount_pitch_deg=20.0, horizontal_fov_deg=40.0)


def test_the_line_is_a_persons_height_by_the_cameras() -> None:
    """The slope of heights over rows is about 1.75 m by the camera's height, D. Hoiem 2008."""
    line = line_of(HIGH, (270, 480))
    assert line is not None
    assert line.slope == pytest.approx(1.75 / 8.0, rel=0.2)


def test_twice_the_pixels_are_twice_the_height() -> None:
    small, large = line_of(HIGH, (270, 480)), line_of(HIGH, (540, 960))
    assert small is not None
    assert large is not None
    assert large.height(400.0) == pytest.approx(2.0 * small.height(200.0), rel=0.02)


def test_a_camera_that_looks_at_the_sky_has_no_line() -> None:
    sky = Calibration(mount_height_m=1.0, mount_pitch_deg=-80.0, horizontal_fov_deg=40.0)
    assert line_of(sky, (270, 480)) is None


@pytest.mark.parametrize(("slope", "known"), [(0.2, True), (1.5, False)])
def test_a_given_line_stays_and_one_of_a_low_camera_is_not_used(slope: float, known: bool) -> None:
    scale = SceneScale(240, 20.0, given=Line(slope, 5.0))
    for _ in range(30):
        for row in (60.0, 120.0, 200.0):
            scale.add_person(int(row), row, 90.0)
        scale.update(np.ones((240, 320), np.float32))
    assert scale.line == Line(slope, 5.0)
    assert (scale.known, scale.refused, scale.settled) == (known, not known, known)


def test_somebody_is_found_at_once_where_the_mounting_is_known() -> None:
    """The drawn ground plane: heights of 0.3 (row + 20) pixels."""
    drawn = Calibration(mount_height_m=5.83, mount_pitch_deg=24.0, horizontal_fov_deg=60.0)
    walker = straight(RED, 60, 4)
    tracks = follow(Tracker(TrackerSettings(), drawn), [walker], range(8))
    assert [track.shown for track in tracks[-1].tracks] == [True]


def test_a_calibration_file_that_is_not_there_is_named(tmp_path: object) -> None:
    file = f"{tmp_path}/none.toml"
    with pytest.raises(SettingsError, match=r"none\.toml"):
        configured(TrackerSettings.model_validate({"calibration": file}))
