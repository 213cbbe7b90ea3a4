"""The truth of an episode in a file, for scores: never read by the stack.

One JSON object a line, `{"sim-world": {...}}` at the start of each episode and
`{"sim-truth": {...}}` for each frame, in the words of the messages of those names.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from schemas import HeelError, SimTruth, SimWorld


class TruthFile:
    """Appends lines; what was written before a crash is there."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def write(self, message: SimTruth | SimWorld) -> None:
        """Append one message."""
        self._stream.write(f'{{"{message.schema_name}": {message.model_dump_json()}}}\n')


@contextmanager
def open_truth(path: Path | None) -> Iterator[TruthFile | None]:
    """A file to write the truth to, None where none is wanted.

    Raises:
        HeelError: it cannot be written.
    """
    if path is None:
        yield None
        return
    try:
        stream = path.open("w", buffering=1, encoding="ascii")
    except OSError as error:
        raise HeelError(
            f"--truth {path}: {error.strerror}: give a file that can be written"
        ) from None
    with stream:
        yield TruthFile(stream)
