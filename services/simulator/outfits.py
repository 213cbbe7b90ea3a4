"""What people wear: colours that usually tell them apart, and clothes alike for twins."""

from __future__ import annotations

import colorsys

import numpy as np

from heel.services.simulator.state import Colour, Outfit

_HAIR: tuple[Colour, ...] = ((30, 26, 28), (84, 52, 34), (196, 156, 92), (150, 150, 148))
"""Chosen by hand: black, brown, fair, grey."""
_SKIN: tuple[Colour, ...] = ((224, 180, 150), (186, 134, 96), (132, 88, 62))
"""Chosen by hand: light, medium, dark."""
_LEGS: tuple[Colour, ...] = (
    (42, 62, 108), (40, 40, 44), (120, 104, 80), (92, 94, 98), (58, 70, 48), (170, 160, 140),
)  # fmt: skip
"""Trousers; chosen by hand: the muted colours of a street."""
_SHOES: tuple[Colour, ...] = ((28, 26, 26), (232, 230, 226), (110, 72, 44), (150, 36, 36))
"""Chosen by hand: black, white, brown, red."""
_SIMILAR = 0.15
"""Share of people whose upper body has about the hue of the first one's."""


def dress(people: int, rng: np.random.Generator) -> list[Outfit]:
    """Outfits for so many people; hues of upper bodies are spread, now and then one is alike."""
    first = float(rng.random())
    outfits = []
    for index in range(people):
        similar = index > 0 and rng.random() < _SIMILAR
        spread = 0.0 if similar else index / people
        hue = (first + spread + float(rng.uniform(-0.03, 0.03))) % 1.0
        saturation, value = float(rng.uniform(0.55, 0.95)), float(rng.uniform(0.4, 0.9))
        red, green, blue = colorsys.hsv_to_rgb(hue, saturation, value)
        outfits.append(
            Outfit(
                hair=_pick(_HAIR, rng),
                skin=_pick(_SKIN, rng),
                top=(round(255 * red), round(255 * green), round(255 * blue)),
                legs=_pick(_LEGS, rng),
                shoes=_pick(_SHOES, rng),
            )
        )
    return outfits


def twin_of(outfit: Outfit, rng: np.random.Generator) -> Outfit:
    """The same clothes, bought separately: at most 3 of 255 off in each colour."""
    return Outfit(*(_almost(colour, rng) for colour in _colours(outfit)))


def _colours(outfit: Outfit) -> tuple[Colour, ...]:
    return outfit.hair, outfit.skin, outfit.top, outfit.legs, outfit.shoes


def _almost(colour: Colour, rng: np.random.Generator) -> Colour:
    red, green, blue = np.clip(np.array(colour) + rng.integers(-3, 4, 3), 0, 255).tolist()
    return red, green, blue


def _pick(colours: tuple[Colour, ...], rng: np.random.Generator) -> Colour:
    return _almost(colours[int(rng.integers(len(colours)))], rng)
