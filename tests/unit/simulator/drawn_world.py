"""A world that stands still, for tests of what is drawn of it."""

from __future__ import annotations

from dataclasses import dataclass

from heel.services.simulator.state import Obstacle, Outfit, PersonState, RobotState, Scenery

OUTFIT = Outfit(
    hair=(30, 20, 200), skin=(40, 30, 220), top=(20, 20, 250), legs=(30, 30, 230),
    shoes=(10, 10, 255),
)  # fmt: skip
"""All blue, so that the figure can be told from grass by its colour."""
MEADOW = Scenery((-15.0, -15.0, 25.0, 15.0), False, "grass", ())
WALL = Obstacle("wall", 8.0, 0.0, 1.5708, 12.0, 0.2, 2.6, (230, 225, 215))
ROOM = Scenery((-6.0, -6.0, 8.0, 6.0), True, "tiles", (WALL,))


STANDING = RobotState(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class StillWorld:
    """A `WorldView` of given things."""

    people: tuple[PersonState, ...] = ()
    scenery: Scenery = MEADOW
    robot: RobotState = STANDING
    t_s: float = 0.0
    brightness: float = 1.0
    camera_on: bool = True
    robot_radius_m: float = 0.25


def person(
    x_m: float, y_m: float, heading_rad: float = 0.0, speed_mps: float = 0.0,
    stride_rad: float = 0.0, height_m: float = 1.75, outfit: Outfit = OUTFIT, number: int = 1,
) -> PersonState:  # fmt: skip
    """Somebody at a place."""
    return PersonState(
        number, "other", x_m, y_m, heading_rad, speed_mps, stride_rad, height_m, 0.25, outfit
    )
