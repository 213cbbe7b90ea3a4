"""A person's box as a camera sees it, and what each edge of it says of their distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from heel.services.geometry.camera import GroundCamera, Pinhole

_FARTHEST_M = 1000.0
"""Distances end here, so that horizons and slopes of zero stay finite; any robot is far from it."""
_TALL_SIGMAS = 3.0
"""The tallest person is so many standard deviations of human height above the mean: one in a
thousand is taller."""


@dataclass(frozen=True, slots=True)
class PersonModel:
    """What is assumed of people and their boxes.

    Attributes:
        height_m, height_sigma_m: of people (95 % of adults are within 0.2 m of 1.7).
        width_m: of their boxes while they stand: of narrow adults, and of children of 1.3 m.
        width_known: whether that was learned of this person, or is assumed of everybody.
        edge_sigma_px, edge_sigma_share: an edge of a box is that many pixels wrong, plus that
            share of the box's height.
        pitch_sigma_rad: how much a robot rocks; each 0.01 rad moves a person who is 3 m away
            from a camera 0.8 m high by 0.12 m.
        border_share: an edge so near to the picture's border, as a share of the picture's height,
            is cut off: trackers smooth edges, and smoothed ones only come near it.
    """

    height_m: float = 1.7
    height_sigma_m: float = 0.1
    width_m: float = 0.4
    width_known: bool = False
    edge_sigma_px: float = 1.5
    edge_sigma_share: float = 0.02
    pitch_sigma_rad: float = 0.01
    border_share: float = 0.015


@dataclass(frozen=True, slots=True)
class PersonBox:
    """One box with an area, at least partly in the picture.

    Distances are along the ground, in metres, and infinite where an edge tells none.

    Attributes:
        left, top, right, bottom: in pixels.
        camera: mounted, for what rests on the ground.
    """

    left: float
    top: float
    right: float
    bottom: float
    camera: Pinhole
    model: PersonModel

    @classmethod
    def of(cls, box_xyxy: Sequence[float], camera: Pinhole, model: PersonModel) -> Self | None:
        """The box, or None without area or outside the picture; NaN fails every comparison."""
        left, top, right, bottom = box_xyxy
        across = left < right and right > 0 and left < camera.width_px
        if across and top < bottom and bottom > 0 and top < camera.height_px:
            return cls(left, top, right, bottom, camera, model)
        return None

    @property
    def _border_px(self) -> float:
        return self.model.border_share * self.camera.height_px

    @property
    def head_seen(self) -> bool:
        """Whether the upper edge is one, and not the picture's border."""
        return self.top > self._border_px

    @property
    def feet_seen(self) -> bool:
        """Whether the lower edge is one, and not the picture's border."""
        return self.bottom < self.camera.height_px - self._border_px

    @property
    def sunk(self) -> bool:
        """Whether the lower border cuts off somebody whose head is in the lower half.

        Nobody who stands a few metres away from a robot looks like that.
        """
        return not self.feet_seen and self.top > self.camera.centre_y_px

    @property
    def both_sides_seen(self) -> bool:
        """Whether the box is as wide as it would be in a larger picture."""
        border_px = self._border_px
        return self.left > border_px and self.right < self.camera.width_px - border_px

    @property
    def lower_slope(self) -> float:
        """Of the lower edge, or of the picture's border if that cuts it off."""
        return self.camera.slope(self._middle_px, self.bottom)

    @property
    def _middle_px(self) -> float:
        return (self.left + self.right) / 2

    @property
    def _edge_px(self) -> float:
        return self.model.edge_sigma_px + self.model.edge_sigma_share * (self.bottom - self.top)

    def bearing_rad(self) -> float:
        """Of the feet where they are seen; left is positive."""
        row_px = self.bottom if self.feet_seen else (self.top + self.bottom) / 2
        return self.camera.bearing_rad(self._middle_px, row_px)

    def bearing_sigma_rad(self) -> float:
        """Both sides are seen: of their mean; one is cut off: half the box may be missing, too."""
        off_px = 0.0 if self.both_sides_seen else (self.right - self.left) / 2
        return math.hypot(self._edge_px / math.sqrt(2), off_px) / self.camera.focal_px

    def height_m(self) -> float:
        """Of somebody of the assumed height whose box this is; who shows less of them is nearer."""
        span = self.lower_slope - self.camera.slope(self._middle_px, self.top)
        return self.model.height_m / span if span > self.model.height_m / _FARTHEST_M else math.inf

    def height_noise(self) -> float:
        """Standard deviation of the box's height, as a share of it."""
        return math.sqrt(2) * self._edge_px / (self.bottom - self.top)

    def height_share(self) -> float:
        """Standard deviation of `height_m`, as a share of it."""
        return math.hypot(self.model.height_sigma_m / self.model.height_m, self.height_noise())

    def width_m(self) -> float:
        """Of somebody of the model's width whose box this is."""
        depth_m = self.model.width_m * self.camera.focal_px / (self.right - self.left)
        ahead, aside, _ = self.camera.ray(self._middle_px, (self.top + self.bottom) / 2)
        return min(depth_m * math.hypot(ahead, aside), _FARTHEST_M)

    def wide_m(self, distance_m: float) -> float:
        """How wide somebody at a distance is whose box this is."""
        return self.model.width_m * distance_m / self.width_m()

    def feet_m(self) -> float:
        """Of feet on the ground at the lower edge; who hides theirs is nearer."""
        camera = self.camera
        if not isinstance(camera, GroundCamera) or not 0 < self.lower_slope < math.inf:
            return math.inf
        return min(camera.mount_height_m / self.lower_slope, _FARTHEST_M)

    def farthest_m(self) -> float:
        """Where the ends that are cut off would come into the picture; infinite if none is."""
        camera, model, farthest_m = self.camera, self.model, math.inf
        if not isinstance(camera, GroundCamera):
            return farthest_m
        tallest_m = model.height_m + _TALL_SIGMAS * model.height_sigma_m
        over_camera_m = tallest_m - camera.mount_height_m
        highest = camera.slope(self._middle_px, self._border_px)
        lowest = camera.slope(self._middle_px, camera.height_px - self._border_px)
        if not self.head_seen and over_camera_m > 0 and highest < 0:
            farthest_m = over_camera_m / -highest
        if not self.feet_seen and lowest > 0:
            farthest_m = min(farthest_m, camera.mount_height_m / lowest)
        return farthest_m

    def shorter_by(self) -> tuple[float, float]:
        """How much lower the head is seen than an adult's whose feet are at the lower edge.

        Returns:
            A difference of slopes, and its standard deviation; (0, infinity) where nothing tells.
        """
        camera, model, feet_m = self.camera, self.model, self.feet_m()
        if not isinstance(camera, GroundCamera) or feet_m == math.inf:
            return 0.0, math.inf
        share = 1.0 - model.height_m / camera.mount_height_m
        lower, upper = self.lower_slope, camera.slope(self._middle_px, self.top)
        sigmas = (
            (1 + upper**2) * self._edge_px / camera.focal_px,
            share * (1 + lower**2) * self._edge_px / camera.focal_px,
            model.height_sigma_m / feet_m,
            (1 - share) * model.pitch_sigma_rad,
        )
        return upper - share * lower, math.hypot(*sigmas)

    def least_squares(self, feet: bool, head: bool) -> tuple[float, float] | None:
        """Distance and its standard deviation by the edges named; None if they tell none.

        The height's error scales with 1/d, hence three rounds.
        """
        camera, model = self.camera, self.model
        if not isinstance(camera, GroundCamera):
            return None
        used = [
            (camera.slope(self._middle_px, row_px), camera.mount_height_m - top_m, float(top_m > 0))
            for use, row_px, top_m in (
                (feet, self.bottom, 0.0), (head, self.top, model.height_m)
            )
            if use
        ]  # fmt: skip
        slopes, falls, height_share = (np.array(values) for values in zip(*used, strict=True))
        if not np.isfinite(slopes).all():
            return None
        edges = (1 + slopes**2) * self._edge_px / camera.focal_px
        # Pitch moves an angle; slope is its tangent.
        pitch = (1 + slopes**2) * model.pitch_sigma_rad
        inverse_m, variance = 0.3, math.inf
        for _ in range(3):
            height = height_share * (model.height_sigma_m * inverse_m)
            covariance = np.diag(edges**2 + height**2) + np.outer(pitch, pitch)
            weights = np.linalg.solve(covariance, falls)
            information = float(weights @ falls)
            if information <= 0:
                return None
            inverse_m = float(weights @ slopes) / information
            variance = 1.0 / information
            if inverse_m <= 1.0 / _FARTHEST_M:
                return None
        return 1.0 / inverse_m, math.sqrt(variance) / inverse_m**2
