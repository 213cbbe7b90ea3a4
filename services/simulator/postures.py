"""What is seen of people that do not stand upright, as shares of their stature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Posture = Literal[
    "upright", "bent", "tying shoes", "crouching", "seated", "on the ground", "lying",
    "in a wheelchair",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Shape:
    """A body's outline.

    Attributes:
        tall: upper end above the ground, as a share of the stature.
        wide: width of the box, likewise.
    """

    tall: float
    wide: float


SHAPES: dict[Posture, Shape] = {
    "upright": Shape(1.0, 0.28),
    "bent": Shape(0.62, 0.32),
    "tying shoes": Shape(0.55, 0.32),
    "crouching": Shape(0.52, 0.33),
    "seated": Shape(0.74, 0.3),
    "on the ground": Shape(0.47, 0.38),
    # Across the line of sight it would be 1, along it 0.28.
    "lying": Shape(0.18, 0.7),
    "in a wheelchair": Shape(0.76, 0.4),
}
"""Estimated from photographs; heights of seated people after anthropometric tables (Pheasant)."""
UPRIGHT = SHAPES["upright"]
CHANGE_PER_S = 0.6
"""Of `tall`: down into a crouch in 0.8 s. A person that falls is at the mercy of gravity."""
FALL_PER_S = 1.6
"""Of `tall`: from upright to the floor in about 0.6 s, somewhat slower than free fall."""
