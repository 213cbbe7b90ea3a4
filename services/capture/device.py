"""What a live connection offers to `LiveSource`, whatever is behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import SourceError


class RecordingEnded(SourceError):  # noqa: N818 - an end, not a fault
    """A stream that announced its length has come to its end."""


@dataclass(frozen=True, eq=False, slots=True)
class Picture:
    """One picture of a camera.

    Attributes:
        image: (H, W, 3) uint8 BGR; not written to afterwards.
        taken_ns: `time.monotonic_ns()` when the camera gave it away, as near as can be told; in a
            buffer it grows old.
        skipped: pictures before it that came, and were left out for this newer one.
    """

    image: NDArray[np.uint8]
    taken_ns: int
    skipped: int = 0


class Device(Protocol):
    """An open connection to a camera; one thread reads it."""

    @property
    def fps(self) -> float:
        """The rate that the camera states, frames per second; 0 if it states none."""

    @property
    def complaint(self) -> str:
        """Why no picture comes although data does; empty when all is well."""

    def read(self) -> Picture:
        """Block for the newest picture.

        Raises:
            SourceError: the connection is lost.
            RecordingEnded: there are no more pictures and never will be.
        """

    def interrupt(self) -> None:
        """Make a read of another thread end soon, where that can be done."""

    def close(self) -> None:
        """Close the connection; the reading thread calls it, once."""
