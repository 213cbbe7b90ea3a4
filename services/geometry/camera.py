"""Cameras, with and without a lens that distorts or a known mounting, and what they see of flat
ground.

Ground frame: origin on the ground below the camera, x ahead, y to the left, z up, metres.
Picture: u to the right, v down, pixels, origin at the top left corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heel.schemas import CameraInfo
from heel.services.geometry.lens import Lens

FloatArray = NDArray[np.float64]
_LEAST_DEPTH_M = 1e-6
"""What is no farther in front of the lens than this has no place in the picture: a guard against
division by zero."""
_PERSON_WIDTH_M = 0.5
"""Of a box of an adult, seen from any side, without a stride; chosen by hand."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera with no roll, mounted nobody knows how; of square pixels unless it has a lens.

    Attributes:
        focal_px: focal length in pixels.
        centre_x_px, centre_y_px: principal point; the middle of the picture unless given.
        lens: its distortion; rays then go by it alone.
    """

    width_px: int
    height_px: int
    focal_px: float
    centre_x_px: float = math.nan
    centre_y_px: float = math.nan
    lens: Lens | None = None

    def __post_init__(self) -> None:
        if not (self.width_px > 0 and self.height_px > 0 and 0 < self.focal_px < math.inf):
            raise ValueError(
                f"camera of {self.width_px}x{self.height_px} pixels and focal length "
                f"{self.focal_px:g} px: all must be above 0"
            )
        if math.isnan(self.centre_x_px):
            object.__setattr__(self, "centre_x_px", self.width_px / 2)
        if math.isnan(self.centre_y_px):
            object.__setattr__(self, "centre_y_px", self.height_px / 2)

    @classmethod
    def from_fov(cls, width_px: int, height_px: int, horizontal_fov_rad: float) -> Self:
        """A camera of a stated horizontal field of view, in (0, pi)."""
        return cls(width_px, height_px, focal_length_px(width_px, horizontal_fov_rad))

    @classmethod
    def through(cls, lens: Lens, width_px: int, height_px: int) -> Self:
        """A camera with a lens."""
        return cls(width_px, height_px, lens.focal_px[0], *lens.centre_px, lens)

    @property
    def horizontal_fov_rad(self) -> float:
        """Angle between the left and the right border."""
        row_px = self.centre_y_px
        left, right = self.across_and_down(0.0, row_px), self.across_and_down(self.width_px, row_px)
        return math.atan(right[0]) - math.atan(left[0])

    def mounted(self, mount_height_m: float, pitch_rad: float) -> GroundCamera:
        """The same camera, its mounting known."""
        return GroundCamera(
            self.width_px, self.height_px, self.focal_px, self.centre_x_px, self.centre_y_px,
            self.lens, mount_height_m, pitch_rad,
        )  # fmt: skip

    def across_and_down(self, u_px: float, v_px: float) -> tuple[float, float]:
        """Ray of a pixel: to the right and down, 1 deep along the optical axis."""
        if self.lens is not None:
            right, down = self.lens.rays((u_px, v_px)).tolist()
            return right, down
        return (u_px - self.centre_x_px) / self.focal_px, (v_px - self.centre_y_px) / self.focal_px

    def ray(self, u_px: float, v_px: float) -> tuple[float, float, float]:
        """Direction (x, y, z) of a pixel, 1 deep along the optical axis; the camera held level."""
        right, down = self.across_and_down(u_px, v_px)
        return 1.0, -right, -down

    def bearing_rad(self, u_px: float, v_px: float) -> float:
        """Angle of a pixel from straight ahead, left is positive."""
        ahead, left, _ = self.ray(u_px, v_px)
        return math.atan2(left, ahead)

    def slope(self, u_px: float, v_px: float) -> float:
        """How far the ray of a pixel falls per metre along the ground; above the horizon negative.

        Infinite for a ray that points straight down or up.
        """
        ahead, left, up = self.ray(u_px, v_px)
        along = math.hypot(ahead, left)
        return -up / along if along else math.copysign(math.inf, -up)


@dataclass(frozen=True, slots=True)
class GroundCamera(Pinhole):
    """A pinhole camera whose height above flat ground and pitch are known.

    Attributes:
        mount_height_m: of the camera above ground, above 0.
        pitch_rad: down is positive, less than a right angle.
    """

    mount_height_m: float = math.nan
    pitch_rad: float = 0.0

    def __post_init__(self) -> None:
        Pinhole.__post_init__(self)
        if not 0 < self.mount_height_m < math.inf:
            raise ValueError(f"camera {self.mount_height_m:g} m above ground: must be above 0")
        if not abs(self.pitch_rad) < math.pi / 2:
            raise ValueError(f"camera pitched by {self.pitch_rad:g} rad: must be within pi/2")

    @property
    def horizon_px(self) -> float:
        """Row of the horizon in the middle of the picture, a lens apart."""
        return self.centre_y_px - self.focal_px * math.tan(self.pitch_rad)

    def ray(self, u_px: float, v_px: float) -> tuple[float, float, float]:
        """Direction (x, y, z) of a pixel in the ground frame, 1 deep along the optical axis."""
        right, down = self.across_and_down(u_px, v_px)
        sine, cosine = math.sin(self.pitch_rad), math.cos(self.pitch_rad)
        return cosine - down * sine, -right, -sine - down * cosine

    def pixels(self, points: ArrayLike) -> FloatArray:
        """(..., 3) points x, y, z to (..., 2) pixels; NaN for what is not before the camera."""
        x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
        sine, cosine = math.sin(self.pitch_rad), math.cos(self.pitch_rad)
        below = self.mount_height_m - z
        depth = x * cosine + below * sine
        deep = np.where(depth > _LEAST_DEPTH_M, depth, np.nan)
        down = below * cosine - x * sine
        if self.lens is not None:
            return self.lens.pixels(np.stack([-y / deep, down / deep], axis=-1))
        scale = self.focal_px / deep
        return np.stack([self.centre_x_px - scale * y, self.centre_y_px + scale * down], axis=-1)

    def ground(self, pixels: ArrayLike) -> FloatArray:
        """(..., 2) pixels to (..., 2) points x, y of the ground; NaN at and above the horizon."""
        ahead, left, fall = self.rays(np.asarray(pixels, np.float64))
        reach = self.mount_height_m / np.where(fall > 1e-9, fall, np.nan)
        return np.stack([ahead * reach, left * reach], axis=-1)

    def person_boxes(
        self, ground: ArrayLike, height_m: ArrayLike, width_m: ArrayLike = _PERSON_WIDTH_M
    ) -> FloatArray:
        """Boxes of people who stand upright on the ground, not cut at the picture's borders.

        Args:
            ground: (..., 2) x, y of their feet.
            height_m: of the people, a number or (...).
            width_m: of the people, a number or (...).

        Returns:
            (..., 4) left, top, right, bottom; NaN for who is not before the camera.
        """
        feet = np.asarray(ground, np.float64)
        height = np.broadcast_to(np.asarray(height_m, np.float64), feet.shape[:-1])
        bottom = self.pixels(np.concatenate([feet, np.zeros_like(feet[..., :1])], axis=-1))
        top = self.pixels(np.concatenate([feet, height[..., None]], axis=-1))
        middle = (bottom[..., 0] + top[..., 0]) / 2
        depth = feet[..., 0] * math.cos(self.pitch_rad) + (
            self.mount_height_m - height / 2
        ) * math.sin(self.pitch_rad)
        half = self.focal_px * np.asarray(width_m, np.float64) / (2 * depth)
        rows = np.sort(np.stack([top[..., 1], bottom[..., 1]], axis=-1), axis=-1)
        return np.stack([middle - half, rows[..., 0], middle + half, rows[..., 1]], axis=-1)

    def person_height_px(self, feet: ArrayLike, height_m: ArrayLike) -> FloatArray:
        """(...) height in pixels of people whose feet are seen at (..., 2) pixels.

        NaN where the feet are at or above the horizon.
        """
        boxes = self.person_boxes(self.ground(feet), height_m)
        return np.asarray(boxes[..., 3] - boxes[..., 1], np.float64)

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Ahead, left and fall (down) of the rays of (..., 2) pixels, 1 deep."""
        if self.lens is not None:
            right, down = np.moveaxis(self.lens.rays(pixels), -1, 0)
        else:
            right = (pixels[..., 0] - self.centre_x_px) / self.focal_px
            down = (pixels[..., 1] - self.centre_y_px) / self.focal_px
        sine, cosine = math.sin(self.pitch_rad), math.cos(self.pitch_rad)
        return cosine - down * sine, -right, sine + down * cosine


def focal_length_px(width_px: int, horizontal_fov_rad: float) -> float:
    """Focal length of a pinhole camera with square pixels.

    Raises:
        ValueError: the field of view is not between 0 and pi.
    """
    if not 0 < horizontal_fov_rad < math.pi:
        raise ValueError(f"field of view of {horizontal_fov_rad:g} rad: must be in (0, pi)")
    return width_px / (2.0 * math.tan(horizontal_fov_rad / 2.0))


def resized(info: CameraInfo, width_px: int, height_px: int) -> CameraInfo:
    """The same camera with pictures of another size."""
    lens = info.lens
    if lens is not None:
        factors = width_px / info.width, height_px / info.height
        lens = Lens.told(lens).scaled(*factors).model()
    return info.model_copy(update={"width": width_px, "height": height_px, "lens": lens})


def camera_from_info(info: CameraInfo, horizontal_fov_rad: float | None = None) -> Pinhole | None:
    """The camera as its capture describes it: mounted if height and pitch are known.

    Args:
        info: what is known of the camera.
        horizontal_fov_rad: to be used where the camera does not state its own.

    Returns:
        None where nothing tells the field of view.
    """
    fov_rad = info.horizontal_fov_rad or horizontal_fov_rad
    if info.lens is not None:
        camera = Pinhole.through(Lens.told(info.lens), info.width, info.height)
    elif fov_rad is not None:
        camera = Pinhole.from_fov(info.width, info.height, fov_rad)
    else:
        return None
    height_m, pitch_rad = info.mount_height_m, info.mount_pitch_rad
    if not height_m or pitch_rad is None or abs(pitch_rad) >= math.pi / 2:
        return camera
    return camera.mounted(height_m, pitch_rad)
