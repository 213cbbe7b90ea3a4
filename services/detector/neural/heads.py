"""What the numbers that come out of a detection network mean.

YOLOX (Z. Ge et al., "YOLOX: Exceeding YOLO series in 2021") gives one row per grid cell: offset,
logarithmic size, objectness, class scores; some exports have decoded offset and size already.
YOLOv8-style networks give one column per grid cell: centre, size and class scores, decoded.
Both have cells of 8, 16 and 32 pixels, and the class `person` first (COCO).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from schemas.errors import SettingsError

Floats = NDArray[np.float32]
HeadName = Literal["yolox", "yolox-decoded", "yolov8"]
STRIDES = (8, 16, 32)
_RAW_OFFSET_LIMIT = 16.0
"""Offsets within a cell stay far below this, positions in a picture go far beyond it."""


@dataclass(frozen=True)
class InputForm:
    """How a network wants its pixels.

    Attributes:
        scale: factor on 0 to 255.
        rgb: red first instead of blue first.
    """

    scale: float
    rgb: bool


FORMS: dict[HeadName, InputForm] = {
    "yolox": InputForm(1.0, False),
    "yolox-decoded": InputForm(1.0, False),
    "yolov8": InputForm(1.0 / 255.0, True),
}


def cells(width: int, height: int) -> int:
    """Number of grid cells of an input of this size."""
    return sum((width // stride) * (height // stride) for stride in STRIDES)


def recognise(output: Floats, width: int, height: int) -> HeadName:
    """Which head made the output of a probe.

    Args:
        output: (1, N, 5 + classes) or (1, 4 + classes, N).
        width: of the input, pixels.
        height: of the input, pixels.

    Raises:
        SettingsError: neither fits.
    """
    count = cells(width, height)
    if output.ndim == 3 and output.shape[1] == count and output.shape[2] >= 6:
        decoded = float(np.abs(output[0, :, :2]).max()) > _RAW_OFFSET_LIMIT
        return "yolox-decoded" if decoded else "yolox"
    if output.ndim == 3 and output.shape[2] == count and output.shape[1] >= 5:
        return "yolov8"
    shape = "x".join(str(side) for side in output.shape)
    raise SettingsError(
        f"an output of {shape} for an input of {width}x{height} is neither YOLOX's "
        f"(1x{count}x(5+classes)) nor YOLOv8's (1x(4+classes)x{count}): export the network "
        "without its own non-maximum suppression"
    )


def people(output: Floats, head: HeadName, width: int, height: int) -> tuple[Floats, Floats]:
    """Boxes (N, 4) xyxy in input pixels and scores (N,) in [0, 1] of the class `person`."""
    if head == "yolov8":
        columns = output[0].T
        return _corners(columns[:, :2], columns[:, 2:4]), columns[:, 4]
    rows = output[0]
    centre, size = rows[:, :2], rows[:, 2:4]
    if head == "yolox":
        corner, stride = _grid(width, height)
        centre, size = (centre + corner) * stride, np.exp(np.minimum(size, 12.0)) * stride
    return _corners(centre, size), rows[:, 4] * rows[:, 5]


def _corners(centre: Floats, size: Floats) -> Floats:
    return np.concatenate([centre - 0.5 * size, centre + 0.5 * size], axis=1)


def _grid(width: int, height: int) -> tuple[Floats, Floats]:
    """Left upper corner (in cells) and stride of every grid cell, (N, 2) and (N, 1)."""
    corners, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        corners.append(np.stack([x.ravel(), y.ravel()], axis=1))
        strides.append(np.full((x.size, 1), stride))
    return (
        np.concatenate(corners).astype(np.float32),
        np.concatenate(strides).astype(np.float32),
    )
