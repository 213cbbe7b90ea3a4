"""What the evidence says of one track, and the template that stands for it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from heel.services.tracker.evidence.arrays import Box, Foot, box_at
from heel.services.tracker.people.geometry import FloatArray

_SIDE = 0.03
"""Share of the width by which a person's box exceeds the silhouette on each side, as arms reach
out; chosen by hand."""
_BELOW = 0.02
"""Share of the height by which it exceeds the foot point, as the nearer foot stands lower; chosen
by hand."""
_GAINS = 60
"""Gains kept, of the last frames in view, for the median before a newcomer: two to four seconds at
15 to 30 frames a second; chosen by hand."""


@dataclass(eq=False)
class Silhouette:
    """A template of a person, `height` working pixels high, with its foot point at `foot`.

    Attributes:
        id: number of its birth, from 1.
        confirmed: whether the track is taken for a person.
        birth_height: height at birth.
        missed_frames: frames in a row in which it was not seen.
        moved: distance from the place of birth, in heights.
        hits: frames in which it was seen.
        gain: of the fit in this frame, see `canvas.Fit`.
        best_gain: so far.
        visibility: mean of the evidence under the silhouette.
        inside: share of the silhouette inside the image.
        in_view: share of the silhouette that no nearer person covers.
        fitted_foot: where the template was placed in this frame.
        moving_hits: frames in which it was seen and moved.
        duplicate_s: for how long others have explained all of this person's evidence.
        still_s: for how long nothing has moved where the person is seen.
        born_early: when the background was hardly known.
        gains: the last ones while no other person covered this one.
    """

    id: int
    foot: Foot
    height: float
    gain: float
    confirmed: bool = False
    birth_height: float = 0.0
    missed_frames: int = 0
    moved: float = 0.0
    hits: int = 1
    best_gain: float = 0.0
    visibility: float = 0.0
    inside: float = 1.0
    in_view: float = 1.0
    fitted_foot: Foot = (0.0, 0.0)
    moving_hits: int = 0
    duplicate_s: float = 0.0
    still_s: float = 0.0
    born_early: bool = False
    gains: deque[float] = field(default_factory=lambda: deque(maxlen=_GAINS))

    def box(self, ratio: float) -> Box:
        """xyxy, working pixels; `ratio` is width by height."""
        return box_at(self.foot, self.height, ratio)

    def moved_from(self, birthplace: FloatArray, working: Working) -> float:
        """Distance of the foot point from that at birth, in heights.

        Args:
            birthplace: (2,) centre of the box then, pixels of the frame, warped with the camera.
        """
        x = float(birthplace[0]) / working.scale_x
        centre = float(birthplace[1]) / working.scale_y
        birth_foot = x, centre + (0.5 * (1.0 + _BELOW) - _BELOW) * self.birth_height
        return self.distance(birth_foot)

    def distance(self, foot: Foot) -> float:
        """In heights of the person."""
        return math.dist(self.foot, foot) / self.height


@dataclass(frozen=True)
class Working:
    """Working pixels of the evidence map and pixels of the frame."""

    columns: int
    rows: int
    scale_x: float
    scale_y: float

    def place(self, mean: FloatArray) -> tuple[Foot, float]:
        """Foot point and height of the silhouette of a track's state (4, 2)."""
        x, y, log_height, _ = mean[:, 0].tolist()
        box_height = math.exp(log_height)
        height = box_height / (1.0 + _BELOW) / self.scale_y
        bottom = (y + 0.5 * box_height) / self.scale_y
        return (x / self.scale_x, bottom - _BELOW * height), height

    def measurement(self, foot: Foot, height: float, ratio: float) -> list[float]:
        """The box of a silhouette as of `boxes_to_measurements`, in pixels of the frame."""
        box_height = height * (1.0 + _BELOW) * self.scale_y
        bottom = (foot[1] + _BELOW * height) * self.scale_y
        width = height * ratio * (1.0 + 2.0 * _SIDE) * self.scale_x
        return [
            foot[0] * self.scale_x,
            bottom - 0.5 * box_height,
            math.log(box_height),
            math.log(width / box_height),
        ]
