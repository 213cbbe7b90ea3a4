"""Frames from a rosbag2 recording (MCAP): one topic of sensor_msgs Image or CompressedImage."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from heel.schemas.errors import HeelError, SourceError
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.source import Frame, FrameSource, Warn, log_warning, plausible_fps
from heel.services.geometry.ros_pictures import Picture, compressed_picture_of, picture_of
from heel.services.recordings.reading import RecordedMessage, Recording

PICTURES: dict[str, Callable[[Any], Picture]] = {
    "sensor_msgs/msg/Image": picture_of,
    "sensor_msgs/msg/CompressedImage": compressed_picture_of,
}
_INTERVALS = 50
"""Frames at the beginning from whose times the rate is told: two seconds. Chosen by hand."""
_MAX_WARNINGS = 10
"""Pictures that cannot be read and are named one by one; chosen by hand."""


class RosbagSource(FrameSource):
    """The pictures of one topic; their times are the stamps of their headers.

    Args:
        path: of the file.
        topics: with pictures, as they were found in it.
        topic: whose pictures; None where there is only one.
        warn: told of every defect.

    Raises:
        SourceError: it cannot be read, or it is not told which topic.
    """

    def __init__(
        self, path: Path, topics: list[str], topic: str | None = None, warn: Warn = log_warning
    ) -> None:
        self.name, self._warn = shown_path(path), warn
        if topic is None and len(topics) > 1:
            raise SourceError(
                f"{self.name}: pictures on {', '.join(topics)} in it: name one, as in "
                f"{self.name}?camera={topics[0]}"
            )
        self._topic = topics[0] if topic is None else topic
        if self._topic not in topics:
            raise SourceError(f"{self.name}: no pictures on {self._topic!r} in it, but on {topics}")
        self._recording = Recording(path)
        self._unreadable, self._why = 0, ""
        stamps_ns = [stamp_ns for stamp_ns, _ in islice(self._pictures(), _INTERVALS)]
        steps_ns = [later - one for one, later in pairwise(stamps_ns) if later > one]
        rate = 1e9 / statistics.median(steps_ns) if steps_ns else 0.0
        self.fps = plausible_fps(rate, self.name, warn)
        first = next(self._pictures(), None)
        if first is None:
            raise SourceError(f"{self.name}: no picture on {self._topic} can be read; {self._why}")
        self._start_ns = first[0]
        self.height, self.width = first[1].shape[:2]
        self._unreadable = 0
        self._left = self._pictures()
        self._next = 0

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next picture, None after the last; a file never times out."""
        for stamp_ns, image in self._left:
            index, self._next = self._next, self._next + 1
            height, width = image.shape[:2]
            return Frame(image, index, (stamp_ns - self._start_ns) * 1e-9, width, height)
        cut = "" if self._recording.complete else ", which is cut off"
        self.end_reason = self.end_reason or f"end of recording{cut}"
        return None

    def close(self) -> None:
        """Stop delivering."""
        self.end_reason = self.end_reason or "closed"
        self._left = iter(())

    def _pictures(self) -> Iterator[tuple[int, Picture]]:
        """Stamp in nanoseconds and pixels of every picture that can be read."""
        decode = _decoder()
        for message in self._recording.messages():
            if message.channel.topic != self._topic or message.schema is None:
                continue
            try:
                said = decode(message)
                image = PICTURES[message.schema.name](said)
                stamp = said.header.stamp
                yield int(stamp.sec) * 10**9 + int(stamp.nanosec), image
            # Of bytes that are not what their schema says, the library raises whatever it meets.
            except Exception as error:
                self._why = str(error)[:200]
                self._unreadable += 1
                if self._unreadable <= _MAX_WARNINGS:
                    self._warn(f"{self.name}: {self._why}; skipped")


def picture_topics(recording: Recording, looked_at: int) -> list[str]:
    """Topics with pictures of ROS among the first messages of a recording.

    Raises:
        SourceError: it cannot be read.
    """
    return sorted({
        one.channel.topic
        for one in islice(recording.messages(), looked_at)
        if one.schema is not None and one.schema.name in PICTURES
    })  # fmt: skip


def _decoder() -> Callable[[RecordedMessage], Any]:
    """From a message to an object with its fields, by the schema in the file.

    Raises:
        HeelError: the library is not installed.
    """
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise HeelError("recordings of ROS need a library: pip install mcap-ros2-support") from None
    factory = DecoderFactory()

    def decode(message: RecordedMessage) -> Any:
        decoder = factory.decoder_for(message.channel.message_encoding, message.schema)
        if decoder is None:
            raise SourceError(f"{message.channel.topic}: no CDR with a schema of ROS's")
        return decoder(message.data)

    return decode
