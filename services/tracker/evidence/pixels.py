"""The picture under the evidence, as far as a message carries it."""

from __future__ import annotations

import cv2
import numpy as np

from heel.schemas import Blobs
from heel.services.tracker.evidence.arrays import Image


def painted(blobs: Blobs, evidence: Image) -> Image:
    """The blobs' pixels where they were cut out, (H, W, 3) uint8 at working size, else black."""
    rows, columns = evidence.shape
    picture = np.zeros((rows, columns, 3), np.uint8)
    for blob in blobs.blobs:
        patch = blob.patch.array()
        left = round(max(0.0, blob.box_xyxy[0]) * columns / blobs.width)
        top = round(max(0.0, blob.box_xyxy[1]) * rows / blobs.height)
        width = max(1, round((blob.box_xyxy[2] - blob.box_xyxy[0]) * columns / blobs.width))
        height = max(1, round((blob.box_xyxy[3] - blob.box_xyxy[1]) * rows / blobs.height))
        if patch.shape[:2] != (height, width) and width <= columns and height <= rows:
            # A crowded message carries its pixels shrunk, see services/detector/packing.py.
            patch = np.asarray(cv2.resize(patch, (width, height)), np.uint8)
        place = picture[top : top + patch.shape[0], left : left + patch.shape[1]]
        place[:] = patch[: place.shape[0], : place.shape[1]]
    return picture
