"""The colour that an id has wherever it is drawn: on the page, in films and in plots.

The page computes the same in `services/web/static/picture.js`; a test compares the two. What marks
the target is drawn there and in `services/drawing.py`.
"""

from __future__ import annotations

import colorsys

HUE_STEP_DEG = 137.508
"""From one id's hue to the next one's: the golden angle, by which neighbouring ids differ strongly
and many ids fill the circle evenly."""
SATURATION, LIGHTNESS = 0.90, 0.67
"""Clear before any picture, bright or dark; chosen by hand."""
UNSURE_BELOW = 0.6
"""Confidence in an identity below which it is marked as unsure: the follower's own default."""

Rgb = tuple[float, float, float]


def colour_of(track_id: int, lightness: float = LIGHTNESS, saturation: float = SATURATION) -> Rgb:
    """Red, green and blue of an id, 0 to 1 each; what is drawn on paper may be darker."""
    return colorsys.hls_to_rgb(track_id * HUE_STEP_DEG % 360.0 / 360.0, lightness, saturation)
