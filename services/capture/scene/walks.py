"""Where people walk: choreographies in seconds and ground positions, turned into stances."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heel.services.capture.scene.figure import STRIDE_M, Stance
from heel.services.capture.scene.projection import GroundCamera

OUTSIDE = 1.45
"""Where people wait out of sight with their shadows, in half widths of the picture."""

_GRID_HZ = 50.0
"""Places a second at which a walk is laid out; chosen by hand."""


@dataclass(frozen=True)
class Walk:
    """One person's way.

    Attributes:
        start_s: when the person leaves the first point.
        speed_mps: walking speed.
        points: (u, z_m): u is -1 at the left edge of the picture and 1 at the right edge.
        pauses_s: seconds spent standing at a point, by its index.
    """

    start_s: float
    speed_mps: float
    points: tuple[tuple[float, float], ...]
    pauses_s: dict[int, float] = field(default_factory=dict)


DEMO = (
    # Leaves on the right and comes back the other way.
    Walk(0.2, 1.4, ((-OUTSIDE, 7.0), (OUTSIDE, 7.4), (OUTSIDE, 6.6), (-OUTSIDE, 6.8)), {1: 1.5}),
    # Crosses the first near the middle.
    Walk(0.0, 1.35, ((OUTSIDE, 8.3), (-OUTSIDE, 8.6))),
    # Stops and stands for six seconds.
    Walk(0.8, 1.3, ((-OUTSIDE, 10.4), (-0.12, 10.0), (OUTSIDE, 11.2)), {1: 6.0}),
    # Comes from behind and passes the one that stands.
    Walk(1.6, 1.25, ((OUTSIDE, 12.4), (-0.05, 10.9), (-OUTSIDE, 8.0))),
    # Walks towards the camera.
    Walk(3.4, 1.4, ((OUTSIDE, 13.0), (0.15, 11.6), (-0.3, 6.6), (-1.6, 5.6))),
    # Two that walk side by side and never part.
    Walk(6.2, 1.35, ((-OUTSIDE, 9.2), (OUTSIDE, 8.8))),
    Walk(6.2, 1.35, ((-OUTSIDE, 9.8), (OUTSIDE, 9.4))),
)

# Metres and metres per second, chosen by hand.
CROSSING = (
    Walk(0.4, 1.4, ((-OUTSIDE, 7.2), (OUTSIDE, 7.2))),
    Walk(0.4, 1.4, ((OUTSIDE, 7.6), (-OUTSIDE, 7.6))),
)

PACING = (Walk(0.0, 1.2, ((-0.6, 7.0), (0.6, 7.2), (-0.6, 7.0))),)
"""A person that never leaves the picture: a robot has one to follow at any time."""


def choose_walks(script: tuple[Walk, ...], people: int, rng: np.random.Generator) -> list[Walk]:
    """The first `people` walks of a script; further ones cross the picture at random."""
    walks = list(script[:people])
    while len(walks) < people:
        side = float(rng.choice((-1.0, 1.0)))
        near, far = rng.uniform(6.2, 13.0, 2)
        points = ((side * OUTSIDE, float(near)), (-side * OUTSIDE, float(far)))
        walks.append(Walk(float(rng.uniform(0.0, 9.0)), float(rng.uniform(1.1, 1.6)), points))
    return walks


class Path:
    """A walk sampled at 50 Hz with rounded corners, repeated with the period of the scene.

    Args:
        walk: the way.
        camera: turns picture edges into metres.
        period_s: the whole scene repeats after it; not shorter than `duration_s(walk)`.
        rng: gives stature and the phase of the first step.
    """

    def __init__(
        self, walk: Walk, camera: GroundCamera, period_s: float, rng: np.random.Generator
    ) -> None:
        self._period_s = period_s
        times, places = _timetable(walk, camera)
        grid = np.arange(0.0, period_s, 1.0 / _GRID_HZ)
        raw = np.stack([np.interp(grid, times, places[:, axis]) for axis in (0, 1)])
        self._places = np.stack([_smooth(line, 0.5) for line in raw])
        step = np.gradient(self._places, axis=1) * _GRID_HZ
        speed = np.hypot(step[0], step[1])
        self._swing = np.clip(speed / walk.speed_mps, 0.0, 1.0)
        self._heading = _smooth(_headings(step, speed), 0.6)
        distance = np.cumsum(speed) / _GRID_HZ
        self._stature = float(rng.uniform(0.93, 1.05))
        first = float(rng.uniform(0.0, 2.0 * np.pi))
        self._phase = first + 2.0 * np.pi * distance / (STRIDE_M * self._stature)

    def stance(self, time_s: float) -> Stance:
        """Where the person is at `time_s` since the start of the scene."""
        position = min(int((time_s % self._period_s) * _GRID_HZ + 0.5), len(self._phase) - 1)
        x_m, z_m = self._places[:, position].tolist()
        return Stance(
            x_m,
            z_m,
            float(self._heading[position]),
            float(self._phase[position]),
            float(self._swing[position]),
            self._stature,
        )


def duration_s(walk: Walk, camera: GroundCamera) -> float:
    """When the person has reached the last point."""
    return float(_timetable(walk, camera)[0][-1])


def _timetable(walk: Walk, camera: GroundCamera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times in seconds (N,) and places X, Z in metres (N, 2) of a walk's corners."""
    places = np.array([(u * camera.half_width_m(z), z) for u, z in walk.points])
    times, stops = [walk.start_s], [places[0]]
    for index, place in enumerate(places[1:], start=1):
        distance = float(np.hypot(*(place - stops[-1])))
        times.append(times[-1] + distance / walk.speed_mps)
        stops.append(place)
        if pause_s := walk.pauses_s.get(index):
            times.append(times[-1] + pause_s)
            stops.append(place)
    return np.array(times), np.stack(stops)


def _smooth(values: NDArray[np.float64], window_s: float) -> NDArray[np.float64]:
    """Moving average over `window_s`, ends held."""
    length = round(window_s * _GRID_HZ) // 2 * 2 + 1
    padded = np.pad(values, length // 2, mode="edge")
    return np.convolve(padded, np.full(length, 1.0 / length), mode="valid")


def _headings(step: NDArray[np.float64], speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Walking direction in radians without jumps; a person that stands keeps the last one."""
    moving = np.flatnonzero(speed > 0.15)
    if moving.size == 0:
        return np.zeros(speed.size)
    angles = np.unwrap(np.arctan2(step[1, moving], step[0, moving]))
    last = np.maximum(np.searchsorted(moving, np.arange(speed.size), side="right") - 1, 0)
    return np.asarray(angles[last], np.float64)
