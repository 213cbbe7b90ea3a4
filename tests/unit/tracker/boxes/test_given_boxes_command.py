"""`heel track-detections`: what it writes, and what it says of what is broken."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from heel.evaluation.motchallenge import read_tracks
from heel.schemas.errors import HeelError, SettingsError
from heel.services.cli import app

SEQUENCE_FILE = "[Sequence]\nname=two\nframeRate=10\nseqLength=35\nimWidth=640\nimHeight=480\n"


def rows(frames: int = 30) -> str:
    """Two people who walk apart."""
    lines = []
    for frame in range(1, frames + 1):
        lines.append(f"{frame},-1,{200 - 3 * frame},100,40,100,0.99,-1,-1,-1")
        lines.append(f"{frame},-1,{300 + 3 * frame},110,40,100,0.98,-1,-1,-1")
    return "\n".join(lines) + "\n"


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    folder = tmp_path / "two"
    (folder / "det").mkdir(parents=True)
    (folder / "det" / "det.txt").write_text(rows())
    (folder / "seqinfo.ini").write_text(SEQUENCE_FILE)
    return folder


def run(*arguments: object) -> str:
    """Run the command; its output, or the error a user would see as one line."""
    result = CliRunner().invoke(app, ["track-detections", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_a_sequence_folder_tells_rate_and_size(sequence: Path, tmp_path: Path) -> None:
    out = tmp_path / "tracks.txt"
    assert "2 identities" in run(sequence, "--out", out)
    tracks = read_tracks(out)
    assert set(tracks.identities.tolist()) == {1, 2}
    assert tracks.frames.min() == 3
    assert tracks.frames.max() == 30
    assert ((tracks.values > 0.5) & (tracks.values <= 1)).all()
    first = tracks.boxes_xyxy[(tracks.frames == 30) & (tracks.boxes_xyxy[:, 0] < 200)]
    assert np.abs(first - np.array([[109, 99, 149, 199]])).max() < 5


def test_a_file_and_flags_give_the_same_tracks(sequence: Path, tmp_path: Path) -> None:
    one, other = tmp_path / "one.txt", tmp_path / "other.txt"
    file = tmp_path / "boxes.txt"
    file.write_text(rows())
    run(sequence, "--out", one)
    run(file, "--out", other, "--fps", 10, "--image-size", "640x480")
    assert one.read_text() == other.read_text()


def test_pictures_are_used_when_given(sequence: Path, tmp_path: Path) -> None:
    pictures = tmp_path / "img1"
    pictures.mkdir()
    for frame in range(1, 36):
        image = np.full((480, 640, 3), 90, np.uint8)
        image[100:200, 200 - 3 * frame : 240 - 3 * frame] = (20, 20, 200)
        image[110:210, 300 + 3 * frame : 340 + 3 * frame] = (200, 20, 20)
        cv2.imwrite(str(pictures / f"{frame:06d}.png"), image)
    assert "2 identities" in run(sequence, "--out", tmp_path / "t.txt", "--frames", pictures)
    (pictures / "000035.png").write_text("no picture")
    with pytest.raises(HeelError, match="frame 35"):
        run(sequence, "--out", tmp_path / "t.txt", "--frames", pictures)


def test_settings_come_from_a_file(sequence: Path, tmp_path: Path) -> None:
    config = tmp_path / "heel.toml"
    config.write_text("[tracker]\nmin_height = 0.5\n")
    run(sequence, "--out", tmp_path / "t.txt", "--config", config)
    assert len(read_tracks(tmp_path / "t.txt")) == 0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1,-1,10,10,20,40,0.9\n2,-1,ten,10,20,40,0.9\n", "line 2"),
        ("1,-1,10,10,20,40,0.9\n1,-1,10,10,-20,40,0.9\n", "line 2: -20"),
        ("1,-1,10,10,20,40,nan\n", "line 1: nan"),
        ("1,-1,10\n", "line 1: 3 columns"),
        ("", "empty"),
    ],
)
def test_a_broken_row_is_named_with_its_line(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "det.txt"
    file.write_text(text)
    with pytest.raises(HeelError, match=told) as caught:
        run(file, "--out", tmp_path / "t.txt", "--fps", 10)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "t.txt").exists()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(HeelError, match=r"nowhere\.txt.*cannot be read"):
        run(tmp_path / "nowhere.txt", "--out", tmp_path / "t.txt")


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        ((), "give --fps"),
        (("--fps", "0"), "--fps 0"),
        (("--fps", "nan"), "--fps nan"),
        (("--fps", "10", "--image-size", "640"), "640x480|WIDTHxHEIGHT"),
        (("--fps", "10", "--image-size", "0x480"), "WIDTHxHEIGHT"),
    ],
)
def test_a_flag_without_sense_is_refused(tmp_path: Path, flags: tuple[str, ...], told: str) -> None:
    file = tmp_path / "boxes.txt"
    file.write_text(rows())
    with pytest.raises(HeelError, match=told):
        run(file, "--out", tmp_path / "t.txt", *flags)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[tracker]\nmin_hight = 3\n", "tracker.min_hight.*min_height"),
        ("[tracker]\nmin_height = 0\n", "tracker.min_height = 0"),
        ("[life]\n", "life"),
        ("life\n", "not TOML"),
        ('[tracker]\npreset = "paper"\n', "tracker.preset = paper.*people's boxes"),
        ('[tracker]\ncalibration = "c.toml"\n', "tracker.calibration = c.toml.*people's boxes"),
    ],
)
def test_a_broken_setting_is_named(sequence: Path, tmp_path: Path, text: str, told: str) -> None:
    config = tmp_path / "heel.toml"
    config.write_text(text)
    with pytest.raises(SettingsError, match=told):
        run(sequence, "--out", tmp_path / "t.txt", "--config", config)


def drawn_pictures(folder: Path, width: int, height: int, name: str = "{:08d}.JPG") -> Path:
    """The two people of `rows` in pictures of this size."""
    folder.mkdir()
    for frame in range(1, 36):
        image = np.full((480, 640, 3), 90, np.uint8)
        image[100:200, max(0, 200 - 3 * frame) : 240 - 3 * frame] = (20, 20, 200)
        image[110:210, 300 + 3 * frame : 340 + 3 * frame] = (200, 20, 20)
        ok, data = cv2.imencode(".png", cv2.resize(image, (width, height)))
        assert ok
        (folder / name.format(frame)).write_bytes(data.tobytes())
    return folder


def test_pictures_of_another_size_are_scaled_to_the_boxes(sequence: Path, tmp_path: Path) -> None:
    same = drawn_pictures(tmp_path / "same", 640, 480)
    run(sequence, "--out", tmp_path / "same.txt", "--frames", same)
    for width, height in ((320, 240), (1280, 960)):
        other = drawn_pictures(tmp_path / f"{width}", width, height)
        run(sequence, "--out", tmp_path / "other.txt", "--frames", other)
        assert (tmp_path / "other.txt").read_text() == (tmp_path / "same.txt").read_text()


def test_pictures_of_another_shape_are_refused(sequence: Path, tmp_path: Path) -> None:
    square = drawn_pictures(tmp_path / "square", 480, 480)
    with pytest.raises(HeelError, match=r"frame 1: 480x480 pixels, and the boxes are for 640x480"):
        run(sequence, "--out", tmp_path / "t.txt", "--frames", square)


def test_boxes_far_outside_of_pictures_whose_size_nothing_tells_are_refused(
    sequence: Path, tmp_path: Path
) -> None:
    small = drawn_pictures(tmp_path / "small", 160, 120)
    file = sequence / "det" / "det.txt"
    (sequence / "seqinfo.ini").unlink()
    with pytest.raises(HeelError, match=r"boxes reach to .*--image-size"):
        run(file, "--fps", 10, "--out", tmp_path / "t.txt", "--frames", small)


def test_scores_of_other_scales_give_the_same_tracks(sequence: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    lines = [line.split(",") for line in rows().splitlines()]
    lines += [[str(frame), "-1", "500", "300", "40", "90", "0"] for frame in range(1, 31, 3)]
    scores = np.where(np.arange(len(lines)) < 60, rng.uniform(0.6, 0.99, len(lines)), 0.15)
    written = {}
    for name, values in (
        ("plain", scores), ("percent", 100 * scores), ("log odds", np.log(scores / (1 - scores)))
    ):  # fmt: skip
        text = [
            ",".join([*line[:6], f"{value:.9f}"]) for line, value in zip(lines, values, strict=True)
        ]
        (sequence / "det" / "det.txt").write_text("\n".join(text))
        run(sequence, "--out", tmp_path / "t.txt")
        written[name] = (tmp_path / "t.txt").read_text()
    assert written["percent"] == written["plain"]
    assert written["log odds"] == written["plain"]
    assert written["plain"]


def test_a_length_that_nothing_fills_is_refused(sequence: Path, tmp_path: Path) -> None:
    info = sequence / "seqinfo.ini"
    info.write_text(SEQUENCE_FILE.replace("seqLength=35", "seqLength=9000000"))
    with pytest.raises(HeelError, match=r"seqLength = 9000000, and the last box is in frame 30"):
        run(sequence, "--out", tmp_path / "t.txt")
