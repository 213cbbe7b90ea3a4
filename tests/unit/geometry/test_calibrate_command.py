"""`heel calibrate person` from a tracks file: what it prints, writes and refuses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from heel.evaluation.motchallenge import write_tracks
from heel.evaluation.rows import rows_from_xyxy
from heel.schemas import HeelError
from heel.services.commands.calibrate import person
from heel.services.geometry.calibration_file import read_calibration
from heel.services.geometry.camera import Pinhole


@pytest.fixture
def tracks(tmp_path: Path) -> Path:
    """Person 3 walks about before a camera 0.8 m high; person 4 is seen for a moment."""
    random = np.random.default_rng(5)
    x = random.uniform(3, 9, 150)
    looking = Pinhole.from_fov(640, 480, math.radians(70)).mounted(0.8, 0.05)
    boxes = looking.person_boxes(np.stack([x, 0.3 * x * random.uniform(-1, 1, 150)], -1), 1.75)
    boxes = np.concatenate([boxes, boxes[:5]])
    ids = [3] * 150 + [4] * 5
    file = tmp_path / "tracks.txt"
    write_tracks(file, rows_from_xyxy(range(1, 156), ids, boxes, [1.0] * 155))
    return file


def test_it_prints_the_mounting_and_writes_a_file_that_capture_reads(
    tracks: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tracks.parent / "camera.toml"
    person(str(tracks), 1.75, 70.0, "640x480", None, out)
    printed = capsys.readouterr().out
    assert "height 0.8" in printed
    assert "person 3: " in printed
    written = read_calibration(out)
    assert written.mount_height_m == pytest.approx(0.8, rel=0.03)
    assert written.mount_pitch_deg == pytest.approx(math.degrees(0.05), abs=0.5)


@pytest.mark.parametrize(
    ("fov_deg", "size", "track", "words"),
    [
        (70.0, None, None, "--image-size"),
        (70.0, "640", None, "'640': give WIDTHxHEIGHT"),
        (190.0, "640x480", None, "--fov-deg 190"),
        (70.0, "640x480", 9, "nobody has id 9; ids: 3, 4"),
        (70.0, "640x480", 4, "of 5 boxes"),
        (None, "640x480", None, "give --fov-deg"),
    ],
)
def test_what_is_missing_is_said_with_the_remedy(
    tracks: Path, fov_deg: float | None, size: str | None, track: int | None, words: str
) -> None:
    with pytest.raises(HeelError, match=words):
        person(str(tracks), 1.75, fov_deg, size, track, None)
