"""Text files of rows that are whole whatever becomes of the process or the disk."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


class RowFile:
    """A file of rows that only ever holds whole ones: what a full disk cut off is taken back.

    Raises:
        OSError: it cannot be written, or a link is in the way.
    """

    def __init__(self, path: Path) -> None:
        """Make the file, or empty the one that is there."""
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
        self._file = os.open(path, flags, 0o666)
        self.size = 0

    def append(self, rows: str) -> None:
        """Write rows, each with its newline; after a crash of this process they are there."""
        content = rows.encode()
        rest = content
        try:
            while rest:
                rest = rest[os.write(self._file, rest) :]
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self.size)
            raise
        self.size += len(content)

    def close(self) -> None:
        """Close it."""
        os.close(self._file)
