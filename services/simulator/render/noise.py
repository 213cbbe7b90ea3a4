"""Seeded noise that repeats without a seam, the raw material of every texture."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
"""(H, W, 3) RGB, or (H, W, 4) with alpha; top row first."""
Field = NDArray[np.float32]
"""(H, W) or (H, W, 3)."""


def clouds(rng: np.random.Generator, size: tuple[int, int], cells: int, octaves: int = 5) -> Field:
    """(H, W) noise of mean 0 and deviation 1: octaves of smooth random grids, seamless.

    Args:
        rng: source of randomness.
        size: height and width, pixels.
        cells: of the coarsest grid along the shorter side.
        octaves: each twice as fine and half as strong as the one before.
    """
    total = np.zeros(size, np.float32)
    shorter = min(size)
    for octave in range(octaves):
        count = cells << octave
        if count > shorter:
            break
        rows, columns = count * size[0] // shorter, count * size[1] // shorter
        total += _smooth(rng.standard_normal((rows, columns)), size) * np.float32(0.55**octave)
    return np.asarray((total - total.mean()) / max(float(total.std()), 1e-6), np.float32)


def streaks(rng: np.random.Generator, size: tuple[int, int], across: int, along: int) -> Field:
    """(H, W) noise drawn out along the rows, as in wood: cells `across` and `along`."""
    field = _smooth(rng.standard_normal((across, along)), size)
    return np.asarray((field - field.mean()) / max(float(field.std()), 1e-6), np.float32)


def _smooth(grid: NDArray[np.float64], size: tuple[int, int]) -> Field:
    """A grid enlarged to a size; two wrapped cells around it keep the seams invisible."""
    rows, columns = grid.shape
    wrapped = np.pad(grid, 2, mode="wrap").astype(np.float32)
    scale_y, scale_x = size[0] / rows, size[1] / columns
    into = np.array([[1 / scale_x, 0, 2 - 0.5], [0, 1 / scale_y, 2 - 0.5]], np.float64)
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(wrapped, into, (size[1], size[0]), flags=flags), np.float32)


def coloured(base: tuple[float, float, float], *layers: tuple[Field, tuple[float, float, float]]
             ) -> Picture:  # fmt: skip
    """A picture from a base colour and fields that shift it by so much per deviation."""
    height, width = layers[0][0].shape
    total = np.broadcast_to(np.asarray(base, np.float32), (height, width, 3)).copy()
    for field, shift in layers:
        total += field[..., None] * np.asarray(shift, np.float32)
    return np.clip(total, 0, 255).astype(np.uint8)


def grey(level: float) -> tuple[float, float, float]:
    """The same in all channels."""
    return level, level, level
