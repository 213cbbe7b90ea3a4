"""Real recordings open with the length and size that their sequence files state."""

from __future__ import annotations

import configparser
import os
from pathlib import Path

import pytest

from heel.services.capture.sources import open_source

DATA = Path(os.environ.get("HEEL_DATA", Path(__file__).parents[4] / "shared" / "data"))
SEQUENCES = sorted(
    path.parent
    for path in DATA.glob("*/seqinfo.ini")
    if (path.parent / "img1").is_dir() or any(path.parent.glob("*.mp4"))
)

needs_data = pytest.mark.skipif(not SEQUENCES, reason=f"no recordings in {DATA}: set HEEL_DATA")


@needs_data
@pytest.mark.parametrize("folder", SEQUENCES, ids=lambda folder: folder.name)
def test_a_real_sequence_matches_its_sequence_file(folder: Path) -> None:
    info = configparser.ConfigParser()
    info.read(folder / "seqinfo.ini")
    stated = info["Sequence"]
    with open_source(str(folder), warn=pytest.fail) as source:
        assert source.frame_count == stated.getint("seqLength")
        assert source.fps == stated.getfloat("frameRate")
        assert source.width == stated.getint("imWidth")
        assert source.height == stated.getint("imHeight")
        frames = [source.read() for _ in range(3)]
    assert [frame.index for frame in frames if frame] == [0, 1, 2]
