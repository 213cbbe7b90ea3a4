"""Which foreground is only a shadow on the background."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_BRIGHTEST = 0.97


def is_shadow(
    pixels: NDArray[np.float32], means: NDArray[np.float32], darkest: float, chroma2: float
) -> NDArray[np.bool_]:
    """Darker than the background and of the same chromaticity, (N,).

    T. Horprasert, D. Harwood, L. Davis, "A statistical approach for real-time robust background
    subtraction and shadow detection", ICCV 1999.

    Args:
        pixels: (N, 3) colours.
        means: (N, 3) colours of the background there.
        darkest: least share of the background's brightness.
        chroma2: largest squared distance from the background's own colour, grey levels squared.
    """
    norm = np.einsum("ij,ij->i", means, means) + 1.0
    ratio = np.einsum("ij,ij->i", pixels, means) / norm
    residual = pixels - ratio[:, None] * means
    distance2 = np.einsum("ij,ij->i", residual, residual)
    darker = (ratio > darkest) & (ratio < _BRIGHTEST)
    return np.asarray(darker & (distance2 < chroma2), np.bool_)
