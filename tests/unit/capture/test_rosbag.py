"""Bags of ROS 2 as a source of frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap_ros2.writer import Writer

from heel.schemas.errors import SourceError
from heel.services.capture.source import Frame
from heel.services.capture.sources import open_source

_LINE = "=" * 80
_HEADER = (
    f"{_LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{_LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
IMAGE = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
    f"uint32 step\nuint8[] data\n{_HEADER}"
)
COMPRESSED = f"std_msgs/Header header\nstring format\nuint8[] data\n{_HEADER}"
PIXELS = np.random.default_rng(1).integers(0, 256, (6, 24, 32, 3), np.uint8)


def header(seq: int) -> dict[str, Any]:
    return {"stamp": {"sec": 1_790_000_000, "nanosec": 100_000_000 * seq}, "frame_id": "camera"}


def bag(path: Path, *topics: str, compressed: bool = False) -> Path:
    """Six pictures on each topic, ten a second."""
    with path.open("wb") as file:
        writer = Writer(file)
        kind = "sensor_msgs/msg/CompressedImage" if compressed else "sensor_msgs/msg/Image"
        schema = writer.register_msgdef(kind, COMPRESSED if compressed else IMAGE)
        for seq, pixels in enumerate(PIXELS):
            said: dict[str, Any] = {"header": header(seq)}
            if compressed:
                said |= {"format": "png", "data": cv2.imencode(".png", pixels)[1].tobytes()}
            else:
                rgb = np.ascontiguousarray(pixels[..., ::-1])
                said |= {"height": 24, "width": 32, "encoding": "rgb8", "is_bigendian": 0,
                         "step": 96, "data": rgb.tobytes()}  # fmt: skip
            for topic in topics:
                writer.write_message(topic, schema, said, log_time=seq, publish_time=seq)
        writer.finish()
    return path


def frames(spec: Path | str) -> list[Frame]:
    with open_source(str(spec)) as source:
        assert (source.width, source.height) == (32, 24)
        assert source.fps == pytest.approx(10.0)
        return list(iter(source.read, None))


@pytest.mark.parametrize("compressed", [False, True])
def test_pictures_of_a_bag_come_out_with_their_stamps(tmp_path: Path, compressed: bool) -> None:
    found = frames(bag(tmp_path / "a.mcap", "/camera/image", compressed=compressed))
    assert [frame.index for frame in found] == list(range(6))
    assert [frame.media_time_s for frame in found] == pytest.approx([0.1 * n for n in range(6)])
    assert all((frame.image == pixels).all() for frame, pixels in zip(found, PIXELS, strict=True))


def sqlite_bag(path: Path, *topics: str, compressed: bool = False) -> Path:
    """The same as `bag` by another software, in sqlite3."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/CompressedImage" if compressed else "sensor_msgs/msg/Image"
    time, head = (types.types[f"{name}"] for name in (
        "builtin_interfaces/msg/Time", "std_msgs/msg/Header"))  # fmt: skip
    storage = rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(path, version=8, storage_plugin=storage) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, kind, typestore=types)
            for seq, pixels in enumerate(PIXELS):
                stamp = head(time(1_790_000_000, 100_000_000 * seq), "camera")
                if compressed:
                    data = cv2.imencode(".png", pixels)[1].reshape(-1)
                    said = types.types[kind](stamp, "png", data)
                else:
                    rgb = np.ascontiguousarray(pixels[..., ::-1]).reshape(-1)
                    said = types.types[kind](stamp, 24, 32, "rgb8", 0, 96, rgb)
                writer.write(connection, seq + 1, types.serialize_cdr(said, kind))
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_a_bag_in_sqlite_is_a_source_too(tmp_path: Path, compressed: bool) -> None:
    found = frames(sqlite_bag(tmp_path / "bag", "/camera/image", compressed=compressed))
    assert [frame.index for frame in found] == list(range(6))
    assert [frame.media_time_s for frame in found] == pytest.approx([0.1 * n for n in range(6)])
    assert all((frame.image == pixels).all() for frame, pixels in zip(found, PIXELS, strict=True))


def test_of_several_topics_in_sqlite_one_is_named(tmp_path: Path) -> None:
    path = sqlite_bag(tmp_path / "bag", "/left", "/right")
    with pytest.raises(SourceError, match=r"pictures on /left, /right in it: name one, as in"):
        open_source(str(path))
    assert len(frames(f"{path}?camera=/right")) == 6


@pytest.mark.parametrize("damage", ["metadata", "database", "cut"])
def test_a_damaged_bag_in_sqlite_is_one_error_or_what_is_left(tmp_path: Path, damage: str) -> None:
    path = sqlite_bag(tmp_path / "bag", "/camera/image")
    (database,) = path.glob("*.db3")
    if damage == "metadata":
        (path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    elif damage == "database":
        database.write_bytes(b"no database" * 100)
    else:
        database.write_bytes(database.read_bytes()[:9000])
    with pytest.raises(SourceError, match=r"no bag that can be read|no picture on .* can be read"):
        open_source(str(path))


def test_of_several_topics_one_is_named(tmp_path: Path) -> None:
    path = bag(tmp_path / "a.mcap", "/left", "/right")
    with pytest.raises(SourceError, match=r"pictures on /left, /right in it: name one, as in"):
        open_source(str(path))
    assert len(frames(f"{path}?camera=/right")) == 6
    with pytest.raises(SourceError, match="no pictures on '/up' in it"):
        open_source(f"{path}?camera=/up")


def test_the_folder_that_ros_makes_is_a_source(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    path = bag(tmp_path / "a.mcap", "/camera/image")
    assert len(frames(tmp_path)) == 6
    path.rename(tmp_path / "b.mcap")
    bag(tmp_path / "c.mcap", "/camera/image")
    with pytest.raises(SourceError, match=r"2 files in it: give one, such as b\.mcap"):
        open_source(str(tmp_path))
