"""Frames from an MCAP file: one camera of a recording of `heel record`, or a topic of a rosbag."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heel.schemas import CameraInfo, Header, MessageError, decode
from heel.schemas.errors import SourceError
from heel.schemas.image import DEPTH, decode_depth, decode_image
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.rosbag import McapBag, RosbagSource, SqliteBag
from heel.services.capture.source import (
    DEFAULT_FPS,
    Frame,
    FrameSource,
    Warn,
    log_warning,
    plausible_fps,
)
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage

RECORDING_SUFFIX = ".mcap"
CAMERA_OPTION = "?camera="
_LOOKED_AT = 20_000
"""Messages at the beginning in which cameras are looked for: those of a minute. Chosen by hand."""
_ENOUGH_BYTES = 32 << 20
"""Of the file, after which no further camera is looked for: a second of raw frames. Chosen by
hand."""
_WALL_CLOCK_NS = 946_684_800 * 10**9
"""The year 2000: wall clocks are past it, and media times, which count from 0, are not."""
_LOOK_AHEAD = 12
"""Frames that are read on for the depth of one, which comes later than its picture: as many as a
live tracker keeps depth for."""
_MAX_WARNINGS = 10
"""Pictures that cannot be read and are named one by one; chosen by hand."""


class RecordingSource(FrameSource):
    """The frames of one camera, with the numbers that they had, and depth where it was recorded.

    Raw frames of a live run of a recording, or of a lossless run, give the same tracks as they did
    then. Of a camera the times are those at which the pictures were taken.

    Args:
        path: of the file, which may be cut off at its end.
        camera: whose frames; None where there is only one.
        warn: told of every defect.

    Raises:
        SourceError: it cannot be read, or holds no frames of that camera.
    """

    def __init__(self, path: Path, camera: str | None = None, warn: Warn = log_warning) -> None:
        self.name = shown_path(path)
        self._warn = warn
        self._recording = Recording(path)
        cameras, infos, depths = _cameras(self._recording)
        self._key = _chosen(self.name, cameras, camera)
        first = cameras[self._key]
        info = infos.get(first.stream)
        self.width, self.height = first.width, first.height
        self.fps = DEFAULT_FPS if info is None else plausible_fps(info.fps, self.name, warn)
        # Of a folder or scene that was played live, the file has the times of the playing.
        self._own_timeline = info is not None and info.frame_count is not None
        self._depth_key = depths.get(first.stream)
        self.has_depth = self._depth_key is not None
        # Distances by depth need the lens; without depth nothing rests on what was said of it.
        self.camera = info if self.has_depth else None
        self._messages = wire_messages(self._recording)
        self._waiting: deque[tuple[Header, WireMessage]] = deque()
        self._depths: deque[tuple[Header, WireMessage]] = deque(maxlen=_LOOK_AHEAD)
        self._epoch: int | None = None
        self._offset = 0
        self._offset_s = 0.0
        self._next, self._next_s = 0, 0.0
        self._start_ns = 0
        self._unreadable = 0
        self._closed = False

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame, None after the last; a file never times out."""
        while not self._closed and self._fill():
            header, message = self._waiting.popleft()
            try:
                image = decode_image(message.payload, header, message.encoding)
            except MessageError as error:
                self._skip(str(error))
                continue
            return self._frame(header, image)
        self.end_reason = self.end_reason or self._why_over()
        return None

    def close(self) -> None:
        """Stop delivering."""
        self._closed = True
        self.end_reason = self.end_reason or "closed"
        self._messages = iter(())

    def _fill(self) -> bool:
        """Read on until the next frame can be told with its depth; False at the end."""
        while not (self._waiting and self._is_ready(self._waiting[0][0])):
            message = next(self._messages, None)
            if message is None:
                return bool(self._waiting)
            picture = message.key == self._key and message.encoding.startswith("image/")
            if not picture and (message.key, message.encoding) != (self._depth_key, DEPTH):
                continue
            try:
                header = decode(Header, message.attachment or b"")
            except MessageError as error:
                self._skip(str(error))
                continue
            (self._waiting if picture else self._depths).append((header, message))
        return True

    def _is_ready(self, frame: Header) -> bool:
        """Whether the depth of a frame is there, or is not to be expected any more."""
        if not self.has_depth or len(self._waiting) > _LOOK_AHEAD:
            return True
        return any(one.epoch == frame.epoch and one.seq >= frame.seq for one, _ in self._depths)

    def _depth_of(self, frame: Header) -> NDArray[np.uint16] | None:
        """The depth of a frame; what is of no further use is forgotten: numbers may start anew."""
        depth_mm = None
        for one in list(self._depths):
            header, message = one
            if header.epoch != frame.epoch or header.seq > frame.seq:
                continue
            self._depths.remove(one)
            if header.seq == frame.seq:
                try:
                    depth_mm = decode_depth(message.payload, header, message.encoding)
                except MessageError as error:
                    self._skip(str(error))
        return depth_mm

    def _frame(self, header: Header, image: NDArray[np.uint8]) -> Frame:
        if header.epoch != self._epoch:
            # Another start of the camera counts from 0 again; a source goes on counting.
            if self._epoch is None:
                self._start_ns = header.t_capture_ns
            else:
                self._offset = self._next - header.index
                self._offset_s = self._next_s - header.t_capture_ns * 1e-9
            self._epoch = header.epoch
        index = header.index + self._offset
        time_s = self._time_s(header, index)
        self._next, self._next_s = index + 1, time_s + 1.0 / self.fps
        return Frame(
            image, index, time_s, header.source_width, header.source_height,
            depth_mm=self._depth_of(header),
        )  # fmt: skip

    def _time_s(self, header: Header, index: int) -> float:
        if header.t_capture_ns < _WALL_CLOCK_NS:
            return header.t_capture_ns * 1e-9 + self._offset_s
        if self._own_timeline:
            return index / self.fps
        return (header.t_capture_ns - self._start_ns) * 1e-9

    def _skip(self, why: str) -> None:
        self._unreadable += 1
        if self._unreadable <= _MAX_WARNINGS:
            self._warn(f"{self.name}: {why}; skipped")

    def _why_over(self) -> str:
        parts = ["end of recording"]
        if not self._recording.complete:
            parts.append("which is cut off")
        if self._unreadable:
            parts.append(f"{self._unreadable} pictures unreadable")
        return ", ".join(parts)


def open_recording(spec: str, warn: Warn = log_warning) -> FrameSource:
    """Open `FILE.mcap` or `FILE.mcap?camera=NAME`, of Heel's or of ROS, where it is a topic's name.

    A bag of ROS in sqlite3 is a folder.

    Raises:
        SourceError: as `RecordingSource` and `RosbagSource`.
    """
    name, _, camera = spec.partition(CAMERA_OPTION)
    path = Path(name)
    if path.is_dir():
        bag = SqliteBag(path)
        if not bag.topics:
            raise SourceError(f"{shown_path(path)}: a bag without pictures")
        return RosbagSource(bag, camera or None, warn)
    if (recorded := McapBag(path, _LOOKED_AT)).topics:
        return RosbagSource(recorded, camera or None, warn)
    return RecordingSource(path, camera or None, warn)


def bag_in(folder: Path) -> Path | None:
    """The bag in a folder that rosbag2 has made; None if it is no such folder.

    That is its one MCAP file, or the folder itself if its files are of sqlite3.

    Raises:
        SourceError: it holds several files of MCAP.
    """
    if not (folder / "metadata.yaml").is_file():
        return None
    name, files = shown_path(folder), sorted(folder.glob("*.mcap"))
    if not files and any(folder.glob("*.db3")):
        return folder
    if len(files) > 1:
        raise SourceError(f"{name}: {len(files)} files in it: give one, such as {files[0].name}")
    return files[0] if files else None


def names_recording(spec: str) -> bool:
    """Whether a source is a recording of the bus, by its name."""
    return spec.partition(CAMERA_OPTION)[0].lower().endswith(RECORDING_SUFFIX)


def _cameras(
    recording: Recording,
) -> tuple[dict[str, Header], dict[str, CameraInfo], dict[str, str]]:
    """The first header of each image topic by its key, and by the names of cameras what they say
    and the key of their depth."""
    headers: dict[str, Header] = {}
    infos: dict[str, CameraInfo] = {}
    depths: dict[str, str] = {}
    for message in islice(wire_messages(recording), _LOOKED_AT):
        with suppress(MessageError):
            if message.encoding == DEPTH:
                depths.setdefault(decode(Header, message.attachment or b"").stream, message.key)
            elif message.encoding.startswith("image/") and message.key not in headers:
                headers[message.key] = decode(Header, message.attachment or b"")
            elif message.encoding == CameraInfo.encoding():
                info = decode(CameraInfo, message.payload, message.encoding)
                infos.setdefault(info.stream, info)
        told = all(one.stream in infos for one in headers.values())
        if headers and told and recording.whole_bytes > _ENOUGH_BYTES:
            break
    return headers, infos, depths


def _chosen(name: str, cameras: dict[str, Header], camera: str | None) -> str:
    """The key whose frames are read: raw ones where a camera has both.

    Raises:
        SourceError: there is none, or it is not told which.
    """
    names = sorted({header.stream for header in cameras.values()})
    if not names:
        raise SourceError(
            f"{name}: no frames in it: record with --frames jpeg or --frames raw while a camera "
            "runs"
        )
    if camera is None and len(names) > 1:
        raise SourceError(
            f"{name}: frames of {', '.join(names)} in it: name one, as in "
            f"{name}{CAMERA_OPTION}{names[0]}"
        )
    wanted = names[0] if camera is None else camera
    keys = [key for key, header in cameras.items() if header.stream == wanted]
    if not keys:
        raise SourceError(f"{name}: no frames of camera {wanted!r} in it, but of {names}")
    return min(keys, key=lambda key: cameras[key].image_encoding != "image/raw;bgr8")
