"""The pixels that a detector would cut out under a box: clothes, background and who is before."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.simulator.state import Colour, Floor, Obstacle, Outfit, PersonState, RobotState
from services.simulator.views import COLUMNS, ROWS, Sight

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

PATCH_WIDTH, PATCH_HEIGHT = 12, 24
_X = (np.arange(PATCH_WIDTH) + 0.5) / PATCH_WIDTH
_Y = (np.arange(PATCH_HEIGHT) + 0.5) / PATCH_HEIGHT

# Rows of a body from head to foot, in shares of its height, and what shows there.
_PARTS_END = np.array([0.06, 0.15, 0.50, 0.94])
_HAIR, _FACE, _TOP, _LEGS, _SHOES, _WALL, _FLOOR, _OTHER_TOP, _OTHER_LEGS = range(9)
_HALF_WIDTH = np.array([0.07, 0.07, 0.13, 0.11, 0.12])
"""Of each part, in shares of a body's height."""
_HORIZON = 0.7
"""Share of a box above which the background is wall or sky rather than floor."""
_INDOORS: Colour = (196, 190, 180)
_OUTDOORS: Colour = (150, 172, 160)
_FLOORS: dict[Floor, Colour] = {
    "tiles": (170, 165, 158),
    "wood": (150, 112, 76),
    "asphalt": (96, 96, 98),
    "grass": (92, 122, 62),
}


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
    """Draws crops (PATCH_HEIGHT, PATCH_WIDTH, 3) BGR."""

    def __init__(
        self, floor: Floor, indoors: bool, obstacles: tuple[Obstacle, ...],
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self._rng = rng
        self._background = np.array([_INDOORS if indoors else _OUTDOORS, _FLOORS[floor]], float)
        self._solid = np.array([o.colour for o in obstacles], float).reshape(-1, 3)

    def draw(
        self, people: tuple[PersonState, ...], robot: RobotState, sight: Sight,
        found: NDArray[np.intp], boxes: Array, light: Light,
    ) -> tuple[Pixels, Array]:  # fmt: skip
        """Crops of people.

        Args:
            people: everybody.
            robot: where the camera is.
            sight: everybody as seen from there.
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
        shape = (len(found), PATCH_HEIGHT, PATCH_WIDTH)
        width_m = (true[:, 2] - true[:, 0]) / (true[:, 3] - true[:, 1])
        aside = np.abs(x - 0.5)[:, None, :] * width_m[:, None, None]
        part = np.searchsorted(_PARTS_END, y)
        body = aside < _HALF_WIDTH[part][:, :, None]
        body &= ((y > 0.0) & (y < 1.0))[:, :, None]
        body &= ~self._between_the_legs(people, found, aside, y)
        background = np.where(y > _HORIZON, _FLOOR, _WALL)
        show = np.where(body, part[:, :, None], background[:, :, None])
        row = np.clip((y * ROWS).astype(np.intp), 0, ROWS - 1)
        column = np.clip((x * COLUMNS).astype(np.intp), 0, COLUMNS - 1)
        index = np.arange(len(found))[:, None, None]
        blocker = sight.hidden_by[found][index, row[:, :, None], column[:, None, :]]
        lower = np.broadcast_to((y > 0.5)[:, :, None], shape)
        show = np.where(blocker >= 0, np.where(lower, _OTHER_LEGS, _OTHER_TOP), show)
        palette = np.stack([self._palette(people, robot, int(who), sight) for who in found])
        shade = self._shades(people, robot, found, x, light)
        pixels = palette[index, show] * shade[:, None, :, None]
        share = (body & (blocker < 0)).mean((1, 2))
        return self._develop(pixels, light), share

    def plain(self, colour: NDArray[np.float64], light: Light) -> Pixels:
        """Crops of things in one colour each (K, 3) RGB, upright before the background."""
        inside = np.abs(_X - 0.5) < 0.35
        shape = (len(colour), PATCH_HEIGHT, PATCH_WIDTH, 3)
        rows = self._background[(_Y > _HORIZON).astype(np.intp)]
        pixels = np.broadcast_to(rows[None, :, None, :], shape).copy()
        pixels[:, :, inside] = colour[:, None, None, :]
        return self._develop(pixels, light)

    def _palette(
        self, people: tuple[PersonState, ...], robot: RobotState, who: int, sight: Sight
    ) -> Array:
        """What the parts of a picture of somebody look like, (9, 3) RGB."""
        person = people[who]
        outfit = person.outfit
        towards = math.atan2(robot.y_m - person.y_m, robot.x_m - person.x_m)
        # From behind there is hair where the face would be.
        front = math.cos(person.heading_rad - towards)
        face = _mix(outfit.hair, outfit.skin, min(max(0.5 + front, 0.0), 1.0))
        table = [outfit.hair, face, outfit.top, outfit.legs, outfit.shoes]
        blockers = sight.hidden_by[who]
        other = int(blockers.max())
        upper, lower = self._occluder(people, other)
        return np.vstack([np.array(table, float), self._background, upper, lower])

    def _occluder(self, people: tuple[PersonState, ...], other: int) -> tuple[Array, Array]:
        if other < 0:
            return np.zeros(3), np.zeros(3)
        if other < len(people):
            outfit: Outfit = people[other].outfit
            return np.array(outfit.top, float), np.array(outfit.legs, float)
        colour = self._solid[other - len(people)]
        return colour, colour

    def _between_the_legs(
        self, people: tuple[PersonState, ...], found: NDArray[np.intp], aside: Array, y: Array
    ) -> NDArray[np.bool_]:
        swing = np.array([abs(math.sin(people[int(i)].stride_rad)) for i in found])
        gap = 0.05 * swing[:, None] * np.maximum(y - 0.55, 0.0) / 0.45
        return np.asarray(aside < gap[:, :, None])

    def _shades(
        self, people: tuple[PersonState, ...], robot: RobotState, found: NDArray[np.intp],
        x: Array, light: Light,
    ) -> Array:  # fmt: skip
        """Brighter on the side that the light comes from, (K, PATCH_WIDTH)."""
        rows = [people[int(i)] for i in found]
        view = np.array([math.atan2(p.y_m - robot.y_m, p.x_m - robot.x_m) for p in rows])
        angle = view - light.azimuth_rad
        return np.asarray(
            0.88 + 0.12 * np.cos(angle)[:, None] + 0.25 * np.sin(angle)[:, None] * (x - 0.5)
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


def _mix(first: Colour, second: Colour, share: float) -> Array:
    return (1.0 - share) * np.array(first, float) + share * np.array(second, float)
