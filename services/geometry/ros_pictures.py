"""Pictures of ROS, live or from a recording, to pixels. Messages are taken by their fields."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import HeelError
from heel.schemas.base import MAX_DIMENSION_PX

Picture = NDArray[np.uint8]

_TO_BGR: dict[str, tuple[int, int | None]] = {
    "bgr8": (3, None), "8UC3": (3, None), "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR), "8UC4": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR), "mono8": (1, cv2.COLOR_GRAY2BGR),
    "8UC1": (1, cv2.COLOR_GRAY2BGR), "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2), "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
}  # fmt: skip
"""By encoding: bytes a pixel, and OpenCV's conversion."""


def picture_of(message: Any) -> Picture:
    """The pixels (H, W, 3) BGR of a sensor_msgs/Image.

    Raises:
        HeelError: an encoding that is not read, or sizes that do not fit the data.
    """
    known = _TO_BGR.get(str(message.encoding))
    if known is None:
        raise HeelError(
            f"image encoding {str(message.encoding)[:40]!r} is not read: let the camera publish "
            f"one of {', '.join(sorted(_TO_BGR))}, or use its compressed topic"
        )
    depth, conversion = known
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(message.data, np.uint8)
    sized = 0 < width <= MAX_DIMENSION_PX and 0 < height <= MAX_DIMENSION_PX
    if not sized or step < width * depth or len(data) < height * step:
        raise HeelError(
            f"image of {width}x{height} {message.encoding} with a step of {step} bytes has "
            f"{len(data)} bytes: it is cut or not of that kind"
        )
    rows = data[: height * step].reshape(height, step)[:, : width * depth]
    pixels = np.ascontiguousarray(rows).reshape(height, width, depth)
    if conversion is None:
        return pixels
    return np.asarray(cv2.cvtColor(pixels, conversion), np.uint8)


_DEPTHS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Encodings of depth: millimetres, and metres (REP 118)."""


def depth_of(message: Any) -> NDArray[np.uint16]:
    """The depth picture (H, W) uint16 mm of a sensor_msgs/Image, 0 for no measurement (REP 118).

    Raises:
        HeelError: an encoding that is not read, or sizes that do not fit the data.
    """
    kind = _DEPTHS.get(str(message.encoding))
    if kind is None:
        raise HeelError(
            f"depth encoding {str(message.encoding)[:40]!r} is not read: let the camera publish "
            "16UC1 (mm) or 32FC1 (m), not compressed"
        )
    order = np.dtype((">" if message.is_bigendian else "<") + kind)
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(message.data, np.uint8)
    sized = 0 < width <= MAX_DIMENSION_PX and 0 < height <= MAX_DIMENSION_PX
    if not sized or step < width * order.itemsize or len(data) < height * step:
        raise HeelError(
            f"depth of {width}x{height} {message.encoding} with a step of {step} bytes has "
            f"{len(data)} bytes: it is cut or not of that kind"
        )
    rows = data[: height * step].reshape(height, step)[:, : width * order.itemsize]
    values = np.ascontiguousarray(rows).view(order)
    if order.kind == "u":
        return values.astype(np.uint16)
    with np.errstate(invalid="ignore", over="ignore"):
        there = (values > 0) & (values < np.iinfo(np.uint16).max / 1000)
        return np.where(there, np.rint(np.where(there, values, 0) * 1000), 0).astype(np.uint16)


def compressed_picture_of(message: Any) -> Picture:
    """The pixels of a sensor_msgs/CompressedImage.

    Raises:
        HeelError: it is no JPEG or PNG of a size that can be.
    """
    data = np.frombuffer(message.data, np.uint8)
    pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if pixels is None or max(pixels.shape[:2]) > MAX_DIMENSION_PX:
        raise HeelError(
            f"compressed image of {len(data)} bytes, format {str(message.format)[:40]!r}, is no "
            "JPEG or PNG"
        )
    return np.asarray(pixels, np.uint8)
