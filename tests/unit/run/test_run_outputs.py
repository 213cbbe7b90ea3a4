"""Results of a run take the place of older ones only once there are some, and are always whole."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from heel.schemas import HeelError, MotionCommand, Track, Tracks
from heel.services.run.folder import DEMO_PREFIX, ScratchFolder, sweep
from heel.services.run.outputs import RunOutputs
from heel.services.run.summary import RunSummary
from heel.services.runtime.row_file import RowFile

OLD = {"tracks.txt": "old\n", "commands.csv": "old\n", "summary.json": "{}\n", "annotated.mp4": "x"}


def tracks(seq: int) -> Tracks:
    track = Track(
        id=1, box_xyxy=(10.0, 20.0, 30.0, 60.0), velocity_pxps=(0.0, 0.0), state="tracked",
        shown=True, occluded_by=(), identity_confidence=1.0, area_px=800.0, span_px=40.0,
    )  # fmt: skip
    return Tracks(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=seq, width=64, height=64,
        source_width=64, source_height=64, tracks=(track,),
    )  # fmt: skip


def command(seq: int) -> MotionCommand:
    return MotionCommand(
        seq=seq,
        ttl_s=0.5,
        linear_mps=0.5,
        angular_radps=0.0,
        state="following",
        reason="target in sight",
    )


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


@pytest.fixture
def used(tmp_path: Path) -> Path:
    for name, text in OLD.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "tracker.log").write_text("old\n")
    return tmp_path


@contextmanager
def longest_file(size: int) -> Iterator[None]:
    """No file of this process may become longer, as on a disk that is full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_run_without_a_frame_changes_nothing(used: Path) -> None:
    with suppress(HeelError):
        with RunOutputs(used, RunSummary("live"), annotate=True) as outputs:
            (outputs.log_folder / "tracker.log").write_text("new\n")
            outputs.command(command(0))
            raise HeelError("no camera")
    assert content(used) == OLD
    assert sorted(path.name for path in used.iterdir()) == sorted([*OLD, "logs"])
    assert (used / "logs" / "tracker.log").read_text() == "old\n"


def test_a_folder_made_for_nothing_goes_again(tmp_path: Path) -> None:
    with RunOutputs(tmp_path / "a" / "b", RunSummary("live"), annotate=False):
        pass
    assert list(tmp_path.iterdir()) == []


def test_the_first_frame_puts_everything_in_place_while_the_run_goes_on(used: Path) -> None:
    summary = RunSummary("live")
    with RunOutputs(used, summary, annotate=False) as outputs:
        (outputs.log_folder / "tracker.log").write_text("new\n")
        outputs.command(command(0))
        outputs.tracks(tracks(0))
        outputs.tracks(tracks(1))
        outputs.command(command(1))
        now = content(used)
        assert [line[:4] for line in now["tracks.txt"].splitlines()] == ["1,1,", "2,1,"]
        assert now["commands.csv"].count("following") == 2
        kept = {"tracks.txt", "commands.csv", "states.csv"}
        assert set(now) == kept, "older results are not beside newer ones"
        assert (outputs.log_folder / "tracker.log").read_text() == "new\n"
        assert outputs.log_folder == used / "logs"
        summary.tracked = 2
    assert json.loads((used / "summary.json").read_text())["frames"]["tracked"] == 2
    assert sorted(path.name for path in used.iterdir()) == [
        "commands.csv", "logs", "states.csv", "summary.json", "tracks.txt"
    ]  # fmt: skip


def test_links_in_the_way_are_replaced_and_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious\n")
    out = tmp_path / "out"
    out.mkdir()
    for name in ("tracks.txt", "commands.csv", "summary.json"):
        (out / name).symlink_to(victim)
    (out / "logs").symlink_to(tmp_path)
    with RunOutputs(out, RunSummary("live"), annotate=False) as outputs:
        (outputs.log_folder / "victim").write_text("a log\n")
        outputs.tracks(tracks(0))
    assert victim.read_text() == "precious\n"
    assert not any((out / name).is_symlink() for name in ("tracks.txt", "summary.json", "logs"))


def test_a_folder_in_the_way_of_a_file_is_named_before_anything_is_done(used: Path) -> None:
    (used / "tracks.txt").unlink()
    (used / "tracks.txt").mkdir()
    with pytest.raises(HeelError, match=r"--out .*tracks\.txt is a folder"):
        RunOutputs(used, RunSummary("live"), annotate=False)
    assert not list(used.glob(".heel-run-*"))


def test_a_full_disk_ends_in_one_line_whole_rows_and_a_summary_that_says_so(
    tmp_path: Path,
) -> None:
    def fill() -> None:
        with RunOutputs(tmp_path, RunSummary("live"), annotate=False) as outputs:
            with longest_file(1000):
                for seq in range(100):
                    outputs.tracks(tracks(seq))

    with pytest.raises(HeelError, match=r"--out .*: File too large: .*room"):
        fill()
    rows = (tmp_path / "tracks.txt").read_text().splitlines(keepends=True)
    assert 10 < len(rows) < 100
    assert all(row.endswith(",-1,-1,-1\n") for row in rows)
    assert "File too large" in json.loads((tmp_path / "summary.json").read_text())["ended"]


def test_a_film_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    image = np.random.default_rng(1).integers(0, 255, (256, 256, 3)).astype(np.uint8)
    for limit, name in ((1 << 30, "whole"), (70_000, "none")):
        with longest_file(limit):
            with RunOutputs(tmp_path / name, RunSummary("live"), annotate=True) as outputs:
                assert outputs.film is not None
                for seq in range(30):
                    outputs.tracks(tracks(seq))
                    outputs.film.write(image, tracks(seq), None, str(seq), 25.0)
    film = cv2.VideoCapture(str(tmp_path / "whole" / "annotated.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 30
    film.release()
    assert not (tmp_path / "none" / "annotated.mp4").exists()
    assert (tmp_path / "none" / "tracks.txt").read_text().count("\n") == 30


def test_rows_are_appended_whole_or_not_at_all(tmp_path: Path) -> None:
    file = RowFile(tmp_path / "rows")
    with longest_file(25):
        file.append("0123456789\n" * 2)
        with pytest.raises(OSError, match="too large"):
            file.append("0123456789\n")
    file.append("room again\n")
    file.close()
    assert (tmp_path / "rows").read_text() == "0123456789\n" * 2 + "room again\n"


def test_scratch_folders_of_killed_runs_are_swept_and_those_in_use_are_not(tmp_path: Path) -> None:
    left = tmp_path / f"{DEMO_PREFIX}left"
    left.mkdir()
    (left / "big").write_text("x" * 1000)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / f"{DEMO_PREFIX}link").symlink_to(elsewhere)
    used = ScratchFolder(tmp_path, DEMO_PREFIX)
    sweep(tmp_path, DEMO_PREFIX)
    assert not left.exists()
    assert used.path.is_dir()
    assert elsewhere.is_dir()
    used.remove()
    assert not used.path.exists()
