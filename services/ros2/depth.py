"""Depth of a robot's camera: which picture it is of, and what it shows in the way."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from heel.schemas import CameraInfo, Header, HeelError, RangeSector
from heel.services.geometry.camera import GroundCamera, camera_from_info
from heel.services.geometry.depth import Depth, depth_sectors
from heel.services.geometry.ros_pictures import depth_of

_APART_NS = 40_000_000
"""Stamps of a picture and its depth differ by less [ns]: a period of 25 pictures a second."""
_PICTURES = 8
"""Pictures that depth may still come of: it is computed from them and comes later."""
_ASPECT = 0.02
"""Share by which the shapes of a picture and its depth may differ: rows left out by a rounding."""


def nearest(stamps_ns: Sequence[int], wanted_ns: int) -> int | None:
    """Index of the stamp next to a time, of equal ones the last; None where none is near."""
    apart, index = min(
        ((abs(one - wanted_ns), -at) for at, one in enumerate(stamps_ns)), default=(_APART_NS, 0)
    )
    return -index if apart < _APART_NS else None


def stamp_ns(header: Any) -> int:
    """Of a std_msgs/Header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


class DepthPairs:
    """Finds the picture of each depth image; one that comes first waits for its picture."""

    def __init__(self) -> None:
        self._pictures: deque[tuple[int, Header]] = deque(maxlen=_PICTURES)
        self._waiting: Any = None

    def picture(self, ros_header: Any, header: Header) -> None:
        """Remember a picture that was sent.

        Args:
            ros_header: std_msgs/Header that it came with.
            header: that it was sent with.
        """
        self._pictures.append((stamp_ns(ros_header), header))

    def depth(self, message: Any) -> tuple[Header, Depth] | None:
        """Header of the picture, and the depth of it; None while there is none.

        Args:
            message: sensor_msgs/Image that has come, None: none has.

        Raises:
            HeelError: it cannot be read, or does not show what the picture shows.
        """
        message, self._waiting = message or self._waiting, None
        if message is None:
            return None
        index = nearest([one for one, _ in self._pictures], stamp_ns(message.header))
        if index is None:
            self._waiting = message
            return None
        _, header = self._pictures[index]
        del self._pictures[index]
        depth_mm = depth_of(message)
        height, width = depth_mm.shape
        shape = (width / height) / (header.width / header.height)
        if abs(shape - 1.0) > _ASPECT:
            raise HeelError(
                f"depth of {width}x{height} is not aligned to pictures of {header.width}x"
                f"{header.height}: name the topic of aligned depth"
            )
        return header, depth_mm


def obstacles(depth_mm: Depth, info: CameraInfo) -> tuple[RangeSector, ...] | None:
    """What a depth picture shows in the way; None where the camera's mounting is not known."""
    camera = camera_from_info(info)
    return depth_sectors(depth_mm, camera) if isinstance(camera, GroundCamera) else None
