"""What a user types, and what scale, rate and loop do to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.adjust import AdjustedSource
from heel.services.capture.scene_source import SceneSource
from heel.services.capture.sources import open_source
from heel.services.geometry.pixels import to_bgr8
from tests.unit.capture.videos import index_of, write_folder, write_video


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("", "no such file"),
        ("/nowhere/at/all.mp4", "/nowhere/at/all.mp4"),
        ("~nobody/x.mp4", "no such file"),
        ("x" * 5000, "no such file"),
        ("nul\0byte", "no such file"),
        ("http://user:secret@[::1/x", "answers at http://***@[::1/x"),
        ("/dev/video987", "no such camera"),
        ("987", "/dev/video987"),
        ("ftp://user:secret@host/x", "cannot read ftp://"),
        ("scene:nowhere", "demo"),
        ("scene:demo?sed=1", "the keys are"),
        ("scene:demo?people=-1", "people"),
        ("scene:demo?fps=nan", "fps"),
        ("scene:demo?frames=many", "frames"),
        ("scene:demo?oops", "key=value"),
        ("http://user:secret@127.0.0.1:9/x", "http://***@127.0.0.1:9/x refuses the connection"),
    ],
)
def test_what_cannot_be_opened_is_refused_in_one_line_with_a_remedy(
    spec: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SourceError) as caught:
        open_source(spec)
    message = str(caught.value)
    assert words in message
    assert "\n" not in message
    assert "secret" not in message
    assert capfd.readouterr().err == ""


def test_a_colon_in_a_path_is_not_a_protocol(tmp_path: Path) -> None:
    path = write_video(tmp_path / "12:30:00.mp4", 2)
    with open_source(str(path)) as source:
        assert source.read() is not None


def test_scale_shrinks_every_frame_and_keeps_the_original_size(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", 2)
    with open_source(str(path), scale=0.5) as source:
        frame = source.read()
        assert (source.width, source.height) == (32, 24)
    assert frame is not None
    assert frame.image.shape == (24, 32, 3)
    assert (frame.source_width, frame.source_height) == (64, 48)


def test_scale_never_makes_a_frame_vanish(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", 1, "MJPG", 1, 1)
    with open_source(str(path), scale=0.01) as source:
        frame = source.read()
    assert frame is not None
    assert frame.image.shape == (1, 1, 3)


def test_fps_replaces_the_rate_and_the_media_time(tmp_path: Path) -> None:
    with open_source(str(write_video(tmp_path / "v.mp4", 3)), fps=50.0) as source:
        frames = list(iter(source.read, None))
    assert source.fps == 50.0
    assert [frame.media_time_s for frame in frames] == pytest.approx([0.0, 0.02, 0.04])


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.01, float("nan")])
def test_a_scale_out_of_range_is_refused(scale: float) -> None:
    with pytest.raises(SourceError, match="scale"):
        open_source("scene:empty", scale=scale)


@pytest.mark.parametrize("fps", [0.0, -1.0, 241.0, float("nan")])
def test_a_rate_out_of_range_is_refused(fps: float) -> None:
    with pytest.raises(SourceError, match="fps"):
        open_source("scene:empty", fps=fps)


def test_loop_plays_on_with_growing_index_and_time(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", 3)
    with open_source(str(path), loop=True) as source:
        frames = [source.read() for _ in range(8)]
        assert source.frame_count is None
        source.close()
        assert source.read() is None
    assert source.end_reason == "closed"
    assert [frame.index for frame in frames if frame] == list(range(8))
    assert [index_of(frame.image) for frame in frames if frame] == [0, 1, 2, 0, 1, 2, 0, 1]


def test_a_recording_deleted_while_looping_is_an_error_that_names_it(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "f", [1])
    with open_source(str(folder), loop=True) as source:
        assert source.read() is not None
        (folder / "000001.png").unlink()
        with pytest.raises(SourceError, match="no pictures"):
            source.read()


def test_a_scene_is_chosen_with_its_keys() -> None:
    with open_source("scene:crossing?frames=3&width=160&height=120&fps=10") as source:
        assert isinstance(source, SceneSource)
        frames = list(iter(source.read, None))
    assert len(frames) == 3
    assert frames[2].image.shape == (120, 160, 3)
    assert frames[2].media_time_s == pytest.approx(0.2)
    assert source.end_reason == "end of scene"


@pytest.mark.parametrize(
    ("shape", "dtype", "value"),
    [
        ((4, 6), np.uint8, 77),
        ((4, 6, 1), np.uint8, 77),
        ((4, 6, 3), np.uint8, 77),
        ((4, 6, 4), np.uint8, 77),
        ((4, 6), np.uint16, 77 << 8),
    ],
)
def test_pictures_of_any_kind_become_bgr8(
    shape: tuple[int, ...], dtype: type[np.uint8 | np.uint16], value: int
) -> None:
    result = to_bgr8(np.full(shape, value, dtype))
    assert result.shape == (4, 6, 3)
    assert result.dtype == np.uint8
    assert np.all(result == 77)


@pytest.mark.parametrize(
    ("shape", "dtype"), [((4, 6, 2), np.uint8), ((4, 6), np.float32), ((0, 6), np.uint8)]
)
def test_other_arrays_are_refused(
    shape: tuple[int, ...], dtype: type[np.uint8 | np.float32]
) -> None:
    with pytest.raises(SourceError, match="picture"):
        to_bgr8(np.zeros(shape, dtype))


@pytest.mark.parametrize(("is_live", "stated"), [(True, 30.0), (False, 60.0)])
def test_a_rate_asked_for_is_a_recordings_and_what_a_camera_gives_stays(
    is_live: bool, stated: float
) -> None:
    given = open_source("scene:empty")
    given.is_live, given.fps = is_live, 30.0
    with AdjustedSource(given, fps=60.0) as source:
        assert source.fps == stated
