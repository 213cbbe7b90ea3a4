"""The cores in one process obey the settings file as the processes do."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.services.pipeline import load_pipeline


@pytest.mark.parametrize(
    ("flag", "used"), [(None, "ego"), ("mixture", "mixture")], ids=["file", "flag over file"]
)
def test_the_detector_is_that_of_the_flag_or_else_of_the_file(
    tmp_path: Path, flag: str | None, used: str
) -> None:
    file = tmp_path / "heel.toml"
    file.write_text('[detector]\ndetector = "ego"\nfeedback_lag_frames = 3\n')
    _, shown = load_pipeline("default", "none", file, flag)
    assert shown["detector"]["detector"] == used
    assert shown["detector"]["feedback_lag_frames"] == 3
