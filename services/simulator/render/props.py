"""What looks like people and is none: pictures, lockers and coats in their colours, mirrors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from heel.services.simulator.outfits import dress
from heel.services.simulator.render import clothes
from heel.services.simulator.render.materials import texture
from heel.services.simulator.render.meshes import Section, joined, loft, node, patch
from heel.services.simulator.render.noise import Picture, clouds, coloured, grey
from heel.services.simulator.state import Colour, Obstacle, Outfit, PersonState

_PAPER = (512, 256)
"""Pixels, height and width."""
_PAPER_M = 2.0
"""Height of the paper on which a person 1.75 m tall is drawn."""
_WOOD: Colour = (104, 74, 48)
"""Of the coat stand; chosen by hand."""


def drawn_person(seed: int) -> Picture:
    """A person life-size on a sheet of paper 2 m high and 1 m wide, (512, 256, 3)."""
    rng = np.random.default_rng([seed, 51])
    picture = coloured(grey(226), (clouds(rng, _PAPER, 16, 3), grey(4)))
    outfit, middle, metre = _outfit(seed), _PAPER[1] // 2, _PAPER[0] / _PAPER_M

    def at(x_m: float, up_m: float) -> tuple[int, int]:
        return round(middle + x_m * metre), round(_PAPER[0] - (up_m + 0.06) * metre)

    def part(colour: Colour, *corners: tuple[float, float]) -> None:
        points = np.array([at(*corner) for corner in corners], np.int32)
        cv2.fillPoly(picture, [points], colour)

    for side in (-1, 1):
        part(outfit.legs, (0.01 * side, 0.9), (0.17 * side, 0.9), (0.14 * side, 0.08),
             (0.04 * side, 0.08))  # fmt: skip
        part(outfit.shoes, (0.03 * side, 0.09), (0.15 * side, 0.09), (0.2 * side, 0.0),
             (0.03 * side, 0.0))  # fmt: skip
        part(outfit.top, (0.15 * side, 1.42), (0.22 * side, 1.38), (0.3 * side, 0.85),
             (0.22 * side, 0.83))  # fmt: skip
    part(outfit.top, (-0.2, 1.44), (0.2, 1.44), (0.17, 0.86), (-0.17, 0.86))
    part(outfit.skin, (-0.05, 1.52), (0.05, 1.52), (0.06, 1.43), (-0.06, 1.43))
    cv2.ellipse(picture, at(0.0, 1.61), (round(0.08 * metre), round(0.12 * metre)), 0, 0, 360,
                outfit.skin, -1)  # fmt: skip
    cv2.ellipse(picture, at(0.0, 1.67), (round(0.085 * metre), round(0.075 * metre)), 0, 180, 360,
                outfit.hair, -1)  # fmt: skip
    return picture


def dressed_front(seed: int) -> Picture:
    """A locker painted in the colours of clothes, (256, 64, 3)."""
    outfit = _outfit(seed)
    folds = clouds(np.random.default_rng([seed, 52]), (256, 64), 8, 3)
    picture = np.empty((256, 64, 3), np.uint8)
    bands = ((0.0, outfit.hair), (0.05, outfit.skin), (0.14, outfit.top), (0.5, outfit.legs),
             (0.95, outfit.shoes))  # fmt: skip
    for top, colour in bands:
        first = round(256 * top)
        picture[first:] = coloured(colour, (folds[first:], grey(5)))
    return picture


def coat_stand(obstacle: Obstacle, seed: int) -> Iterator[Any]:
    """Nodes of a stand with a coat and a hat on it, about the origin."""
    high, outfit = obstacle.height_m, _outfit(seed)
    foot = [(0.0, 0.24, 0.24, 0.0), (0.03, 0.22, 0.22, 0.0), (0.05, 0.03, 0.03, 0.0)]
    pole = [(0.03, 0.02, 0.02, 0.0), (high - 0.05, 0.02, 0.02, 0.0)]
    for sections in (foot, pole):
        yield node("stand", loft(sections, sides=10), _WOOD)
    coat = [(0.4, 0.15, 0.2, 0.0), (0.75, 0.12, 0.19, 0.0), (0.81, 0.08, 0.18, 0.0),
            (0.86, 0.03, 0.05, 0.0)]  # fmt: skip
    shape = node("coat", loft(_of_height(coat, high), sides=14))
    shape.set_texture(texture("coat", clothes.top(outfit, weave=0)))
    yield shape
    hat = [(0.91, 0.12, 0.12, 0.0), (0.92, 0.12, 0.12, 0.0), (0.925, 0.08, 0.08, 0.0),
           (0.99, 0.07, 0.07, 0.0)]  # fmt: skip
    yield node("hat", loft(_of_height(hat, high), sides=12), outfit.hair)


def frame_of_glass(obstacle: Obstacle) -> Any:
    """The posts and the lintel of a pane, about the origin; the pane itself is not seen."""
    x, high, wide = obstacle.length_m / 2, obstacle.height_m, 0.06
    bars = [
        patch((at, -0.01, low), (across, 0, 0), (0, 0, up), (1, 1), (1, 2))
        for at, low, across, up in (
            (-x, 0.0, wide, high), (x - wide, 0.0, wide, high), (-x, high - wide, 2 * x, wide),
        )
    ]  # fmt: skip
    frame = node("glass", joined(bars), obstacle.colour)
    frame.set_two_sided(True)
    return frame


def mirror_images(
    people: Iterable[PersonState], obstacles: Iterable[Obstacle], eye: tuple[float, float]
) -> Iterator[PersonState]:
    """Images of all people in the panes, as far as they are seen from a place; ids below 0."""
    panes = [thing for thing in obstacles if thing.look == "glass"]
    for index, pane in enumerate(panes):
        along = math.cos(pane.heading_rad), math.sin(pane.heading_rad)
        eye_along, eye_off = _by_pane(pane, along, *eye)
        for person in people:
            place_along, off = _by_pane(pane, along, person.x_m, person.y_m)
            if off * eye_off <= 0.0:
                continue
            crossing = eye_along + (place_along - eye_along) * eye_off / (eye_off + off)
            if abs(crossing) > pane.length_m / 2:
                continue
            yield replace(
                person,
                id=-(person.id + 100 * index),
                x_m=person.x_m + 2.0 * off * along[1],
                y_m=person.y_m - 2.0 * off * along[0],
                heading_rad=2.0 * pane.heading_rad - person.heading_rad,
            )


def _by_pane(
    pane: Obstacle, along: tuple[float, float], x_m: float, y_m: float
) -> tuple[float, float]:
    """Along a pane from its middle, and off it."""
    x, y = x_m - pane.x_m, y_m - pane.y_m
    return x * along[0] + y * along[1], y * along[0] - x * along[1]


def _of_height(shares: list[Section], height_m: float) -> list[Section]:
    """Sections whose heights were given as shares of the whole."""
    return [(share * height_m, *rest) for share, *rest in shares]  # type: ignore[misc]


def _outfit(seed: int) -> Outfit:
    return dress(1, np.random.default_rng([seed, 53]))[0]
