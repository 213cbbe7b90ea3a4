"""A standing person as a soft silhouette, and what it says about foreground evidence.

With T the probability that the person covers a pixel and Q that clutter does, the pixel is
foreground with probability 1 - (1 - Q)(1 - T), a noisy-OR (J. Pearl 1988). The log-likelihood
ratio against clutter alone is linear in the evidence, so a search over positions is a correlation
(after the occupancy maps of F. Fleuret et al., "Multicamera people tracking with a probabilistic
occupancy map", PAMI 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from heel.services.geometry.silhouette import LEGS_OF_WALKERS, Outline
from heel.services.tracker.evidence.arrays import FloatMap

CLUTTER = 0.05
"""Probability that a pixel is foreground although no person is there; chosen by hand."""
_COVER = 0.9
"""Probability that a pixel well inside the silhouette is foreground; chosen by hand."""
_EDGE = 0.07
"""Widths: softness of the sides, for arms swing and legs part; chosen by hand."""

_OUTLINE = Outline(LEGS_OF_WALKERS, beyond=0.05, outside=0.0)
"""Ends chosen by hand: `_FADE` lets the cover end softly there."""
_FADE_AT = (-0.05, 0.0, 0.06, 0.94, 1.0, 1.05)
"""Heights below the top of the head at which `_FADE` is given; chosen by hand."""
_FADE = (0.05, 0.4, 1.0, 1.0, 0.6, 0.1)
"""Factors on the cover, from head to foot: the ends of a body are seen less surely; chosen by
hand."""


@dataclass(frozen=True, eq=False)
class Template:
    """Silhouette of one size.

    Attributes:
        cover: T, (H, W) float32 in [0, 1).
        weights: (H, W, 2) float32: of unexplained foreground, and of its absence (negative).
        norm: value of the log-likelihood ratio for a clean person that stands alone.
        foot: column and row of the foot point inside the patch.
        mass: sum of T.
        highest: weight of unexplained foreground.
    """

    cover: FloatMap
    weights: FloatMap
    norm: float
    foot: tuple[int, int]
    mass: float
    highest: float


def template(height_px: float, ratio: float) -> Template:
    """Of a person `height_px` high and `ratio` times as wide; cached by half pixels."""
    return _build(round(height_px * 2.0), round(ratio * 50.0))


@lru_cache(maxsize=2048)
def _build(height_half_px: int, ratio_fiftieths: int) -> Template:
    height = max(height_half_px / 2.0, 4.0)
    width = height * ratio_fiftieths / 50.0
    half = int(np.ceil(0.8 * width))
    above, below = int(np.ceil(1.05 * height)), int(np.ceil(0.05 * height))
    rows = (np.arange(-above, below + 1) + height) / height
    columns = np.abs(np.arange(-half, half + 1)) / width
    reach = _OUTLINE.half_width(rows)
    fade = np.interp(rows, _FADE_AT, _FADE)
    sides = 1.0 / (1.0 + np.exp((columns[None, :] - reach[:, None]) / _EDGE))
    cover = _COVER * sides * fade[:, None]
    positive = np.log((1.0 - (1.0 - CLUTTER) * (1.0 - cover)) / CLUTTER)
    negative = np.log(1.0 - cover)
    return Template(
        cover=cover.astype(np.float32),
        weights=np.dstack([positive, negative]).astype(np.float32),
        norm=float((cover * positive + (1.0 - cover) * negative).sum()),
        foot=(half, above),
        mass=float(cover.sum()),
        highest=float(positive.max()),
    )
