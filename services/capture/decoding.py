"""From FFmpeg's packets to pictures: whole frames, upright, 8 bit BGR."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, cast

import av.error
import cv2
import numpy as np
from av.filter import Graph
from av.video.frame import VideoFrame
from av.video.reformatter import Interpolation, VideoReformatter
from numpy.typing import NDArray

from heel.schemas.errors import SourceError

if TYPE_CHECKING:
    from av.packet import Packet
    from av.sidedata.sidedata import SideData
    from av.video.stream import VideoStream

_SERIAL = Fraction(1, 25)
"""Time base inside the filter, where frames carry serial numbers for times."""
_UPRIGHT = (1, 0, 0, 1)
"""Matrix of a picture that is not turned."""


@dataclass(frozen=True, eq=False, slots=True)
class Decoded:
    """One frame out of the decoder, not yet converted.

    Attributes:
        frame: progressive.
        pts_s: its time stamp, seconds on the stream's own clock; None if it has none.
        damaged: the decoder filled in what it could not read.
    """

    frame: VideoFrame
    pts_s: float | None
    damaged: bool


class Decoder:
    """Decodes one stream; interlaced frames come out whole, one for one.

    Args:
        stream: of an open container.
        threads: FFmpeg's thread type: `AUTO` for recordings, `SLICE` where no frame may wait for
            the next.
    """

    def __init__(self, stream: VideoStream, threads: str = "AUTO") -> None:
        self._context = stream.codec_context
        self._time_base = stream.time_base or Fraction(1, 90_000)
        self._context.thread_type = threads
        self._deinterlacer: _Deinterlacer | None = None
        self.damaged_packets = 0
        """Packets so far that could not be decoded."""
        self.cut_packets = 0
        """Packets so far that the container calls incomplete; a seam looks the same."""
        self.last_is_cut = False

    def decode(self, packet: Packet[VideoStream] | None) -> Iterator[Decoded]:
        """What a packet brings forth; None flushes. A packet that cannot be read gives nothing."""
        if packet is not None:
            self.last_is_cut = packet.is_corrupt
            self.cut_packets += packet.is_corrupt
        try:
            frames = self._context.decode(packet)
        except av.error.FFmpegError:
            self.damaged_packets += 1
            return
        for frame in frames:
            assert isinstance(frame, VideoFrame)
            pts_s = None if frame.pts is None else float(frame.pts * self._time_base)
            decoded = Decoded(frame, pts_s, frame.is_corrupt)
            if self._deinterlacer is None and frame.interlaced_frame:
                self._deinterlacer = _Deinterlacer()
            if self._deinterlacer is None:
                yield decoded
            else:
                yield from self._deinterlacer.push(decoded)
        if packet is None and self._deinterlacer is not None:
            yield from self._deinterlacer.flush()

    def reset(self) -> None:
        """Forget everything up to the next key frame."""
        self._context.flush_buffers()
        self._deinterlacer = None


class _Deinterlacer:
    """FFmpeg's bwdif over the frames marked as interlaced; the others pass unchanged.

    https://ffmpeg.org/ffmpeg-filters.html#bwdif. It looks one frame ahead, so each comes out when
    the next goes in.
    """

    def __init__(self) -> None:
        self._graph: Graph | None = None
        self._shape: tuple[int, int, str] | None = None
        self._waiting: deque[Decoded] = deque()
        self._serial = 0

    def push(self, decoded: Decoded) -> Iterator[Decoded]:
        frame = decoded.frame
        shape = (frame.width, frame.height, frame.format.name)
        if shape != self._shape:
            yield from self.flush()
            self._graph, self._shape = _bwdif(frame), shape
        assert self._graph is not None
        frame.pts, frame.time_base = self._serial, _SERIAL
        self._serial += 1
        self._waiting.append(decoded)
        self._graph.push(frame)
        yield from self._pull()

    def flush(self) -> Iterator[Decoded]:
        if self._graph is not None:
            self._graph.push(None)
            yield from self._pull()
        self._graph = self._shape = None
        self._waiting.clear()

    def _pull(self) -> Iterator[Decoded]:
        assert self._graph is not None
        while self._waiting:
            try:
                frame = self._graph.pull()
            except (av.error.BlockingIOError, av.error.EOFError):
                return
            assert isinstance(frame, VideoFrame)
            before = self._waiting.popleft()
            yield Decoded(frame, before.pts_s, before.damaged)


def _bwdif(frame: VideoFrame) -> Graph:
    graph = Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=_SERIAL
    )
    deinterlace = graph.add("bwdif", "mode=send_frame:deint=interlaced")
    sink = graph.add("buffersink")
    source.link_to(deinterlace)
    deinterlace.link_to(sink)
    graph.configure()
    return graph


class Converter:
    """Turns decoded frames into (H, W, 3) uint8 BGR, turned and mirrored as the stream asks.

    Where the resolution changes in mid-stream, frames are scaled to the size of the first.
    """

    def __init__(self) -> None:
        self._reformatter = VideoReformatter()
        self._size: tuple[int, int] | None = None
        self._rotation: int | None = None
        self._matrix = _UPRIGHT

    def image(self, frame: VideoFrame) -> NDArray[np.uint8]:
        """The pixels of a frame, contiguous.

        Raises:
            SourceError: FFmpeg cannot convert its pixel format.
        """
        # PyAV's side data and its frame hold each other: read for every frame, they fill the memory
        # until the collector comes round.
        if frame.rotation != self._rotation:
            self._rotation, self._matrix = frame.rotation, _orientation(frame)
        width, height = self._size = self._size or (frame.width, frame.height)
        try:
            # One thread: for one picture of 1080p more of them cost more than they bring.
            picture = self._reformatter.reformat(
                frame, width, height, "bgr24", interpolation=Interpolation.BICUBIC, threads=1
            )
        except (av.error.FFmpegError, ValueError) as error:
            raise SourceError(
                f"pictures of pixel format {frame.format.name} cannot be converted ({error}); "
                "convert the video with: ffmpeg -i IN -pix_fmt yuv420p OUT.mp4"
            ) from None
        plane = picture.planes[0]
        rows = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)[:height]
        pixels = rows[:, : 3 * width].reshape(height, width, 3)
        return upright(np.ascontiguousarray(pixels), self._matrix)


def upright(image: NDArray[np.uint8], matrix: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Apply the signs of a display matrix (a, b, c, d): x' = a x + c y, y' = b x + d y."""
    if matrix == _UPRIGHT:
        return image
    a, b, c, d = matrix
    horizontal, vertical = a, d
    if b and c:
        image = np.asarray(cv2.transpose(image), np.uint8)
        horizontal, vertical = c, b
    if horizontal < 0 or vertical < 0:
        code = -1 if horizontal < 0 and vertical < 0 else int(horizontal < 0)
        image = np.asarray(cv2.flip(image, code), np.uint8)
    return np.ascontiguousarray(image)


def _orientation(frame: VideoFrame) -> tuple[int, int, int, int]:
    """Signs of the frame's display matrix; upright where it has none or a slanting one."""
    # The stubs know one key of this mapping only.
    data = cast("Mapping[str, SideData]", frame.side_data).get("DISPLAYMATRIX")
    if data is None:
        return _UPRIGHT
    values = np.frombuffer(memoryview(data), np.int32)[[0, 1, 3, 4]].astype(np.float64)
    size = float(np.abs(values).max())
    if size == 0.0:
        return _UPRIGHT
    a, b, c, d = (round(float(value) / size) for value in values)
    straight = (a and d and not (b or c)) or (b and c and not (a or d))
    return (a, b, c, d) if straight else _UPRIGHT
