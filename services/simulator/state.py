"""What there is in the simulated world: the words that world, sensors and renderer share.

Right-handed, metres and radians: x and y on the floor, z up; heading 0 looks along x, left is
positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from heel.services.simulator.postures import UPRIGHT

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""
Role = Literal["target", "twin", "other"]
ObstacleKind = Literal["wall", "pillar", "furniture"]
Look = Literal["plain", "drawn person", "clothes", "coat stand", "glass"]
"""What an obstacle looks like: what belongs to its kind; somebody life-size on paper; painted in
the colours of clothes; a stand with a coat and a hat; a pane that mirrors people."""
Floor = Literal["tiles", "wood", "asphalt", "grass"]


CARDBOARD: Colour = (178, 134, 86)
"""Of boxes that people carry; chosen by hand."""
CARRIED_M = 0.4
"""Side of such a box, a cube; chosen by hand: what one carries in both arms."""


@dataclass(frozen=True, slots=True)
class Outfit:
    """What a person wears."""

    hair: Colour
    skin: Colour
    top: Colour
    legs: Colour
    shoes: Colour


@dataclass(frozen=True, slots=True)
class PersonState:
    """One person at one moment.

    Attributes:
        stride_rad: phase of the walking cycle, 2 pi a double step; stands still with the speed.
        height_m: stature.
        radius_m: of the body as a disc, for contacts and ranges.
        tall, wide: upper end above the ground and width of the body now, as shares of the stature.
        carries: whether the person has a box before the chest.
    """

    id: int
    role: Role
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    stride_rad: float
    height_m: float
    radius_m: float
    outfit: Outfit
    tall: float = UPRIGHT.tall
    wide: float = UPRIGHT.wide
    carries: bool = False


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot at one moment; velocities are those it really has."""

    x_m: float
    y_m: float
    heading_rad: float
    linear_mps: float
    angular_radps: float


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An upright box standing on the floor; `length_m` along its heading."""

    kind: ObstacleKind
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    width_m: float
    height_m: float
    colour: Colour
    look: Look = "plain"


@dataclass(frozen=True, slots=True)
class Scenery:
    """What does not move.

    Attributes:
        bounds_m: least x, least y, greatest x, greatest y.
        indoors: whether a room is around it (walls are obstacles, too) or open ground.
    """

    bounds_m: tuple[float, float, float, float]
    indoors: bool
    floor: Floor
    obstacles: tuple[Obstacle, ...]


@dataclass(frozen=True, slots=True)
class CameraMount:
    """The robot's camera: a pinhole with square pixels above the robot's centre, looking ahead.

    Attributes:
        pitch_rad: down is positive.
    """

    width_px: int = 640
    height_px: int = 480
    fps: float = 20.0
    horizontal_fov_rad: float = 1.5708
    height_m: float = 0.8
    pitch_rad: float = 0.0


class WorldView(Protocol):
    """What sensors and the renderer may read of a world."""

    @property
    def t_s(self) -> float:
        """Simulated time since the start."""

    @property
    def scenery(self) -> Scenery:
        """What does not move."""

    @property
    def robot(self) -> RobotState:
        """The robot now."""

    @property
    def robot_radius_m(self) -> float:
        """The robot's body is a disc."""

    @property
    def people(self) -> tuple[PersonState, ...]:
        """All people, by id."""

    @property
    def brightness(self) -> float:
        """Of all light, 1 is normal; a light switch changes it."""

    @property
    def camera_on(self) -> bool:
        """False while the camera drops out."""
