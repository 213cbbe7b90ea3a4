"""What one walks on: tiles, wood, asphalt, grass, made from noise and a seed."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from heel.services.simulator.render.noise import Field, Picture, clouds, coloured, grey, streaks
from heel.services.simulator.state import Floor

PERIOD_M = 4.0
"""Every ground repeats after so many metres."""
_SIZE = 1024
"""Pixels of a texture's side: 4 mm of ground each."""


def ground(floor: Floor, seed: int) -> Picture:
    """`PERIOD_M` squared of a floor, seamless, (1024, 1024, 3)."""
    return _MAKERS[floor](np.random.default_rng([seed, 11]))


def _tiles(rng: np.random.Generator) -> Picture:
    count, side = 8, _SIZE // 8
    picture = coloured(
        (176, 168, 156), (clouds(rng, (_SIZE, _SIZE), 8, 6), (7, 7, 8)),
        (rng.standard_normal((_SIZE, _SIZE)).astype(np.float32), grey(3)),
    ).astype(np.float32)  # fmt: skip
    tint = rng.normal(0, 9, (count, count, 1)) + rng.normal(0, 2.5, (count, count, 3))
    picture += np.repeat(np.repeat(tint, side, 0), side, 1)
    dark = rng.random((count, count)) < 0.16
    picture *= np.repeat(np.repeat(np.where(dark, 0.68, 1.0), side, 0), side, 1)[..., None]
    for line in range(0, _SIZE, side):
        picture[line : line + 3] *= 0.6
        picture[:, line : line + 3] *= 0.6
    return np.clip(_speckled(rng, picture, 1500, 26), 0, 255).astype(np.uint8)


def _wood(rng: np.random.Generator) -> Picture:
    planks, height = 32, _SIZE // 32
    grain = streaks(rng, (_SIZE, _SIZE), 512, 10)
    veins = streaks(rng, (_SIZE, _SIZE), 160, 6)
    picture = coloured((150, 104, 64), (grain, (9, 8, 6)), (veins, (12, 10, 7))).astype(np.float32)
    for row in range(planks):
        top = row * height
        ends = np.sort(rng.choice(np.arange(0, _SIZE, 32), 3, replace=False))
        for start, end in zip(ends, [*ends[1:], ends[0] + _SIZE], strict=True):
            columns = np.arange(start, end) % _SIZE
            picture[top : top + height, columns] *= rng.uniform(0.72, 1.18)
        picture[top : top + height, ends] *= 0.45
        picture[top : top + 2] *= 0.55
    return np.clip(_speckled(rng, picture, 900, 40), 0, 255).astype(np.uint8)


def _asphalt(rng: np.random.Generator) -> Picture:
    stones = clouds(rng, (_SIZE, _SIZE), 128, 3)
    picture = coloured(
        (98, 99, 101), (clouds(rng, (_SIZE, _SIZE), 4, 6), grey(8)), (stones, grey(11)),
        (rng.standard_normal((_SIZE, _SIZE)).astype(np.float32), grey(9)),
    ).astype(np.float32)  # fmt: skip
    picture = _speckled(rng, picture, 2500, 45)
    for _ in range(9):
        steps = np.cumsum(rng.normal(0, 14, (40, 2)) + rng.normal(0, 12, 2), axis=0)
        points = (steps + rng.uniform(0, _SIZE, 2)).astype(np.int32)
        cv2.polylines(picture, [points.reshape(-1, 1, 2)], False, (48, 48, 50), 3)
    return np.clip(picture, 0, 255).astype(np.uint8)


def _grass(rng: np.random.Generator) -> Picture:
    size = (_SIZE, _SIZE)
    picture = coloured(
        (88, 122, 56),
        (clouds(rng, size, 4, 7), (18, 15, 9)),
        (clouds(rng, size, 96, 3), (9, 13, 6)),
    ).astype(np.float32)
    places = rng.uniform(0, _SIZE, (14000, 2))
    ends = places + rng.normal(0, 4, (14000, 2)) + (0, -9)
    shades = rng.uniform(0.6, 1.45, 14000)
    for start, end, shade in zip(places.astype(int), ends.astype(int), shades, strict=True):
        cv2.line(picture, start.tolist(), end.tolist(), (84 * shade, 126 * shade, 50 * shade), 2)
    for x, y in rng.integers(0, _SIZE, (60, 2)).tolist():
        cv2.circle(picture, (x, y), 4, (225, 220, 150) if x % 3 else (190, 150, 70), -1)
    return np.clip(picture, 0, 255).astype(np.uint8)


def _speckled(rng: np.random.Generator, picture: Field, count: int, strength: float) -> Field:
    """Spots of 8 to 24 mm, lighter or darker: what a feature tracker holds on to."""
    spots = np.zeros((_SIZE, _SIZE), np.float32)
    places, radii = rng.integers(0, _SIZE, (count, 2)), rng.integers(1, 4, count)
    for (x, y), radius, shade in zip(
        places.tolist(), radii.tolist(), rng.normal(0, strength, count).tolist(), strict=True
    ):
        cv2.circle(spots, (x, y), radius, shade, -1)
    return np.asarray(picture + spots[..., None], np.float32)


_MAKERS: dict[Floor, Callable[[np.random.Generator], Picture]] = {
    "tiles": _tiles, "wood": _wood, "asphalt": _asphalt, "grass": _grass,
}  # fmt: skip
