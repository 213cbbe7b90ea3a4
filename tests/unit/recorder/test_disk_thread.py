"""A disk that stalls costs what does not fit, and nobody waits for it."""

from __future__ import annotations

import logging
import threading
from pathlib import Path

from heel.services.recorder.disk import DiskThread, Saving
from heel.services.recorder.files import Limits, RecordingFiles
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import SESSION, image, tracks

LOG = logging.getLogger("test")


class Stalled(RecordingFiles):
    """Files on a disk that does nothing until it is let go."""

    def __init__(self, out: Path) -> None:
        super().__init__(out, Limits(10**9, 3600.0, 0), SESSION, "test")
        self.go = threading.Event()

    def add(self, message: WireMessage, now_s: float) -> None:
        self.go.wait(10.0)
        super().add(message, now_s)


def test_what_does_not_fit_is_lost_and_counted_and_the_rest_is_written(tmp_path: Path) -> None:
    files = Stalled(tmp_path)
    disk = DiskThread(files, 10 * image(0).size, LOG)
    disk.start()
    taken = [disk.put(image(seq)) for seq in range(25)]
    assert taken == [True] * 10 + [False] * 15
    assert disk.too_slow == 15
    files.go.set()
    disk.close()
    assert not disk.is_alive()
    (path,) = tmp_path.iterdir()
    whole = Recording(path)
    assert list(wire_messages(whole)) == [image(seq) for seq in range(10)]
    assert whole.complete


def test_the_last_seconds_get_a_file_of_their_own(tmp_path: Path) -> None:
    disk = DiskThread(RecordingFiles(tmp_path, Limits(10**9, 3600.0, 0), SESSION, "test"), 1, LOG)
    saving = Saving("estop", [tracks(seq) for seq in range(30)])
    assert disk.save(saving)
    assert not disk.save(Saving("unsure", [tracks(0)])), "one after the other"
    disk.start()
    assert saving.done.wait(10.0)
    disk.close()
    assert saving.path is not None
    assert saving.path.name.endswith("-estop-001.mcap")
    assert len(list(wire_messages(Recording(saving.path)))) == 30


def test_an_error_in_the_thread_ends_no_recording(tmp_path: Path) -> None:
    files = Stalled(tmp_path)
    files.go.set()
    disk = DiskThread(files, 10**6, LOG)
    disk.put(WireMessage("a", "b", "no bytes", None, 0))  # type: ignore[arg-type]
    disk.put(tracks(1))
    disk.start()
    disk.close()
    assert disk.failure is not None
    assert "please report it" in disk.failure
    (path,) = tmp_path.iterdir()
    assert tracks(1) in list(wire_messages(Recording(path)))
