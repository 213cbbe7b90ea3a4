"""What `--scale`, `--fps` and `--loop` do to a source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from heel.schemas.errors import SourceError
from heel.services.capture.source import MAX_FPS, Frame, FrameSource, SourceStatus
from heel.services.geometry.pixels import scaled_size, shrink


class AdjustedSource(FrameSource):
    """Another source, made smaller and played at another rate.

    Args:
        source: closed with this one.
        scale: factor for both sides, in (0, 1].
        fps: rate in (0, 240] to use in place of a recording's own; a camera keeps its clock and the
            rate that it gives.

    Raises:
        SourceError: a factor or rate out of range.
    """

    def __init__(self, source: FrameSource, scale: float = 1.0, fps: float | None = None) -> None:
        check_adjustment(scale, fps)
        self._source = source
        self._scale = scale
        self.name = source.name
        self.width, self.height = scaled_size(source.width, source.height, scale)
        self._restamp = fps is not None and not source.is_live
        self.fps = fps if fps is not None and self._restamp else source.fps
        self.frame_count, self.is_live = source.frame_count, source.is_live
        self.window = source.window
        self.has_depth, self.camera = source.has_depth, source.camera

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame of the source, scaled."""
        frame = self._source.read(timeout_s)
        if frame is None:
            self.end_reason = self._source.end_reason
            return None
        time_s = frame.index / self.fps if self._restamp else frame.media_time_s
        return replace(frame, image=shrink(frame.image, self._scale), media_time_s=time_s)

    def close(self) -> None:
        """Close the source."""
        self._source.close()

    @property
    def status(self) -> SourceStatus:
        """How the source is doing."""
        return self._source.status


class LoopedSource(FrameSource):
    """A recording played again and again; index and time go on counting.

    Args:
        reopen: opens the recording at its start; called once per pass.
    """

    frame_count = None

    def __init__(self, reopen: Callable[[], FrameSource]) -> None:
        self._reopen = reopen
        self._source = reopen()
        self.name, self.fps = self._source.name, self._source.fps
        self.width, self.height = self._source.width, self._source.height
        self.has_depth, self.camera = self._source.has_depth, self._source.camera
        self._offset, self._offset_s = 0, 0.0
        self._next, self._next_s = 0, 0.0

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame; None only when closed, or when a pass gave no frame at all."""
        frame = self._source.read(timeout_s)
        if frame is None and self._next > self._offset and not self.end_reason:
            self._source.close()
            self._source = self._reopen()
            self._offset, self._offset_s = self._next, self._next_s
            frame = self._source.read(timeout_s)
        if frame is None:
            self.end_reason = self.end_reason or self._source.end_reason
            return None
        index, time_s = self._offset + frame.index, self._offset_s + frame.media_time_s
        self._next, self._next_s = index + 1, time_s + 1.0 / self.fps
        return replace(frame, index=index, media_time_s=time_s)

    def close(self) -> None:
        """Close the recording; it is not played again."""
        self.end_reason = "closed"
        self._source.close()


def check_adjustment(scale: float, fps: float | None) -> None:
    """Refuse a factor or rate out of range.

    Raises:
        SourceError: `scale` outside (0, 1] or `fps` outside (0, 240].
    """
    if not 0.0 < scale <= 1.0:
        raise SourceError(f"scale {scale:g}: give a factor above 0 and at most 1")
    if fps is not None and not 0.0 < fps <= MAX_FPS:
        raise SourceError(f"fps {fps:g}: give a rate above 0 and at most {MAX_FPS:g}")
