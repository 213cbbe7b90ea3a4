"""A turning camera made of a wide recording: `pan:PATH?width=384&height=288&fov_deg=60`."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO
from urllib.parse import parse_qsl

from pydantic import ValidationError

from heel.schemas.errors import SourceError
from heel.services.capture.pan_window import PanSettings, PanWindow
from heel.services.capture.source import Frame, FrameSource, SourceTimeout
from heel.services.runtime.pacing import Pacer
from heel.services.runtime.passwords import without_passwords

PAN_PREFIX = "pan:"


class VirtualPanSource(FrameSource):
    """The window of a recording, played like a camera: what is not read in time is left out.

    The window is cut when a frame is due, so that it shows what the camera sees at that moment.

    Args:
        recording: closed with this one.
        settings: of the window.
        name: for people.
        clock: monotonic seconds.
        wait: sleeps for so many seconds.

    Raises:
        SourceError: the window does not fit, or its file cannot be written.
    """

    is_live = True

    def __init__(
        self,
        recording: FrameSource,
        settings: PanSettings,
        name: str,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self.window: PanWindow = PanWindow((recording.width, recording.height), settings)
        self._recording, self.name = recording, name
        self._clock, self._wait = clock, wait
        self.width, self.height = self.window.width, self.window.height
        self.fps, self.frame_count = recording.fps, recording.frame_count
        self._pacer = Pacer(self.fps)
        self._next: Frame | None = None
        self._resources = ExitStack()
        self._file: TextIO | None = None
        if settings.window_file is not None:
            self._file = self._resources.enter_context(_opened(settings.window_file))
        self._resources.callback(recording.close)

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The window of the next frame once that is due, None at the recording's end.

        Raises:
            SourceTimeout: it is not due within `timeout_s` seconds.
            SourceError: the recording changes its size.
        """
        frame = self._pending()
        if frame is None:
            self.end_reason = self._recording.end_reason
            return None
        delay_s = self._pacer.delay_s(frame.media_time_s * self.fps, self._clock())
        self._wait(min(delay_s, timeout_s))
        if delay_s > timeout_s:
            raise SourceTimeout(f"{self.name}: no frame is due within {timeout_s:g} s")
        self._next = None
        return self._windowed(frame)

    def close(self) -> None:
        """Close recording and window file."""
        self._resources.close()

    def _pending(self) -> Frame | None:
        """The next frame that is not too late."""
        while self._next is None:
            frame = self._recording.read()
            if frame is None:
                return None
            if self._pacer.frames_behind(frame.media_time_s * self.fps, self._clock()) == 0:
                self._next = frame
        return self._next

    def _windowed(self, frame: Frame) -> Frame:
        size = (frame.image.shape[1], frame.image.shape[0])
        if size != (self._recording.width, self._recording.height):
            raise SourceError(
                f"{self.name}: frame {frame.index} is {size[0]}x{size[1]}, the first was "
                f"{self._recording.width}x{self._recording.height}: give pictures of one size"
            )
        now_ns = round(self._clock() * 1e9)
        image = self.window.view(frame.image, frame.index)
        if self._file is not None:
            left, top = self.window.offset_px
            self._file.write(f"{frame.index + 1},{left:.5f},{top:.5f}\n")
        return Frame(image, frame.index, frame.media_time_s, self.width, self.height, now_ns)


def open_pan(spec: str, open_recording: Callable[[str], FrameSource]) -> VirtualPanSource:
    """Open `pan:PATH?key=value&...`; the keys are those of `PanSettings`.

    Args:
        spec: PATH is any recording; if that has a `?` itself, end the spec with another one.
        open_recording: opens PATH.

    Raises:
        SourceError: the recording cannot be opened or is a camera, a key is unknown, or a value
            is out of range.
    """
    path, settings = parse_pan(spec)
    recording = open_recording(path)
    shown = without_passwords(spec)
    try:
        if recording.is_live:
            raise SourceError(
                f"{shown}: a virtual pan needs a recording, {recording.name} is a camera"
            )
        return VirtualPanSource(recording, settings, shown)
    except SourceError:
        recording.close()
        raise


def parse_pan(spec: str) -> tuple[str, PanSettings]:
    """The path of the recording and the settings of the window.

    Raises:
        SourceError: a key is unknown, or a value is out of range.
    """
    text = spec.removeprefix(PAN_PREFIX)
    path, mark, query = text.rpartition("?")
    if not mark:
        path, query = text, ""
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        return path, PanSettings.model_validate(dict(pairs))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        known = ", ".join(PanSettings.model_fields)
        raise SourceError(
            f"{without_passwords(spec)}: {key}={first['input']!r}: {first['msg']}; "
            f"the keys are {known}"
        ) from None
    except ValueError:
        raise SourceError(
            f"{without_passwords(spec)}: give key=value pairs, as in "
            "pan:walk.mp4?width=384&height=288"
        ) from None


def _opened(path: Path) -> TextIO:
    try:
        # Line by line, so that it is whole whenever and however the process ends.
        file = path.open("w", encoding="ascii", buffering=1)
    except OSError as error:
        raise SourceError(f"window_file {path}: {error.strerror}: check the path") from None
    file.write("frame,left_px,top_px\n")
    return file
