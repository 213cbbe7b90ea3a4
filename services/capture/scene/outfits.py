"""What the drawn people wear: colours and cuts that differ from person to person."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Bgr = tuple[int, int, int]

# Skin and hair, 8-bit blue, green and red; chosen by hand.
LIGHT: Bgr = (150, 180, 224)
TAN: Bgr = (96, 134, 186)
BROWN: Bgr = (62, 88, 132)
BLACK_HAIR: Bgr = (28, 26, 30)
BROWN_HAIR: Bgr = (34, 52, 84)
BLOND_HAIR: Bgr = (92, 156, 196)
GREY_HAIR: Bgr = (150, 152, 156)


@dataclass(frozen=True)
class Outfit:
    """Colours are BGR, 0 to 255."""

    top: Bgr
    legs: Bgr
    shoes: Bgr
    skin: Bgr
    hair: Bgr
    pattern: Literal["plain", "stripes", "jacket"] = "plain"
    second: Bgr = (230, 230, 230)
    cut: Literal["trousers", "skirt", "coat", "shorts"] = "trousers"
    sleeves: Literal["long", "short"] = "long"
    carries: Literal["nothing", "backpack", "bag"] = "nothing"
    long_hair: bool = False


OUTFITS = (
    Outfit((44, 40, 186), (110, 70, 42), (230, 230, 232), LIGHT, BROWN_HAIR, "jacket"),
    Outfit(
        (78, 50, 34), (70, 46, 32), (24, 24, 28), TAN, BLACK_HAIR, "jacket", (232, 232, 236),
        carries="bag",
    ),
    Outfit(
        (60, 190, 232), (52, 44, 48), (40, 40, 120), LIGHT, BLOND_HAIR, cut="skirt",
        sleeves="short", long_hair=True, carries="bag",
    ),
    Outfit((72, 96, 52), (46, 44, 46), (30, 40, 60), BROWN, BLACK_HAIR, cut="coat"),
    Outfit(
        (226, 228, 230), (60, 56, 54), (36, 36, 40), TAN, BLACK_HAIR, carries="backpack",
        second=(40, 110, 214), sleeves="short",
    ),
    Outfit(
        (224, 222, 218), (138, 104, 70), (60, 70, 140), LIGHT, BROWN_HAIR, "stripes",
        (150, 70, 36), long_hair=True,
    ),
    Outfit(
        (168, 132, 62), (104, 128, 150), (44, 60, 84), BROWN, BLACK_HAIR, cut="shorts",
        sleeves="short",
    ),
    Outfit((122, 54, 112), (42, 40, 44), (30, 30, 30), LIGHT, GREY_HAIR, cut="coat"),
    Outfit(
        (40, 124, 226), (92, 84, 80), (220, 220, 220), TAN, BROWN_HAIR, carries="backpack",
        second=(50, 50, 56),
    ),
    Outfit(
        (96, 150, 72), (64, 58, 110), (36, 36, 40), LIGHT, BLOND_HAIR, "stripes",
        (226, 232, 230), cut="skirt", long_hair=True,
    ),
)  # fmt: skip
"""Every two of them differ clearly in the colour of the upper body."""
