"""Blobs messages, whatever found the people: head, camera motion, and blobs with their pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, CameraMotion, Patch
from heel.schemas.base import BoxXyxy
from heel.services.detector.background.evidence import Region
from heel.services.detector.interface import Frame
from heel.services.detector.scene import WorkSize
from heel.services.geometry.picture_motion import MotionEstimate

PATCH_BUDGET_BYTES = 700_000
"""For all patches of a message; leaves room for evidence (250 kB) under its cap of 1 MiB."""
_PERSON_PATCH_ROWS = 96
"""Patches of people are reduced to at most this height: enough for the colours of clothes."""


def blobs_message(
    frame: Frame, size: WorkSize, detector: str, blobs: Sequence[Blob],
    motion: MotionEstimate | None, **fields: Any,
) -> Blobs:  # fmt: skip
    """What a detector says of one frame.

    Args:
        frame: the frame.
        size: its size and working size.
        detector: name of the method.
        blobs: in frame pixels.
        motion: of the camera since the frame before, working pixels; None if it stood still.
        fields: of the message, besides.
    """
    source_width, source_height = frame.source_size
    return Blobs(
        **frame.id.frame_id().model_dump(),
        width=size.frame_width,
        height=size.frame_height,
        source_width=source_width,
        source_height=source_height,
        blobs=tuple(blobs),
        camera_motion=camera_motion(motion, size),
        detector=detector,
        **fields,
    )


def camera_motion(motion: MotionEstimate | None, size: WorkSize) -> CameraMotion | None:
    """A motion of working pixels in frame pixels."""
    if motion is None:
        return None
    (xx, xy, x), (yx, yy, y) = motion.affine
    aspect = size.scale_x / size.scale_y
    affine = (xx, xy * aspect, x * size.scale_x, yx / aspect, yy, y * size.scale_y)
    return CameraMotion(affine=affine, quality=motion.quality)


def region_blobs(regions: Sequence[Region], image: NDArray[np.uint8], size: WorkSize) -> list[Blob]:
    """Regions as blobs in frame pixels, each with its patch in working pixels.

    When all patches together exceed the budget, all are shrunk by one common factor.

    Args:
        regions: at most `MAX_BLOBS` regions.
        image: (size.height, size.width, 3) uint8.
        size: the working size.
    """
    total = sum(3 * region.width * region.height for region in regions)
    factor = min(1.0, math.sqrt(PATCH_BUDGET_BYTES / total)) if total else 1.0
    return [
        Blob(
            box_xyxy=size.to_frame((region.left, region.top, region.width, region.height)),
            area_px=region.area * size.scale_x * size.scale_y,
            # A pixel's centre lies half a pixel inside its corner.
            centroid=(
                (region.centroid_x + 0.5) * size.scale_x,
                (region.centroid_y + 0.5) * size.scale_y,
            ),
            patch=_patch(
                image,
                slice(region.top, region.top + region.height),
                slice(region.left, region.left + region.width),
                factor,
            ),
        )
        for region in regions
    ]


def person_blobs(
    people: Sequence[tuple[BoxXyxy, float]], image: NDArray[np.uint8], **fields: Any
) -> list[Blob]:
    """People as blobs.

    Args:
        people: box of each, frame pixels, and score in [0, 1].
        image: (H, W, 3) uint8 BGR, the frame.
        fields: of every blob, besides.
    """
    most_pixels = PATCH_BUDGET_BYTES // (3 * max(1, len(people)))
    return [
        Blob(
            box_xyxy=box,
            area_px=(box[2] - box[0]) * (box[3] - box[1]),
            centroid=((box[0] + box[2]) / 2, (box[1] + box[3]) / 2),
            patch=_person_patch(image, box, most_pixels),
            score=score,
            **fields,
        )
        for box, score in people
    ]


def _person_patch(image: NDArray[np.uint8], box: BoxXyxy, most_pixels: int) -> Patch:
    rows, columns = image.shape[:2]
    left = min(max(0, int(box[0])), columns - 1)
    top = min(max(0, int(box[1])), rows - 1)
    right = min(columns, max(left + 1, round(box[2])))
    bottom = min(rows, max(top + 1, round(box[3])))
    height, width = bottom - top, right - left
    factor = min(1.0, _PERSON_PATCH_ROWS / height, math.sqrt(most_pixels / (height * width)))
    return _patch(image, slice(top, bottom), slice(left, right), factor)


def _patch(image: NDArray[np.uint8], rows: slice, columns: slice, factor: float) -> Patch:
    """The pixels of a picture in these rows and columns, shrunk by a factor of at most 1."""
    pixels = image[rows, columns]
    if factor < 1.0:
        height, width = pixels.shape[:2]
        size = (max(1, int(width * factor)), max(1, int(height * factor)))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    return Patch.from_array(pixels)
