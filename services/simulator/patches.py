"""The pixels that a detector would cut out under a box: clothes, background and people in front."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.state import CARDBOARD, Colour, Floor, PersonState, RobotState, Scenery
from heel.services.simulator.views import COLUMNS, ROWS, Sight

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Pixels = NDArray[np.uint8]

PATCH_WIDTH = 12
"""Pixels of a crop; chosen by hand: enough for colours of four parts and a side that is lit."""
PATCH_HEIGHT = 24
"""Pixels of a crop: people are twice as high as their boxes are wide, or more."""
_X = (np.arange(PATCH_WIDTH) + 0.5) / PATCH_WIDTH
"""Middle of each column, share of a crop's width."""
_Y = (np.arange(PATCH_HEIGHT) + 0.5) / PATCH_HEIGHT
"""Middle of each row, share of a crop's height."""

# Rows of a body from head to foot, in shares of its height, and what shows there.
_PARTS_END = np.array([0.06, 0.15, 0.50, 0.94])
_HAIR, _FACE, _TOP, _LEGS, _SHOES, _WALL, _FLOOR, _OTHER_TOP, _OTHER_LEGS, _CARRIED = range(10)
"""Columns of the table of colours: parts of a body, then what else a pixel can show."""
_HALF_WIDTH = np.array([0.07, 0.07, 0.13, 0.11, 0.12])
"""Of each part, in shares of a body's height."""
_CARRIED_ROWS = (0.27, 0.5)
"""Rows of a body that a box before the chest covers, in shares of its height; chosen by hand."""
_HORIZON = 0.7
"""Share of a box above which the background is wall or sky rather than floor."""
_INDOORS: Colour = (196, 190, 180)
"""Walls; chosen by hand."""
_OUTDOORS: Colour = (150, 172, 160)
"""What stands behind people outdoors; chosen by hand."""
_FLOORS: dict[Floor, Colour] = {
    "tiles": (170, 165, 158),
    "wood": (150, 112, 76),
    "asphalt": (96, 96, 98),
    "grass": (92, 122, 62),
}
"""Colour of each floor; chosen by hand."""


@dataclass(frozen=True, slots=True)
class Light:
    """What falls on the scene and what the camera makes of it.

    Attributes:
        azimuth_rad: where it comes from.
        level: how bright the picture is; 1 is right.
        gain: by which noise is amplified.
    """

    azimuth_rad: float
    level: float
    gain: float


class Patches:
    """Draws crops (PATCH_HEIGHT, PATCH_WIDTH, 3) BGR.

    Args:
        scenery: of the world.
        people: of the world; what they wear does not change.
        rng: of the sensor's noise.
    """

    def __init__(
        self, scenery: Scenery, people: tuple[PersonState, ...], rng: np.random.Generator
    ) -> None:
        self._rng = rng
        backdrop = _INDOORS if scenery.indoors else _OUTDOORS
        self._background = np.array([backdrop, _FLOORS[scenery.floor]], np.float64)
        outfits = [p.outfit for p in people]
        self._clothes = np.array(
            [(o.hair, o.skin, o.top, o.legs, o.shoes) for o in outfits], np.float64
        )
        solid = np.array([o.colour for o in scenery.obstacles], np.float64).reshape(-1, 3)
        # What hides a person: people first, then obstacles, as in `Sight.hidden_by`.
        self._upper = np.vstack([self._clothes[:, _TOP], solid])
        self._lower = np.vstack([self._clothes[:, _LEGS], solid])

    def draw(
        self, people: tuple[PersonState, ...], robot: RobotState, sight: Sight,
        found: Index, boxes: Array, light: Light,
    ) -> tuple[Pixels, Array]:  # fmt: skip
        """Crops of people.

        Args:
            people: all of them.
            robot: where the camera is.
            sight: all people as seen from there.
            found: indices (K,) of those to draw.
            boxes: (K, 4) what the detector cut out, pixels.
            light: of the moment.

        Returns:
            (K, PATCH_HEIGHT, PATCH_WIDTH, 3) uint8, and the share (K,) of pixels that show the
            person.
        """
        if not found.size:
            return np.zeros((0, PATCH_HEIGHT, PATCH_WIDTH, 3), np.uint8), np.zeros(0)
        true = sight.box_xyxy[found]
        x, y = _cells(boxes, true)
        rows = [people[index] for index in found.tolist()]
        heading, stride = np.array([(p.heading_rad, p.stride_rad) for p in rows]).T
        view = np.array([math.atan2(p.y_m - robot.y_m, p.x_m - robot.x_m) for p in rows])
        part, body = _body(true, stride, x, y)
        background = np.where(y > _HORIZON, _FLOOR, _WALL)
        laden = np.array([person.carries for person in rows])[:, None]
        part = np.where(laden & (y > _CARRIED_ROWS[0]) & (y < _CARRIED_ROWS[1]), _CARRIED, part)
        show = np.where(body, part[:, :, None], background[:, :, None])
        index = np.arange(len(found))[:, None, None]
        row = _cell(y, ROWS)
        column = _cell(x, COLUMNS)
        hidden = sight.hidden_by[found][index, row[:, :, None], column[:, None, :]] >= 0
        other = np.where(y > 0.5, _OTHER_LEGS, _OTHER_TOP)
        show = np.where(hidden, other[:, :, None], show)
        pixels = self._palette(heading, view, sight, found)[index, show]
        pixels = pixels * _shades(view, x, light)[:, None, :, None]
        return self._develop(pixels, light), (body & ~hidden).mean((1, 2))

    def plain(self, colour: NDArray[np.float64], light: Light) -> Pixels:
        """Crops of things in one colour each (K, 3) RGB, upright before the background."""
        inside = np.abs(_X - 0.5) < 0.35
        shape = (len(colour), PATCH_HEIGHT, PATCH_WIDTH, 3)
        rows = self._background[(_Y > _HORIZON).astype(np.intp)]
        pixels = np.broadcast_to(rows[None, :, None, :], shape).copy()
        pixels[:, :, inside] = colour[:, None, None, :]
        return self._develop(pixels, light)

    def _palette(self, heading_rad: Array, view_rad: Array, sight: Sight, found: Index) -> Array:
        """What the parts of the pictures of people look like, (K, 10, 3) RGB."""
        clothes = self._clothes[found]
        # From behind there is hair where the face would be.
        front = np.clip(0.5 - np.cos(heading_rad - view_rad), 0.0, 1.0)[:, None]
        face = (1.0 - front) * clothes[:, _HAIR] + front * clothes[:, _FACE]
        carried = (1.0 - front) * clothes[:, _TOP] + front * np.array(CARDBOARD)
        other = sight.hidden_by[found].max((1, 2))
        background = np.broadcast_to(self._background, (len(found), 2, 3))
        return np.concatenate(
            [
                clothes[:, :_FACE],
                face[:, None],
                clothes[:, _TOP:],
                background,
                self._upper[other][:, None],
                self._lower[other][:, None],
                carried[:, None],
            ],
            axis=1,
        )

    def _develop(self, pixels: Array, light: Light) -> Pixels:
        """RGB in normal light to BGR as exposed, with the sensor's noise."""
        noise = self._rng.standard_normal(pixels.shape, np.float32)
        bgr = pixels[..., ::-1] * light.level + (3.0 + 2.0 * light.gain) * noise
        return np.clip(bgr, 0.0, 255.0).astype(np.uint8)


def _cells(boxes: Array, true: Array) -> tuple[Array, Array]:
    """Where columns (K, PATCH_WIDTH) and rows (K, PATCH_HEIGHT) of crops lie in the true boxes."""
    x_px = boxes[:, 0, None] + (boxes[:, 2] - boxes[:, 0])[:, None] * _X
    y_px = boxes[:, 1, None] + (boxes[:, 3] - boxes[:, 1])[:, None] * _Y
    x = (x_px - true[:, 0, None]) / (true[:, 2] - true[:, 0])[:, None]
    y = (y_px - true[:, 1, None]) / (true[:, 3] - true[:, 1])[:, None]
    return x, y


def _cell(share: Array, cells: int) -> Index:
    """Which of so many cells a share of the box is in; what is beside the box, in the outermost."""
    return np.minimum(np.maximum((share * cells).astype(np.intp), 0), cells - 1)


def _body(true: Array, stride_rad: Array, x: Array, y: Array) -> tuple[Index, NDArray[np.bool_]]:
    """Which part each row (K, PATCH_HEIGHT) shows, and where the body is, per pixel."""
    width = (true[:, 2] - true[:, 0]) / (true[:, 3] - true[:, 1])
    aside = np.abs(x - 0.5)[:, None, :] * width[:, None, None]
    part = np.searchsorted(_PARTS_END, y)
    half = np.where((y > 0.0) & (y < 1.0), _HALF_WIDTH[part], 0.0)
    # The background shows between the legs of a person in mid-step.
    swing = 0.05 * np.abs(np.sin(stride_rad))[:, None]
    gap = swing * np.maximum(y - 0.55, 0.0) / 0.45
    return part, (aside < half[:, :, None]) & (aside >= gap[:, :, None])


def _shades(view_rad: Array, x: Array, light: Light) -> Array:
    """Brighter on the side that the light comes from, (K, PATCH_WIDTH)."""
    angle = (view_rad - light.azimuth_rad)[:, None]
    return np.asarray(0.88 + 0.12 * np.cos(angle) + 0.25 * np.sin(angle) * (x - 0.5))
