"""Recordings as files: begun, rotated, given up when the disk is full, begun anew."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from heel.schemas.errors import SettingsError
from heel.services.foxglove_messages import FoxgloveMessages
from heel.services.recorder.ring import Latches
from heel.services.recordings.wire import FLUSH_PERIOD_S, WireMessage
from heel.services.recordings.writing import RecordingBytes

SUFFIX = ".mcap"
_LOOK_S = 1.0
"""Seconds between two looks at the free space of the disk; chosen by hand."""
_AGAIN_S = 5.0
"""Seconds after a failure in which nothing is tried; chosen by hand."""
_MORE_ROOM = 1.1
"""So much more than the spare space has to be free before recording goes on; chosen by hand."""
_MOST_NAMES = 100_000
"""Names that are tried for a new file."""


@dataclass(frozen=True)
class Limits:
    """How much goes into one file, and what is left free of the disk."""

    file_bytes: int
    file_s: float
    spare_bytes: int


Free = Callable[[Path], int]


def free_bytes(folder: Path) -> int:
    """Bytes that this user may still write in a folder."""
    return shutil.disk_usage(folder).free


class RecordingFile:
    """One file that is being written; whatever stops it, what was flushed can be read.

    Args:
        path: of the file, which is not there yet.
        session: what it says of the recording.
        library: the software that writes, with its version.
        foxglove: makes messages for viewers of those of the bus, which go beside them; None: none.

    Raises:
        OSError: it cannot be made.
    """

    def __init__(
        self, path: Path, session: dict[str, str], library: str,
        foxglove: FoxgloveMessages | None = None,
    ) -> None:  # fmt: skip
        self.path = path
        self._foxglove = foxglove
        self._bytes = RecordingBytes(session, library)
        # Read and written by its owner: pictures of people are in it.
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self.size = 0
        self.messages = 0

    def add(self, message: WireMessage) -> None:
        """Take a message; whole chunks go to the system at once, the rest with `flush`.

        Raises:
            OSError: the disk took not all of it; the file is as before.
        """
        self._bytes.add(message)
        if self._foxglove is not None:
            for one in self._foxglove.of(
                message.key,
                message.encoding,
                message.payload,
                message.attachment,
                message.logged_ns,
            ):
                schema = one.kind.get_schema()
                self._bytes.add_beside(
                    one.topic,
                    "protobuf",
                    (schema.name, schema.encoding, schema.data),
                    one.data,
                    one.logged_ns,
                )
        self.messages += 1
        self._write(self._bytes.taken())

    def add_metadata(self, name: str, fields: dict[str, str]) -> None:
        """Take a record of text."""
        self._bytes.add_metadata(name, fields)

    def flush(self) -> None:
        """Give the system everything: from then on SIGKILL cannot take it.

        Raises:
            OSError: as `add`.
        """
        self._write(self._bytes.flush())

    def close(self) -> None:
        """Write the index and close the file.

        Raises:
            OSError: as `add`; it is closed all the same.
        """
        try:
            self._write(self._bytes.finish())
        finally:
            self.give_up()

    def give_up(self) -> None:
        """Close the file as it is, without an index; a file without a message is removed."""
        os.close(self._file)
        if not self.messages:
            with suppress(OSError):
                self.path.unlink()

    def _write(self, parts: Iterable[bytes]) -> None:
        before = self.size
        try:
            for part in parts:
                rest = memoryview(part)
                while rest:
                    written = os.write(self._file, rest)
                    self.size += written
                    rest = rest[written:]
        except OSError:
            # Half a record would hide what comes behind it.
            with suppress(OSError):
                os.ftruncate(self._file, before)
            raise


class RecordingFiles:
    """Messages in one file after the other.

    Args:
        out: a folder, or the name of the first file.
        limits: of one file, and of the disk.
        session: what every file says of the recording.
        library: the software that writes, with its version.
        free: bytes that are free in a folder.
        foxglove: as of `RecordingFile`.

    Raises:
        SettingsError: the folder cannot be made, or the file is there already.
    """

    def __init__(
        self, out: Path, limits: Limits, session: dict[str, str], library: str,
        free: Free = free_bytes, foxglove: FoxgloveMessages | None = None,
    ) -> None:  # fmt: skip
        self._single = out if out.suffix == SUFFIX else None
        self._folder = out.parent if self._single else out
        self._limits, self._session, self._library = limits, session, library
        self._free, self._foxglove = free, foxglove
        self._file: RecordingFile | None = None
        self._begun_s = self._flushed_s = 0.0
        self._looked_s = self._failed_s = float("-inf")
        self._latches = Latches()
        self.settings: dict[str, dict[str, str]] = {}
        """Further records of text for every file, by name."""
        self.problem: str | None = None
        """Why nothing is written at present."""
        self.lost = 0
        """Messages that were not written."""
        self.path: Path | None = None
        """The newest file."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SettingsError(
                f"recorder.out = {str(out)!r}: {error.strerror}: name another folder"
            ) from None
        if self._single is not None and self._single.exists():
            raise SettingsError(f"recorder.out: {self._single} is there already: name another file")

    def add(self, message: WireMessage, now_s: float) -> None:
        """Write a message, or count it as lost where that cannot be."""
        try:
            file = self._ready(message.logged_ns, now_s)
            if file is None:
                self.lost += 1
            else:
                file.add(message)
        except OSError as error:
            self._fail(error, now_s)
            self.lost += 1
        self._latches.take(message)

    def tick(self, now_s: float) -> None:
        """What is due by time: a flush, a look at the disk, another file."""
        if self._file is None:
            return
        try:
            if now_s - self._flushed_s >= FLUSH_PERIOD_S:
                self._flushed_s = now_s
                self._file.flush()
            over = now_s - self._begun_s >= self._limits.file_s
            if over or self._full(now_s, self._limits.spare_bytes):
                self._end()
        except OSError as error:
            self._fail(error, now_s)

    def write_whole(
        self, reason: str, messages: Iterable[WireMessage], now_s: float
    ) -> Path | None:
        """Write some messages as a file of their own; its name, or None where that cannot be."""
        for message in messages:
            if self._file is None and self._full(now_s, self._limits.spare_bytes):
                return None
            try:
                if self._file is None:
                    self._begin(reason, now_s)
                assert self._file is not None
                self._file.add(message)
            except OSError as error:
                self._fail(error, now_s)
                return None
        path = self.path
        self.close(now_s)
        return None if self.problem else path

    def close(self, now_s: float) -> None:
        """End the file, with its index."""
        try:
            self._end()
        except OSError as error:
            self._fail(error, now_s)

    def abandon(self) -> None:
        """Leave the file as it was flushed: what is to be written next may be half a record."""
        file, self._file = self._file, None
        if file is not None:
            file.give_up()

    def _ready(self, logged_ns: int, now_s: float) -> RecordingFile | None:
        """The file that takes the next message; None while there is no room.

        Raises:
            OSError: a file cannot be made or written.
        """
        file = self._file
        if file is not None and file.size >= self._limits.file_bytes:
            self._end()
        elif file is not None:
            return file
        if now_s - self._failed_s < _AGAIN_S:
            return None
        room = self._limits.spare_bytes * (_MORE_ROOM if self.problem else 1.0)
        if self._full(now_s, room):
            return None
        made = self._begin("", now_s)
        for one in self._latches.values():
            # Told again at the beginning of each file, as of its first moment.
            made.add(
                WireMessage(one.key, one.encoding, one.payload, one.attachment, logged_ns)
            )  # fmt: skip
        return made

    def _full(self, now_s: float, room: float) -> bool:
        if now_s - self._looked_s < _LOOK_S:
            return self.problem is not None
        self._looked_s = now_s
        free = self._free(self._folder)
        if free >= room:
            self.problem = None
            return False
        self.problem = (
            f"the disk is full: {free >> 20} MB free at {self._folder}, spare_mb is "
            f"{self._limits.spare_bytes / 1e6:.0f}: nothing is recorded until there is room"
        )
        return True

    def _begin(self, word: str, now_s: float) -> RecordingFile:
        for path in self._names(word):
            try:
                self._file = RecordingFile(path, self._session, self._library, self._foxglove)
            except FileExistsError:
                continue
            self.path, self._begun_s, self._flushed_s, self.problem = path, now_s, now_s, None
            for name, fields in self.settings.items():
                self._file.add_metadata(name, fields)
            return self._file
        raise FileExistsError(f"{self._folder} has {_MOST_NAMES} files of the same name")

    def _names(self, word: str) -> Iterable[Path]:
        stem = time.strftime("heel-%Y%m%dT%H%M%SZ", time.gmtime())
        if self._single is not None:
            stem = self._single.stem
            yield self._single
        stem += f"-{word}" if word else ""
        for number in range(1, _MOST_NAMES):
            yield self._folder / f"{stem}-{number:03d}{SUFFIX}"

    def _end(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.close()

    def _fail(self, error: OSError, now_s: float) -> None:
        self.abandon()
        self._failed_s = now_s
        self.problem = (
            f"cannot record to {self._folder}: {error.strerror or error}: trying again every "
            f"{_AGAIN_S:.0f} s"
        )
