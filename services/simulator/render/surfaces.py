"""What stands around: walls, pictures on them, pillars, furniture, ceiling, the far view."""

from __future__ import annotations

import cv2
import numpy as np

from heel.services.simulator.render.noise import Picture, clouds, coloured, grey, streaks

WALL_PERIOD_M = 4.0
"""Plaster repeats after so many metres; chosen by hand."""
CEILING_PERIOD_M = 2.4
"""Panels repeat after so many metres: four of 0.6 m."""
POSTERS_A_SIDE = 4
"""Posters in a row and in a column of their one texture."""
FURNITURE_KINDS = 3
"""Textures of furniture there are."""


def plaster(seed: int) -> Picture:
    """An indoor wall from the floor to its top, (512, 512, 3); light grey, to be tinted."""
    rng = np.random.default_rng([seed, 21])
    size = (512, 512)
    picture = coloured(grey(214), (clouds(rng, size, 4, 7), grey(6)),
                       (clouds(rng, size, 64, 3), grey(5)))  # fmt: skip
    picture[-26:] = coloured((112, 96, 84), (streaks(rng, (26, 512), 13, 8), grey(9)))
    picture[-28:-26] = 70
    picture[316:320] = 168
    for x, y in rng.integers(0, 500, (40, 2)).tolist():
        cv2.circle(picture, (x, y % 460), 1 + x % 3, grey(150 + y % 60), -1)
    left = int(rng.integers(40, 430))
    cv2.rectangle(picture, (left, 440), (left + 14, 454), grey(240), -1)
    cv2.rectangle(picture, (left, 440), (left + 14, 454), grey(120), 1)
    return picture


def bricks(seed: int) -> Picture:
    """An outdoor wall, (512, 512, 3); to be tinted."""
    rng = np.random.default_rng([seed, 22])
    picture = coloured(grey(150), (clouds(rng, (512, 512), 64, 3), grey(9)))
    width, height = 64, 32
    for row in range(512 // height):
        for column in range(512 // width + 1):
            shade = rng.uniform(0.72, 1.08)
            colour = (226 * shade, 188 * shade, 168 * shade)
            left, top = column * width - (row % 2) * width // 2, row * height
            corner = left + width - 4, top + height - 4
            cv2.rectangle(picture, (left, top), corner, colour, -1)
    stains = clouds(rng, (512, 512), 32, 4)[..., None] * 8
    return np.asarray(np.clip(picture + stains, 0, 255), np.uint8)


def posters(seed: int) -> Picture:
    """Pictures to hang on walls, `POSTERS_A_SIDE` in a row and in a column, (512, 512, 3)."""
    rng = np.random.default_rng([seed, 23])
    rows = [
        np.hstack([_poster(rng) for _ in range(POSTERS_A_SIDE)]) for _ in range(POSTERS_A_SIDE)
    ]  # fmt: skip
    return np.vstack(rows)


def _poster(rng: np.random.Generator) -> Picture:
    colours = rng.integers(30, 245, (6, 3)).tolist()
    picture = np.full((128, 128, 3), colours[0], np.uint8)
    for colour in colours[1:]:
        x, y, wide, high = rng.integers(6, 100, 4).tolist()
        if rng.random() < 0.5:
            cv2.circle(picture, (x, y), 8 + wide // 3, colour, -1)
        else:
            cv2.rectangle(picture, (x, y), (x + wide, y + high // 2), colour, -1)
    for line in range(int(rng.integers(2, 6))):
        end = 20 + int(rng.integers(40, 90))
        cv2.line(picture, (14, 84 + 8 * line), (end, 84 + 8 * line), colours[-1], 3)
    cv2.rectangle(picture, (0, 0), (127, 127), (40, 34, 30), 7)
    return picture


def concrete(seed: int) -> Picture:
    """A pillar's surface, (256, 256, 3); to be tinted."""
    rng = np.random.default_rng([seed, 24])
    picture = coloured(grey(196), (clouds(rng, (256, 256), 4, 6), grey(13)),
                       (rng.standard_normal((256, 256)).astype(np.float32), grey(5)))  # fmt: skip
    for x, y in rng.integers(0, 256, (70, 2)).tolist():
        cv2.circle(picture, (x, y), 1 + x % 3, grey(110 + y % 70), -1)
    picture[::64] = 140
    picture[-12:] = (90, 84, 78)
    return picture


def furniture(seed: int, kind: int) -> Picture:
    """A front of a cabinet (0), a bookshelf (1) or a sofa (2), (256, 256, 3); to be tinted."""
    rng = np.random.default_rng([seed, 25, kind])
    picture = coloured(grey(205), (streaks(rng, (256, 256), 96, 5), grey(12)),
                       (clouds(rng, (256, 256), 16, 3), grey(5)))  # fmt: skip
    if kind == 0:
        for left in (6, 90, 174):
            cv2.rectangle(picture, (left, 8), (left + 76, 236), grey(120), 2)
            cv2.circle(picture, (left + 68, 120), 5, grey(60), -1)
    elif kind == 1:
        _books(rng, picture)
    else:
        picture = coloured(grey(190), (clouds(rng, (256, 256), 64, 3), grey(10)))
        for left in (0, 85, 170):
            cv2.rectangle(picture, (left, 0), (left + 85, 150), grey(120), 3)
        picture[150:156] = 100
    picture[-10:] = 70
    return picture


def _books(rng: np.random.Generator, picture: Picture) -> None:
    for top in (8, 70, 132, 194):
        picture[top : top + 52, 8:248] = 48
        x = 10
        while x < 236:
            wide, high = int(rng.integers(6, 14)), int(rng.integers(30, 50))
            colour = rng.integers(40, 240, 3).tolist()
            cv2.rectangle(picture, (x, top + 51 - high), (x + wide - 2, top + 51), colour, -1)
            x += wide


def ceiling(seed: int) -> Picture:
    """`CEILING_PERIOD_M` squared of panels, one of them a lamp, (256, 256, 3)."""
    rng = np.random.default_rng([seed, 26])
    picture = coloured(grey(186), (clouds(rng, (256, 256), 64, 3), grey(4)))
    picture[::64] = picture[:, ::64] = 130
    picture[66:126, 66:126] = 252
    cv2.circle(picture, (224, 32), 9, grey(120), 2)
    return picture


def panorama(seed: int) -> Picture:
    """The view all around: sky, clouds, houses and trees on the horizon, (512, 2048, 3)."""
    rng = np.random.default_rng([seed, 27])
    height, width, horizon = 512, 2048, 400
    rows = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    sky = (1 - rows) * np.array([112, 162, 214], np.float32) + rows * np.array([222, 232, 240])
    cover = np.clip(clouds(rng, (height, width), 4, 6) - 0.3, 0, 1)[..., None] * 0.75
    picture = np.asarray(sky * (1 - cover) + 245 * cover, np.float32)
    x = 0
    while x < width:
        wide, high = int(rng.integers(60, 150)), int(rng.integers(40, 130))
        shade = rng.integers(120, 200, 3).astype(float)
        cv2.rectangle(picture, (x, horizon - high), (x + wide, height), shade.tolist(), -1)
        for row in range(horizon - high + 10, horizon, 22):
            for column in range(x + 8, x + wide - 12, 20):
                cv2.rectangle(picture, (column, row), (column + 9, row + 12),
                              (shade * 0.45).tolist(), -1)  # fmt: skip
        x += wide + int(rng.integers(0, 90))
    for _ in range(90):
        centre, radius = int(rng.integers(0, width)), int(rng.integers(14, 34))
        green = rng.uniform(0.6, 1.1) * np.array([74, 104, 58])
        for _ in range(9):
            dx, dy = rng.normal(0, radius / 2, 2).astype(int).tolist()
            leaf = (green * rng.uniform(0.8, 1.2)).tolist()
            cv2.circle(picture, (centre + dx, horizon - radius + dy), radius // 2, leaf, -1)
    picture[horizon:] = (96, 112, 70)
    return np.clip(picture, 0, 255).astype(np.uint8)
