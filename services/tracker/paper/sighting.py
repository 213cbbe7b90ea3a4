"""A blob as the tracker reads it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs
from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One blob: box in frame pixels, pixels (H, W, 3) uint8 BGR at working size."""

    box: BoxXyxy
    pixels: NDArray[np.uint8]


def sightings_of(blobs: Blobs) -> list[Sighting]:
    """The blobs of a message; whatever order they were sent in, they are looked at in one."""
    found = [
        Sighting(blob.box_xyxy, blob.patch.array())
        for blob in blobs.blobs
        if boxes.area(blob.box_xyxy) > 0
    ]
    return sorted(found, key=lambda sighting: sighting.box)
