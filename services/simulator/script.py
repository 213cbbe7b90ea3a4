"""What an episode is made of: scenery, robot, people with their ways, light and camera."""

from __future__ import annotations

from dataclasses import dataclass

from heel.services.simulator.state import Outfit, RobotState, Role, Scenery
from heel.services.simulator.walks import Walk


@dataclass(frozen=True, slots=True)
class Actor:
    """One person at the start, and where they mean to go.

    Attributes:
        carries: whether the person has a box before the chest.
    """

    role: Role
    x_m: float
    y_m: float
    heading_rad: float
    height_m: float
    radius_m: float
    stride_rad: float
    outfit: Outfit
    walk: Walk
    carries: bool = False


@dataclass(frozen=True, slots=True)
class Scenario:
    """One episode before it begins.

    Attributes:
        people: ids are positions plus 1; exactly one is the target.
        lights: (from t_s on, brightness), in order of time; 1 before the first.
        dropouts: (from t_s, until t_s) without pictures.
    """

    name: str
    duration_s: float
    scenery: Scenery
    robot: RobotState
    people: tuple[Actor, ...]
    lights: tuple[tuple[float, float], ...] = ()
    dropouts: tuple[tuple[float, float], ...] = ()
