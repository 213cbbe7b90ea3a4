"""The paper's appearance descriptor: seven feature families.

The paper names its families without formulas. The names are those of the focus-measure operators
catalogued by S. Pertuz, D. Puig and M. A. Garcia, "Analysis of focus measure operators for
shape-from-focus", Pattern Recognition 46(5), 2013 (codes in brackets below). Each is computed
on the patch brought to one size and averaged over a grid of cells, so that it says what is where.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Features = dict[str, NDArray[np.float64]]
"""Family name to vector; the same length in every patch."""

WIDTH_PX = 32
"""Pixels to which patches are resized; the paper prints no size. Chosen by hand."""
HEIGHT_PX = 64
"""Pixels likewise: a standing person's box is about twice as high as wide."""
CELL_PX = 16
"""Pixels, side of the cells that are averaged over: two by four of them part head, torso and legs;
chosen by hand."""
BLOCK_PX = 8
"""Pixels, side of the blocks of the DCT: the usual 8, as in JPEG."""
GAUSSIAN_SIGMA_PX = 1.0
"""Pixels: deviation of the Gaussian whose derivatives are taken, which smooths the noise of single
pixels; chosen by hand."""
FAMILIES = (
    "absolute_central_moment",
    "gaussian_derivative",
    "steerable_filters",
    "grey_level_local_variance",
    "energy_of_gradient",
    "dct_energy",
    "energy_of_laplacian",
)

Grey = NDArray[np.float32]


def extract(patch: NDArray[np.uint8]) -> Features:
    """Seven vectors of one number per cell of a (H, W, 3) uint8 BGR patch.

    Energies as log(1 + energy).
    """
    resized = cv2.resize(patch, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(resized, cv2.COLOR_BGR2GRAY).astype(np.float32)
    gradient_x, gradient_y = _gaussian_derivatives(grey)
    vectors = (
        _absolute_central_moment(grey),
        np.log1p(_cell_means(gradient_x**2 + gradient_y**2)),
        np.log1p(_cell_means(_steered(gradient_x, gradient_y))),
        np.log1p(_grey_level_local_variance(grey)),
        np.log1p(_cell_means(_energy_of_gradient(grey))),
        np.log1p(_dct_energy(grey)),
        np.log1p(_cell_means(cv2.Laplacian(grey, cv2.CV_32F) ** 2)),
    )
    return dict(zip(FAMILIES, vectors, strict=True))


def _cells(image: Grey, size: int) -> NDArray[np.float32]:
    """(HEIGHT_PX, WIDTH_PX) to (cells, pixels of a cell), row-major."""
    rows, columns = HEIGHT_PX // size, WIDTH_PX // size
    split = image.reshape(rows, size, columns, size).swapaxes(1, 2)
    return split.reshape(rows * columns, size * size)


def _cell_means(image: NDArray[Any]) -> NDArray[np.float64]:
    cells = _cells(np.asarray(image, np.float32), CELL_PX)
    return np.asarray(cells.mean(axis=1), np.float64)


def _absolute_central_moment(grey: Grey) -> NDArray[np.float64]:
    """Mean absolute deviation of the histogram from its mean, sum |k - mu| p(k) (ACMO)."""
    cells = _cells(grey, CELL_PX).astype(np.float64)
    return np.asarray(np.abs(cells - cells.mean(axis=1, keepdims=True)).mean(axis=1))


def _gaussian_derivatives(grey: Grey) -> tuple[Grey, Grey]:
    """Derivatives of a Gaussian in x and y (GDER: their energy)."""
    smooth = cv2.GaussianBlur(grey, (0, 0), GAUSSIAN_SIGMA_PX)
    gradient_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    gradient_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    return np.asarray(gradient_x, np.float32), np.asarray(gradient_y, np.float32)


def _steered(gradient_x: Grey, gradient_y: Grey) -> NDArray[np.float32]:
    """Largest response of first-order filters steered to eight angles (SFIL)."""
    angles = np.arange(8) * (np.pi / 4)
    responses = [np.cos(angle) * gradient_x + np.sin(angle) * gradient_y for angle in angles]
    return np.asarray(np.max(np.stack(responses), axis=0), np.float32)


def _grey_level_local_variance(grey: Grey) -> NDArray[np.float64]:
    """Variance within each cell of the 3x3 local variance (GLVM)."""
    mean = cv2.blur(grey, (3, 3))
    local = np.asarray(cv2.blur(grey * grey, (3, 3)) - mean * mean, np.float32)
    return np.asarray(_cells(local, CELL_PX).astype(np.float64).var(axis=1))


def _energy_of_gradient(grey: Grey) -> Grey:
    """Squared forward differences (GRAE)."""
    difference_x = np.diff(grey, axis=1, append=grey[:, -1:])
    difference_y = np.diff(grey, axis=0, append=grey[-1:, :])
    return np.asarray(difference_x**2 + difference_y**2, np.float32)


def _dct_energy(grey: Grey) -> NDArray[np.float64]:
    """Energy of the 8x8 DCT without its mean, relative to the mean (DCTE)."""
    ratios = []
    for block in _cells(grey, BLOCK_PX):
        spectrum = cv2.dct(block.reshape(BLOCK_PX, BLOCK_PX)).astype(np.float64)
        mean_energy = spectrum[0, 0] ** 2
        ratios.append(((spectrum**2).sum() - mean_energy) / (mean_energy + 1.0))
    return np.array(ratios)
