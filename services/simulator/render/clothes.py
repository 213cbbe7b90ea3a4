"""What a person looks like, as pictures: head with hair and face, and what is worn above."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from heel.services.simulator.render.noise import Field, Picture, clouds
from heel.services.simulator.state import Colour, Outfit

_SIZE = 128
"""Pixels of a texture's side; chosen by hand: a fold is some pixels wide at 2 m."""
_WEAVES = 6
"""Patterns of cloth there are."""
_ALIKE = 12
"""Grey levels by which clothes that look the same may differ in every channel."""


def weaves_of(outfits: Sequence[Outfit]) -> list[int]:
    """Which pattern goes with each outfit; those that look nearly the same have the same."""
    weaves: list[int] = []
    for index, outfit in enumerate(outfits):
        alike = (w for o, w in zip(outfits[:index], weaves, strict=True) if _alike(o, outfit))
        weaves.append(next(alike, _weave(outfit)))
    return weaves


def _weave(outfit: Outfit) -> int:
    parts = zip((*outfit.top, *outfit.legs), (1, 2, 4, 3, 5, 1), strict=True)
    return sum(round(channel / 85) * factor for channel, factor in parts) % _WEAVES


def _alike(one: Outfit, other: Outfit) -> bool:
    pairs = zip((*one.top, *one.legs), (*other.top, *other.legs), strict=True)
    return all(abs(first - second) <= _ALIKE for first, second in pairs)


def top(outfit: Outfit, weave: int) -> Picture:
    """Jacket or shirt all around, (128, 128, 3); the middle column is the front.

    Args:
        outfit: its colours.
        weave: its pattern, from `weaves_of`.
    """
    base, second = np.array(outfit.top, np.float32), _contrast(outfit.top)
    picture = np.tile(base, (_SIZE, _SIZE, 1))
    if weave == 1:
        for row in range(6, _SIZE, 22):
            picture[row : row + 9] = second
    elif weave == 2:
        picture[::16] = picture[1::16] = picture[2::16] = second
        picture[:, ::16] = picture[:, 1::16] = picture[:, 2::16] = second
    elif weave == 3:
        picture[38:66] = second
        picture[50:54] = base
    elif weave == 4:
        # An open jacket over a light shirt.
        picture[:, 54:74] = (226, 224, 218)
        picture[:, 52:54] = picture[:, 74:76] = base * 0.5
    elif weave == 5:
        cv2.circle(picture, (64, 48), 12, second.tolist(), -1)
        cv2.circle(picture, (64, 48), 5, base.tolist(), -1)
        cv2.circle(picture, (0, 52), 16, second.tolist(), 3)
        cv2.circle(picture, (127, 52), 16, second.tolist(), 3)
    picture[-7:] *= 0.72
    picture[:5] *= 0.8
    return _with_folds(picture)


def cloth(colour: Colour) -> Picture:
    """Plain cloth in a colour, (128, 128, 3)."""
    return _with_folds(np.tile(np.array(colour, np.float32), (_SIZE, _SIZE, 1)))


def head(outfit: Outfit) -> Picture:
    """Hair and face all around, (128, 128, 3); the middle column is the front."""
    hair = np.array(outfit.hair, np.float32)
    picture = np.tile(np.array(outfit.skin, np.float32), (_SIZE, _SIZE, 1))
    around = np.abs(np.arange(_SIZE) - 63.5) / 63.5
    # The hairline: high over the forehead, down to the neck behind.
    line = np.interp(around, (0, 0.28, 0.36, 0.5, 1), (0.27, 0.3, 0.5, 0.62, 0.74)) * _SIZE
    picture[np.arange(_SIZE)[:, None] < line] = hair
    dark = tuple(float(c) for c in np.array(outfit.skin, np.float32) * 0.35)
    lip = tuple(float(c) for c in np.array(outfit.skin, np.float32) * (0.8, 0.55, 0.55))
    for side in (-1, 1):
        cv2.ellipse(picture, (64 + side * 9, 58), (4, 3), 0, 0, 360, (240, 238, 232), -1)
        cv2.circle(picture, (64 + side * 9, 58), 2, dark, -1)
        cv2.line(picture, (64 + side * 5, 51), (64 + side * 13, 51), dark, 2)
    cv2.line(picture, (64, 60), (64, 72), lip, 3)
    cv2.ellipse(picture, (64, 86), (8, 2), 0, 0, 360, lip, -1)
    return np.clip(picture, 0, 255).astype(np.uint8)


def shadow() -> Picture:
    """A soft dark spot under a person, (64, 64, 4)."""
    axis = np.linspace(-1, 1, 64)
    away = np.hypot(*np.meshgrid(axis, axis))
    picture = np.zeros((64, 64, 4), np.uint8)
    picture[..., 3] = np.clip((1 - away) * 1.6, 0, 1) * 150
    return picture


def _contrast(colour: Colour) -> Field:
    """A colour that stands out from `colour` and stays close to it in hue."""
    base = np.array(colour, np.float32)
    return np.asarray(base * 0.35 if base.mean() > 115 else 255 - (255 - base) * 0.45, np.float32)


def _with_folds(picture: Field) -> Picture:
    # The same folds in all clothes: what tells people apart is what they wear.
    folds = clouds(np.random.default_rng(41), (_SIZE, _SIZE), 4, 5)
    return np.clip(picture * (1 + 0.07 * folds[..., None]), 0, 255).astype(np.uint8)
