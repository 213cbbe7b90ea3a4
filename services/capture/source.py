"""What every frame source is: one interface for recordings, folders, cameras and drawn scenes."""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from heel.schemas import CameraInfo
from heel.schemas.errors import SourceError
from heel.services.capture.pan_window import PanWindow

DEFAULT_FPS = 25.0
"""Rate assumed when a container or a driver gives none or a nonsensical one."""

MAX_FPS = 240.0
"""Above it a stated rate is a time base, not a rate: containers say 1000 or 90000 when unsure."""

Warn = Callable[[str], None]
"""Receives one line for every defect that does not end the stream."""

log_warning: Warn = logging.getLogger("heel.capture").warning


class SourceTimeout(SourceError):  # noqa: N818 - a state to go on from, like TimeoutExpired
    """A camera gave no frame within the time asked for; the next read may succeed."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture.

    Attributes:
        image: (H, W, 3) uint8 BGR, contiguous; not written to afterwards.
        index: position on the source's own timeline, from 0. Numbers are left out where a folder
            has a gap, a picture is unreadable or a camera was faster than its reader, so that
            frame `n` of a data set's ground truth is always `index + 1`.
        media_time_s: seconds since the first frame: by the time stamps of a video, `index / fps` in
            a folder, a scene and wherever a rate is given, by the clock of a camera.
        source_width: width in pixels before `--scale`.
        source_height: height in pixels before `--scale`.
        acquired_ns: `time.monotonic_ns()` when a camera gave it away, which is before it came out
            of buffers on the way; None in a recording.
        new_ns: the same of the newest picture that showed anything new. A camera that repeats
            itself byte for byte, or is black, shows nothing newer: its age counts from then.
        depth_mm: (h, w) uint16, millimetres along the optical axis of what the picture shows, 0
            where nothing was measured; None without.
    """

    image: NDArray[np.uint8]
    index: int
    media_time_s: float
    source_width: int
    source_height: int
    acquired_ns: int | None = None
    new_ns: int | None = None
    depth_mm: NDArray[np.uint16] | None = None


@dataclass(frozen=True)
class SourceStatus:
    """How a source is doing.

    Attributes:
        state: `stalled` is connected but without pictures, `frozen` shows nothing new, `behind`
            delivers pictures that are old already.
        attempt: number of the current attempt to connect again, 0 when connected.
        reconnects: times the connection was lost and found again.
        last_error: why the camera is not well, or why it was not last; empty if it always was.
    """

    state: Literal["connected", "stalled", "reconnecting", "frozen", "behind", "closed"] = (
        "connected"
    )
    attempt: int = 0
    reconnects: int = 0
    last_error: str = ""


class FrameSource(ABC):
    """An open source of frames; one thread reads it, any thread may close it.

    Attributes:
        name: what the frames come from, for people; without passwords.
        width: pixels of the frames it delivers; single frames may differ from it.
        height: pixels, likewise.
        fps: nominal frames per second, in (0, 240].
        frame_count: frames that a recording announces, None when endless or unknown.
        is_live: True for a camera, which does not wait for its reader.
        window: what turns in a virtual pan, None in every other source.
        has_depth: whether frames come with depth.
        camera: what the camera said of itself when that was recorded; None where nothing did.
        end_reason: why `read` returned None; empty before that.
    """

    name: str
    width: int
    height: int
    fps: float
    frame_count: int | None = None
    is_live: bool = False
    window: PanWindow | None = None
    has_depth: bool = False
    camera: CameraInfo | None = None
    end_reason: str = ""

    @abstractmethod
    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame, or None at the end of the stream (then `end_reason` says why).

        Raises:
            SourceTimeout: a live camera gave nothing for `timeout_s` seconds.
        """

    @abstractmethod
    def close(self) -> None:
        """Release the device or file; harmless when repeated."""

    @property
    def status(self) -> SourceStatus:
        """How the source is doing now; recordings are always connected."""
        return SourceStatus()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def plausible_fps(stated: float, name: str, warn: Warn) -> float:
    """`stated` if it is a rate a camera can have, else `DEFAULT_FPS` and a warning."""
    if math.isfinite(stated) and 0.0 < stated <= MAX_FPS:
        return stated
    warn(f"{name} states {stated:g} frames/s: using {DEFAULT_FPS:g}; set the rate with --fps")
    return DEFAULT_FPS
