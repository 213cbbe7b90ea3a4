"""Files are begun, rotated and left readable, whatever the disk does."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from heel.schemas.errors import SettingsError
from heel.services.recorder.files import Limits, RecordingFiles
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import SESSION, image, info, tracks

ROOMY = Limits(10**9, 3600.0, 10**6)


class DiskOf:
    """A disk with so much free space."""

    def __init__(self, free: int) -> None:
        self.free = free

    def __call__(self, _folder: Path) -> int:
        return self.free


def files(out: Path, limits: Limits = ROOMY, disk: DiskOf | None = None) -> RecordingFiles:
    return RecordingFiles(out, limits, SESSION, "heel test", disk or DiskOf(10**12))


def read(path: Path) -> list[WireMessage]:
    return list(wire_messages(Recording(path)))


def test_what_is_flushed_is_there_without_an_end(tmp_path: Path) -> None:
    made = files(tmp_path)
    for seq in range(10):
        made.add(tracks(seq), 0.04 * seq)
        made.tick(0.04 * seq)
    (path,) = tmp_path.iterdir()
    assert len(read(path)) >= 7, "all but those since the last flush"
    assert path.stat().st_mode & 0o077 == 0, "others may not look at it"


def test_a_new_file_is_begun_by_size_and_by_time_with_what_is_latched(tmp_path: Path) -> None:
    made = files(tmp_path / "size", Limits(3 * 10**6, 3600.0, 0))
    made.add(info(), 0.0)
    for seq in range(2000):
        made.add(image(seq), 0.0)
    made.close(0.0)
    parts = sorted((tmp_path / "size").iterdir())
    assert len(parts) == 2
    assert [one for part in parts for one in read(part)[1:]] == [image(seq) for seq in range(2000)]
    assert all(read(part)[0].payload == info().payload for part in parts)

    made = files(tmp_path / "time", Limits(10**9, 10.0, 0))
    for second in range(25):
        made.add(tracks(second), float(second))
        made.tick(float(second))
    made.close(25.0)
    assert [len(read(part)) for part in sorted((tmp_path / "time").iterdir())] == [11, 11, 3]


def test_a_full_disk_ends_the_file_cleanly_and_room_begins_another(tmp_path: Path) -> None:
    disk = DiskOf(10**9)
    made = files(tmp_path, Limits(10**9, 3600.0, 10**8), disk)
    made.add(tracks(0), 0.0)
    disk.free = 10**7
    made.tick(2.0)
    assert made.problem is not None
    assert "the disk is full: 9 MB free" in made.problem
    (path,) = tmp_path.iterdir()
    whole = Recording(path)
    assert len(list(wire_messages(whole))) == 1
    assert whole.complete
    made.add(tracks(1), 3.5)
    assert made.lost == 1
    disk.free = 10**9
    made.add(tracks(2), 5.0)
    made.close(5.1)
    assert made.problem is None
    assert [len(read(part)) for part in sorted(tmp_path.iterdir())] == [1, 1]


def test_a_write_that_fails_half_way_leaves_whole_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = files(tmp_path)
    for seq in range(100):
        made.add(image(seq), 0.0)
    made.tick(1.0)
    write = os.write

    def half(file: int, data: bytes) -> int:
        monkeypatch.setattr(os, "write", full)
        return write(file, data[: len(data) // 2])

    def full(file: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", half)
    made.add(image(100), 2.0)
    made.tick(2.0)
    assert made.problem is not None
    assert "No space left on device" in made.problem
    (path,) = tmp_path.iterdir()
    cut = Recording(path)
    assert list(wire_messages(cut)) == [image(seq) for seq in range(100)]
    assert cut.damage == ""
    monkeypatch.setattr(os, "write", write)
    made.add(image(101), 3.0)
    assert made.lost == 1, "not tried again at once"
    made.add(image(102), 8.0)
    made.close(8.1)
    assert made.problem is None
    assert read(sorted(tmp_path.iterdir())[1]) == [image(102)]


def test_a_file_that_is_there_is_never_written_over(tmp_path: Path) -> None:
    there = tmp_path / "mine.mcap"
    there.write_bytes(b"precious")
    with pytest.raises(SettingsError, match="is there already: name another file"):
        files(there)
    with pytest.raises(SettingsError, match="name another folder"):
        files(there / "in")
    made = files(tmp_path / "new.mcap", Limits(1, 3600.0, 0))
    for seq in range(3):
        made.add(tracks(seq), 0.0)
        made.tick(1.0 + seq)
    made.close(9.0)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"mine.mcap", "new.mcap", "new-001.mcap", "new-002.mcap"}
    assert there.read_bytes() == b"precious"
