"""Frames of a recorded video, through FFmpeg: of a file, or of one that a server holds."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import av.error

from heel.schemas.errors import SourceError
from heel.services.capture.decoding import Converter, Decoded, Decoder
from heel.services.capture.ffmpeg import CONVERT, open_file, reason, shown_path, video_stream
from heel.services.capture.read_ahead import ReadAhead
from heel.services.capture.source import Frame, FrameSource, Warn, log_warning, plausible_fps

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.packet import Packet
    from av.video.stream import VideoStream

_LONGEST_GAP_S = 86_400.0
"""A time stamp that leaps by more than a day is a defect, not a pause."""
_SLACK_FRAMES = 2.0
"""Frames that may be missing at the end of a healthy file; chosen by hand."""
_SLACK_S = 0.2
"""What may be missing at the end of a healthy file: containers round durations."""


class RecordedVideo(FrameSource):
    """A finished video, frame after frame, each at its own time stamp.

    `Frame.index` counts the frames as they come; where damage swallowed some, it leaves their
    numbers out, as far as the time stamps tell. What can be decoded around a damage is delivered;
    `end_reason` then says what is missing.

    Args:
        container: is closed with this source.
        name: for people.
        warn: told of every defect.
        fps: rate to go by in place of the stream's own time stamps.
        read_timeout_s: of the container where that is at the end of a network: it is then read
            ahead in a thread of its own, and `read` keeps its deadline.
        stop: ends the wait for the first frame at once.

    Raises:
        SourceError: there is no video in it that FFmpeg can decode.
    """

    def __init__(
        self,
        container: InputContainer,
        name: str,
        warn: Warn = log_warning,
        fps: float | None = None,
        read_timeout_s: float | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        self.name = name
        self._warn = warn
        self._container: InputContainer | None = container
        self._first: Frame | None = None
        self._ahead: ReadAhead | None = None
        try:
            stream = video_stream(container, name)
            self._decoder = Decoder(stream)
            self._converter = Converter()
            self._codec = stream.codec_context.name
            self.fps = _rate(stream, name, warn) if fps is None else fps
            self._timeline = None if fps is not None else _Timeline(1.0 / self.fps)
            self._announced = _announced(container, stream, self.fps)
            self.frame_count = self._announced.frames
            self._packets: Iterator[Packet[VideoStream]] = container.demux(stream)
            if read_timeout_s is not None:
                self._packets = self._ahead = ReadAhead(container, stream, stop)
            self._ready: deque[Decoded] = deque()
            self._at_end = False
            self._index = self._count = self._left_out = 0
            self._problem = ""
            self._end_s = 0.0
            self._shape: tuple[int, int] | None = None
            # The first frame is decoded here: a file may have a good header and nothing behind it,
            # and the header's size is that of the container, which a display matrix may turn.
            self._first = self._advance()
            if self._first is None:
                raise SourceError(self._nothing_decoded())
        except BaseException:
            self.close()
            raise
        self.width, self.height = self._first.source_width, self._first.source_height

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame, None at the end.

        Raises:
            SourceTimeout: a recording at the end of a network gave nothing for so long.
        """
        frame, self._first = self._first, None
        if self._ahead is not None:
            self._ahead.timeout_s = timeout_s
        if frame is None:
            frame = self._advance()
        if frame is None and not self.end_reason:
            self.end_reason = self._judge_end()
        return frame

    def close(self) -> None:
        """Close the recording."""
        self._first = None
        if self._container is not None:
            if self._ahead is None:
                self._container.close()
            else:
                self._ahead.close()
            self._container = None
            self.end_reason = self.end_reason or "closed"

    def _advance(self) -> Frame | None:
        decoded = self._next_decoded()
        if decoded is None:
            return None
        image = self._converter.image(decoded.frame)
        height, width = image.shape[:2]
        skipped = 0
        if self._timeline is None:
            media_time_s = self._count / self.fps
        else:
            media_time_s, passed_s = self._timeline.place(decoded.pts_s)
            if self._decoder.damaged_packets or self._decoder.cut_packets:
                skipped = max(0, round(passed_s * self.fps) - 1)
        self._index += skipped
        self._left_out += skipped
        frame = Frame(image, self._index, media_time_s, width, height)
        self._index += 1
        self._count += 1
        self._end_s = media_time_s + 1.0 / self.fps
        return frame

    def _next_decoded(self) -> Decoded | None:
        while not self._ready and not self._at_end and self._container is not None:
            try:
                packet = next(self._packets, None)
            except (av.error.FFmpegError, ValueError) as error:
                self._problem, packet = reason(error), None
            self._at_end = packet is None or not packet.size
            self._ready.extend(self._decoder.decode(None if self._at_end else packet))
        return self._ready.popleft() if self._ready and self._container is not None else None

    def _nothing_decoded(self) -> str:
        why = f" ({self._problem})" if self._problem else ""
        return (
            f"{self.name}: no frame of its {self._codec} video can be decoded{why}; the file is "
            f"damaged or truncated: copy it again, or {CONVERT}"
        )

    def _judge_end(self) -> str:
        damaged = self._decoder.damaged_packets + self._decoder.last_is_cut
        if self._left_out:
            damaged = max(damaged, self._left_out)
        if not self._cut_off() and not damaged and not self._problem:
            return "end of file"
        of = f" of {self._announced.frames}" if self._announced.frames else ""
        why = f" ({self._problem})" if self._problem else ""
        places = f", {damaged} damaged on the way" if damaged else ""
        said = (
            f"{self.name}: ended after {self._count}{of} frames at {self._end_s:.1f} s{places}"
            f"{why}; the file is damaged or truncated, copy or convert it again"
        )
        self._warn(said)
        return said

    def _cut_off(self) -> bool:
        """Whether frames are missing at the end, by number and by time."""
        frames, duration_s = self._announced.frames, self._announced.duration_s
        if frames is not None and self._index >= frames - 1:
            return False
        if duration_s is None or self._timeline is None:
            return frames is not None
        return duration_s - self._end_s > max(_SLACK_S, _SLACK_FRAMES / self.fps)


class VideoFileSource(RecordedVideo):
    """A video file.

    Raises:
        SourceError: the file is missing, empty or holds no video that FFmpeg can decode.
    """

    def __init__(self, path: Path, warn: Warn = log_warning, fps: float | None = None) -> None:
        super().__init__(open_file(path), shown_path(path), warn, fps)


@dataclass(frozen=True)
class _Announced:
    """What the container says of the stream; None where it says nothing that can be trusted."""

    frames: int | None
    duration_s: float | None


def _announced(container: InputContainer, stream: VideoStream, fps: float) -> _Announced:
    # Edit lists, which phones and cuts without coding write, leave packets out from display.
    left_out = sum(entry.is_discard for entry in stream.index_entries) if stream.frames else 0
    frames = stream.frames - left_out if stream.frames > left_out else None
    if stream.duration is not None and stream.time_base is not None:
        # FFmpeg shortens the duration of an AVI to what the file has room for.
        whole_s = 0.0 if frames is None else frames / fps
        return _Announced(frames, max(whole_s, float(stream.duration * stream.time_base)))
    # The container's duration is that of its longest stream, sound perhaps.
    if container.duration is not None and len(container.streams) == 1:
        return _Announced(frames, container.duration / av.time_base)
    return _Announced(frames, None)


def _rate(stream: VideoStream, name: str, warn: Warn) -> float:
    return plausible_fps(float(stream.guessed_rate or 0.0), name, warn)


class _Timeline:
    """Time stamps as seconds since the first frame, which never stand still or go back.

    Where the stream's clock starts anew, as in recordings put one behind the other, its next frame
    follows the last at the nominal period.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._offset_s = 0.0
        self._last_s: float | None = None

    def place(self, pts_s: float | None) -> tuple[float, float]:
        """The frame's time, and how long after the last frame that is; seconds."""
        if self._last_s is None:
            self._last_s = 0.0
            self._offset_s = 0.0 if pts_s is None else -pts_s
            return 0.0, 0.0
        last_s = self._last_s
        time_s = last_s + self._period_s if pts_s is None else pts_s + self._offset_s
        if not last_s < time_s <= last_s + _LONGEST_GAP_S:
            time_s = last_s + self._period_s
            self._offset_s = time_s - (pts_s or 0.0)
        self._last_s = time_s
        return time_s, time_s - last_s
