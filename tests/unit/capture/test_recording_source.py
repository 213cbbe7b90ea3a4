"""Recordings of the bus as a source of frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.source import Frame
from heel.services.capture.sources import open_source
from tests.support.recordings import depth, image, info, jpeg, recording, tracks


def frames(spec: Path | str, **options: float) -> list[Frame]:
    found = []
    with open_source(str(spec), **options) as source:  # type: ignore[arg-type]
        while (frame := source.read()) is not None:
            found.append(frame)
    return found


def test_frames_come_out_as_they_were_taken(tmp_path: Path) -> None:
    taken = [image(seq, at_ms=40 * seq + (7 if seq == 2 else 0)) for seq in (5, 6, 8)]
    path = recording(tmp_path / "a.mcap", [info(), tracks(5), *taken])
    found = frames(path)
    assert [frame.index for frame in found] == [5, 6, 8]
    assert [frame.media_time_s for frame in found] == pytest.approx([0.0, 0.04, 0.12])
    assert (found[0].source_width, found[0].source_height) == (64, 48)
    assert [frame.image.tobytes() for frame in found] == [one.payload for one in taken]
    with open_source(str(path)) as source:
        assert (source.width, source.height, source.fps) == (32, 24, 25.0)
        assert not source.is_live


def test_a_scene_that_was_played_live_has_its_own_times_again(tmp_path: Path) -> None:
    late = [image(seq, at_ms=40 * seq + 3 * (seq % 3)) for seq in range(5)]
    found = frames(recording(tmp_path / "a.mcap", [info(frame_count=100), *late]))
    assert [frame.media_time_s for frame in found] == [seq / 25.0 for seq in range(5)]


def test_a_lossless_run_has_the_times_of_its_media(tmp_path: Path) -> None:
    told = [image(seq, t_capture_ns=33_000_000 * seq) for seq in range(3)]
    again = [image(seq, epoch=2, t_capture_ns=33_000_000 * seq) for seq in range(2)]
    found = frames(recording(tmp_path / "a.mcap", [info(frame_count=3), *told, *again]))
    assert [frame.index for frame in found] == [0, 1, 2, 3, 4]
    assert [frame.media_time_s for frame in found] == pytest.approx(
        [0.0, 0.033, 0.066, 0.106, 0.139]
    )


def test_jpegs_are_decoded_and_raw_frames_preferred(tmp_path: Path) -> None:
    both = [one for seq in range(3) for one in (jpeg(seq), image(seq))]
    found = frames(recording(tmp_path / "both.mcap", [info(), *both]))
    assert [frame.image.tobytes() for frame in found] == [image(seq).payload for seq in range(3)]
    found = frames(recording(tmp_path / "jpeg.mcap", [info(), *(jpeg(seq) for seq in range(3))]))
    assert [frame.image.shape for frame in found] == [(24, 32, 3)] * 3


def test_of_several_cameras_one_is_named(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", [
        info(), info(stream="rear"), image(0), image(1, stream="rear"), image(2, stream="rear"),
    ])  # fmt: skip
    with pytest.raises(SourceError, match=r"frames of front, rear in it: name one, as in .*front"):
        open_source(str(path))
    assert len(frames(f"{path}?camera=rear")) == 2
    with pytest.raises(SourceError, match="no frames of camera 'up'"):
        open_source(f"{path}?camera=up")


def test_one_that_is_cut_off_ends_with_the_word(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", [info(), image(0), image(1)], closed=False)
    with open_source(str(path)) as source:
        assert [source.read() is not None for _ in range(3)] == [True, True, False]
        assert source.end_reason == "end of recording, which is cut off"


def test_without_frames_it_is_no_source(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no frames in it: record with --frames"):
        open_source(str(recording(tmp_path / "a.mcap", [info(), tracks(0)])))
    with pytest.raises(SourceError, match="No such file"):
        open_source(str(tmp_path / "absent.mcap"))


def test_it_is_scaled_retimed_and_looped_like_any_other(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", [info(), *(image(seq) for seq in range(3))])
    found = frames(path, scale=0.5, fps=10.0)
    assert [frame.media_time_s for frame in found] == [0.0, 0.1, 0.2]
    assert found[0].image.shape == (12, 16, 3)
    with open_source(str(path), loop=True) as source:
        looped = [source.read() for _ in range(5)]
    assert [one.index for one in looped if one is not None] == [0, 1, 2, 3, 4]
    first = looped[0]
    assert first is not None
    assert first.image.tobytes() == image(0).payload


def depths(found: list[Frame]) -> list[int | None]:
    """Millimetres that each frame's depth shows everywhere."""
    return [None if one.depth_mm is None else int(one.depth_mm[5, 5]) for one in found]


def test_depth_comes_with_its_frame_whenever_it_was_recorded(tmp_path: Path) -> None:
    late = [image(0), image(1), depth(0), image(2), depth(1), depth(2)]
    early = [depth(0), depth(1), image(0), image(1), depth(2), image(2)]
    for name, order in (("late", late), ("early", early)):
        found = frames(recording(tmp_path / f"{name}.mcap", [info(fov_rad=1.2), *order]))
        assert [frame.index for frame in found] == [0, 1, 2]
        assert depths(found) == [1000, 1001, 1002]
        assert found[0].depth_mm is not None
        assert found[0].depth_mm.shape == (12, 16)


def test_a_frame_without_depth_of_its_own_has_none(tmp_path: Path) -> None:
    some = [image(0), depth(0), image(1), image(2), depth(2), *map(image, range(3, 40)), depth(39)]
    found = frames(recording(tmp_path / "a.mcap", [info(), *some]))
    assert [frame.index for frame in found] == list(range(40))
    assert depths(found) == [1000, None, 1002, *[None] * 36, 1039]


def test_a_second_start_of_the_camera_has_depth_of_its_own(tmp_path: Path) -> None:
    order = [image(0), depth(0), image(0, epoch=2), image(1, epoch=2), depth(1, epoch=2)]
    assert depths(frames(recording(tmp_path / "a.mcap", [info(), *order]))) == [1000, None, 1001]
    twice = [
        one for start in range(2) for seq in range(start, 3) for one in (image(seq), depth(seq))
    ]
    found = frames(recording(tmp_path / "b.mcap", [info(), *twice]))
    assert depths(found) == [1000, 1001, 1002, 1001, 1002]


def test_depth_that_cannot_be_read_is_skipped_with_a_word(tmp_path: Path) -> None:
    headless = replace(depth(1), attachment=b"odd")
    order = [image(0), depth(0, cut=2), image(1), headless, image(2), depth(2)]
    path, told = recording(tmp_path / "a.mcap", [info(), *order]), []
    with open_source(str(path), warn=told.append) as source:
        assert depths([one for one in iter(source.read, None) if one is not None]) == [
            None, None, 1002,
        ]  # fmt: skip
    assert len(told) == 2
    assert any("382 bytes are not 16x12 pixels" in one for one in told)


def test_only_with_depth_the_recorded_camera_counts(tmp_path: Path) -> None:
    plain = recording(tmp_path / "plain.mcap", [info(fov_rad=1.2), image(0)])
    deep = recording(tmp_path / "deep.mcap", [info(fov_rad=1.2), image(0), depth(0)])
    with open_source(str(plain), scale=0.5) as source:
        assert (source.has_depth, source.camera) == (False, None)
    for adjusted in ({"scale": 0.5}, {"loop": True}):
        with open_source(str(deep), **adjusted) as source:  # type: ignore[arg-type]
            assert source.has_depth
            assert source.camera is not None
            assert source.camera.horizontal_fov_rad == 1.2
            frame = source.read()
            assert frame is not None
            assert depths([frame]) == [1000]
