"""Frames from a rosbag2 recording: one topic of sensor_msgs Image or CompressedImage.

A bag is an MCAP file or a folder with a file of sqlite3.
"""

from __future__ import annotations

import logging
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Protocol

from heel.schemas.errors import HeelError, SourceError
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.source import Frame, FrameSource, Warn, log_warning, plausible_fps
from heel.services.geometry.ros_pictures import Picture, compressed_picture_of, picture_of
from heel.services.recordings.reading import RecordedMessage, Recording

PICTURES: dict[str, Callable[[Any], Picture]] = {
    "sensor_msgs/msg/Image": picture_of,
    "sensor_msgs/msg/CompressedImage": compressed_picture_of,
}
_log = logging.getLogger(__name__)
_INTERVALS = 50
"""Frames at the beginning from whose times the rate is told: two seconds. Chosen by hand."""
_MAX_WARNINGS = 10
"""Pictures that cannot be read and are named one by one; chosen by hand."""


Decode = Callable[[], Any]
"""Gives a message with its fields; raises whatever the library meets in damaged bytes."""


class Bag(Protocol):
    """A recording of ROS 2, however it is stored.

    Attributes:
        path: of the file, or of the folder.
        topics: with pictures.
    """

    path: Path
    topics: list[str]

    @property
    def complete(self) -> bool:
        """Whether it was closed by its writer; known once it is read to its end."""

    def messages(self, topic: str) -> Iterator[tuple[str, Decode]]:
        """The name of its kind, and the message, of every message of a topic."""


class McapBag:
    """A bag in an MCAP file.

    Args:
        path: of the file.
        looked_at: messages at its beginning in which topics are looked for.

    Raises:
        SourceError: it cannot be read.
    """

    def __init__(self, path: Path, looked_at: int) -> None:
        self.path = path
        self._recording = Recording(path)
        self.topics = sorted({
            one.channel.topic
            for one in islice(self._recording.messages(), looked_at)
            if one.schema is not None and one.schema.name in PICTURES
        })  # fmt: skip

    @property
    def complete(self) -> bool:
        """As of `Bag`."""
        return self._recording.complete

    def messages(self, topic: str) -> Iterator[tuple[str, Decode]]:
        """As of `Bag`."""
        decode = _decoder()
        for message in self._recording.messages():
            if message.channel.topic == topic and message.schema is not None:
                yield message.schema.name, partial(decode, message)


class SqliteBag:
    """A bag in sqlite3, which `ros2 bag record` has made by default for years.

    Args:
        path: of the folder, with its metadata.yaml.

    Raises:
        SourceError: it cannot be read.
        HeelError: the library is not installed.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.complete = path, True
        try:
            with _reader(path) as reader:
                kinds = {(one.topic, one.msgtype) for one in reader.connections}
        except HeelError:
            raise
        # Of damaged files the library, sqlite and its reader of YAML raise whatever they meet.
        except Exception as error:
            words = " ".join(str(error).split())[:200]
            raise SourceError(
                f"{shown_path(path)}: no bag that can be read ({words}): record it anew, or copy "
                "all of its folder"
            ) from None
        self.topics = sorted(topic for topic, kind in kinds if kind in PICTURES)

    def messages(self, topic: str) -> Iterator[tuple[str, Decode]]:
        """As of `Bag`."""
        from rosbags.typesys import Stores, get_typestore

        types = get_typestore(Stores.LATEST)
        try:
            with _reader(self.path) as reader:
                wanted = [one for one in reader.connections if one.topic == topic]
                for connection, _, data in reader.messages(connections=wanted):
                    kind = connection.msgtype
                    yield kind, partial(types.deserialize_cdr, data, kind)
        # As above: what is there up to the damage counts.
        except Exception as error:
            self.complete = False
            _log.warning("%s: %s", shown_path(self.path), error)


def _reader(path: Path) -> Any:
    """The library's reader of a folder, not opened yet.

    Raises:
        HeelError: the library is not installed.
    """
    try:
        from rosbags.rosbag2 import Reader
    except ImportError:
        raise HeelError("bags in sqlite3 need a library: pip install rosbags") from None
    return Reader(path)


class RosbagSource(FrameSource):
    """The pictures of one topic; their times are the stamps of their headers.

    Args:
        bag: that they are in.
        topic: whose pictures; None where there is only one.
        warn: told of every defect.

    Raises:
        SourceError: it cannot be read, or it is not told which topic.
    """

    def __init__(self, bag: Bag, topic: str | None = None, warn: Warn = log_warning) -> None:
        self.name, self._warn = shown_path(bag.path), warn
        topics = bag.topics
        if topic is None and len(topics) > 1:
            raise SourceError(
                f"{self.name}: pictures on {', '.join(topics)} in it: name one, as in "
                f"{self.name}?camera={topics[0]}"
            )
        self._topic = topics[0] if topic is None else topic
        if self._topic not in topics:
            raise SourceError(f"{self.name}: no pictures on {self._topic!r} in it, but on {topics}")
        self._bag = bag
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
        cut = "" if self._bag.complete else ", which is cut off"
        self.end_reason = self.end_reason or f"end of recording{cut}"
        return None

    def close(self) -> None:
        """Stop delivering."""
        self.end_reason = self.end_reason or "closed"
        self._left = iter(())

    def _pictures(self) -> Iterator[tuple[int, Picture]]:
        """Stamp in nanoseconds and pixels of every picture that can be read."""
        for kind, decode in self._bag.messages(self._topic):
            try:
                said = decode()
                image = PICTURES[kind](said)
                stamp = said.header.stamp
                yield int(stamp.sec) * 10**9 + int(stamp.nanosec), image
            # Of bytes that are not what their schema says, the library raises whatever it meets.
            except Exception as error:
                self._why = str(error)[:200]
                self._unreadable += 1
                if self._unreadable <= _MAX_WARNINGS:
                    self._warn(f"{self.name}: {self._why}; skipped")


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
