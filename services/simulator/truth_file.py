"""The truth of an episode in a file, for scores: never read by the stack.

One JSON object a line, `{"sim-world": {...}}` at the start of each episode and
`{"sim-truth": {...}}` for each frame, in the words of the messages of those names.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from heel.schemas import HeelError, SimTruth, SimWorld
from heel.services.runtime.row_file import RowFile

MOST_BYTES = 1 << 30
"""Twelve hours of 25 frames a second; an endless demo does not fill a disk."""


class TruthFile:
    """Appends lines; what was written before a crash is there, and whole.

    Raises:
        HeelError: it cannot be written.
    """

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        self._path, self._most_bytes = path, most_bytes
        self._full = False
        try:
            self._rows = RowFile(path)
        except OSError as error:
            raise self._cannot_write(error) from None

    def write(self, message: SimTruth | SimWorld) -> None:
        """Append one message, unless the file is as long as it may become.

        Raises:
            HeelError: it cannot be written.
        """
        if self._rows.size >= self._most_bytes:
            if not self._full:
                self._full = True
                logging.getLogger("heel.simulator").warning(
                    "%s has %d bytes: no further truth goes there", self._path, self._rows.size
                )
            return
        try:
            self._rows.append(f'{{"{message.schema_name}": {message.model_dump_json()}}}\n')
        except OSError as error:
            raise self._cannot_write(error) from None

    def close(self) -> None:
        """Close it."""
        self._rows.close()

    def _cannot_write(self, error: OSError) -> HeelError:
        return HeelError(
            f"--truth {self._path}: {error.strerror}: give a file that can be written, on a disk "
            "with room"
        )


@contextmanager
def open_truth(path: Path | None) -> Iterator[TruthFile | None]:
    """A file to write the truth to, None where none is wanted.

    Raises:
        HeelError: it cannot be written.
    """
    if path is None:
        yield None
        return
    with closing(TruthFile(path)) as file:
        yield file
