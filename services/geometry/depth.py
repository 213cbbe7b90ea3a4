"""Depth pictures: how far a person's body is, and what stands in the way.

A depth picture is (H, W) uint16: distances along the optical axis in millimetres, 0 where nothing
was measured. It shows what the camera's own picture shows, in as many or in fewer pixels.

A person's box also holds what is behind and before them, and pixels that are wrong. Of the region
where the body is, the distance at which most of it is counts (the fullest window of the sorted
distances), if somebody as large as the box would have the size of a person there: what is behind
would make a giant of them, what is close before the lens a dwarf. Minima and plain medians, which
other followers take, go to a hand before the body or to the wall beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from heel.schemas.robot import RangeSector
from heel.services.geometry.camera import FloatArray, GroundCamera, Pinhole

Depth = NDArray[np.uint16]

_ROWS = (0.12, 0.60)
"""Of a person's box, from its top, share of its height: from the neck to the hips."""
_COLUMNS = (0.2, 0.8)
"""Of the box, share of its width: without what shows beside the body."""
_WINDOW_M = 0.30
"""Of distances that one body shows: the depth of a chest with its arms; chosen by hand."""
_WINDOW_PER_M2 = 0.02
"""Wider by this times the distance squared, as the errors of stereo cameras are: four standard
deviations of an ordinary one."""
_LEAST_PIXELS = 12
"""Fewer depth pixels say nothing; chosen by hand: 3 by 4."""
_LEAST_SHARE = 0.25
"""Share of what was measured in the region that has to be at one distance; chosen by hand."""
_NEARER_SHARE = 0.7
"""A nearer surface with so much of the fullest one's pixels counts before it; chosen by hand: two
that are about as large are a person and a wall more often than a person and what hides them."""
_TALLEST_M = 2.4
"""Height of the largest box of a person, its slack included: a tall adult's."""
_SMALLEST_M = 0.5
"""Height of the smallest box of a whole person: a child's that sits."""
_CHEST_M = 0.11
"""From the front of a chest or the back to the middle of the body; half of a chest's depth."""
_SIGMA_M = 0.04
"""Standard deviation of that, as people turn; chosen by hand."""
_SIGMA_SHARE = 0.01
"""Standard deviation of what a depth camera's calibration errs, share of the distance: what makers
promise within some metres."""
_SPREAD_SHARE = 0.5
"""Of the spread of a body's pixels; their errors are alike over patches, so that their median is
hardly better than a few of them. Chosen by hand."""
_MOST_PIXELS = 2000
"""Of a region that are looked at; chosen by hand: more say the same."""
_SIDE_M = 0.05
"""Standard deviation of the middle of what is seen of a body from its middle; chosen by hand."""

_SECTOR_RAD = math.radians(2.5)
"""Width of a sector of ranges; chosen by hand: 9 cm at 2 m."""
_OVERLAP = 1.02
"""Sectors are told wider by this, so that no direction is between two of them by a rounding."""
_FLOOR_M = 0.06
"""What is lower above the floor is the floor: a threshold of a door."""
_FLOOR_PER_M = 0.025
"""And higher by so much a metre away: what a camera that is pitched by 1.5 degrees more sees of
it."""
_OVERHEAD_M = 1.5
"""What hangs higher is driven under; chosen by hand: no robot that follows is as tall."""
_NTH_NEAREST = 8
"""Pixel of a sector whose distance counts: nearer ones are strays at edges. Chosen by hand: at
320 by 240 a table's leg of 5 cm shows more at 3 m."""
_SEEN_SHARE = 0.3
"""Share of a sector's pixels on near floor that have to be measured for it to be free; chosen by
hand."""
_FLOOR_WITHIN_M = 4.0
"""Near floor: every depth camera measures as far."""
_MOST_COLUMNS = 320
"""Of a depth picture that are looked at for ranges; wider ones are thinned out."""


@dataclass(frozen=True, slots=True)
class BodyPlace:
    """Where a person's body was measured, from the camera.

    Attributes:
        distance_m: along the ground, to the middle of the body.
        bearing_rad: left is positive; None where the picture's border cuts the box at a side.
        distance_sigma_m, bearing_sigma_rad: standard deviations.
    """

    distance_m: float
    distance_sigma_m: float
    bearing_rad: float | None
    bearing_sigma_rad: float


def body_place(
    depth_mm: Depth, box_xyxy: Sequence[float], camera: Pinhole,
    hidden_by: Sequence[Sequence[float]] = (),
) -> BodyPlace | None:  # fmt: skip
    """How far a person is by the depth within their box.

    Args:
        depth_mm: (H, W) uint16.
        box_xyxy: of the person, pixels of the camera's picture.
        camera: that took the picture; `GroundCamera` where its mounting is known.
        hidden_by: boxes of people before this one.

    Returns:
        None where too little was measured, or nothing that can be a person with such a box.
    """
    scale_x, scale_y = depth_mm.shape[1] / camera.width_px, depth_mm.shape[0] / camera.height_px
    box = np.asarray(box_xyxy, np.float64) * (scale_x, scale_y, scale_x, scale_y)
    hides = [np.asarray(one, np.float64) * (scale_x, scale_y, scale_x, scale_y)
             for one in hidden_by]  # fmt: skip
    rows, columns, z_m = _body_pixels(depth_mm, box, hides)
    inner = _within(columns, box[0], box[2], _COLUMNS)
    whole = box[1] > 0 and box[3] < depth_mm.shape[0]
    size = camera.focal_px * scale_y / max(box[3] - box[1], 1.0)
    body = _fullest(np.sort(z_m[inner]), _SMALLEST_M * size if whole else 0.0, _TALLEST_M * size)
    if body is None:
        return None
    middle_m = float(np.median(body))
    spread_m = 1.4826 * float(np.median(np.abs(body - middle_m)))
    near = np.abs(z_m - middle_m) <= _window_m(middle_m) / 2
    row, column = float(np.median(rows[near])) + 0.5, float(np.median(columns[near])) + 0.5
    ahead, left, _ = camera.ray(column / scale_x, row / scale_y)
    distance_m = middle_m * math.hypot(ahead, left) + _CHEST_M
    sigma_m = math.hypot(_SIGMA_M, _SIGMA_SHARE * middle_m, _SPREAD_SHARE * spread_m)
    cut = box[0] <= 0 or box[2] >= depth_mm.shape[1]
    pixel_rad = 1.0 / (camera.focal_px * scale_x)
    return BodyPlace(
        distance_m, sigma_m, None if cut else math.atan2(left, ahead),
        math.hypot(_SIDE_M / distance_m, pixel_rad),
    )  # fmt: skip


def _body_pixels(
    depth_mm: Depth, box: FloatArray, hides: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows, columns and metres of what was measured in the region of the body."""
    height, width = depth_mm.shape
    left, right = (round(min(max(edge, 0.0), width)) for edge in (box[0], box[2]))
    top, bottom = max(box[1], 0.0), min(box[3], float(height))
    first, last = (round(top + share * (bottom - top)) for share in _ROWS)
    first = min(max(first, 0), height)
    last = min(max(last, first), height)
    step = max(1, math.ceil(math.sqrt((last - first) * max(right - left, 1) / _MOST_PIXELS)))
    part = depth_mm[first:last:step, left:right:step]
    measured = part > 0
    for one in hides:
        out_left, out_top, out_right, out_bottom = (
            math.ceil((edge - start) / step)
            for edge, start in zip(one, (left, first, left, first), strict=True)
        )
        measured[max(out_top, 0) : max(out_bottom, 0), max(out_left, 0) : max(out_right, 0)] = False
    rows, columns = measured.nonzero()
    z_m = np.asarray(part[measured] * 1e-3, np.float64)
    return first + rows * float(step), left + columns * float(step), z_m


def _within(
    places: FloatArray, start: float, end: float, shares: tuple[float, float]
) -> NDArray[np.bool_]:
    low, high = (start + share * (end - start) for share in shares)
    return np.asarray((places + 0.5 >= low) & (places + 0.5 <= high), np.bool_)


def _window_m(distance_m: float) -> float:
    return _WINDOW_M + _WINDOW_PER_M2 * distance_m * distance_m


def _fullest(z_m: FloatArray, from_m: float, to_m: float) -> FloatArray | None:
    """Of sorted distances those of the surface that is the body; None if there is none.

    Args:
        z_m: (N,) ascending.
        from_m, to_m: where the middle of a person can be.
    """
    count = len(z_m)
    if count < _LEAST_PIXELS:
        return None
    ends = np.searchsorted(z_m, z_m + _WINDOW_M + _WINDOW_PER_M2 * z_m * z_m, side="right")
    held = ends - np.arange(count)
    middle = z_m[np.arange(count) + held // 2]
    held = np.where((middle >= from_m) & (middle <= to_m), held, 0)
    most = int(held.max())
    if most < max(_LEAST_PIXELS, _LEAST_SHARE * count):
        return None
    # Of the nearer surface the fullest window: the first that holds enough need not be that.
    start = int((held >= _NEARER_SHARE * most).argmax())
    reach = int(ends[start])
    start += int(held[start:reach].argmax())
    return z_m[start : start + int(held[start])]


def depth_sectors(
    depth_mm: Depth, camera: GroundCamera, yaw_rad: float = 0.0
) -> tuple[RangeSector, ...]:
    """Free distances by what stands on the floor or hangs low, from the camera along the ground.

    A sector in which nothing stands is free as far as any sensor reaches (infinite), one of which
    too little was measured is unknown (NaN): glass, the dark, a lens that is covered or something
    right before it.

    Args:
        depth_mm: (H, W) uint16.
        camera: that took the picture, its mounting known: without, the floor would stand in the
            way.
        yaw_rad: where the camera looks, from the robot's ahead, left is positive.
    """
    step = max(1, math.ceil(depth_mm.shape[1] / _MOST_COLUMNS))
    part = depth_mm[::step, ::step]
    view = _view(camera, depth_mm.shape[0], depth_mm.shape[1], step)
    z_m = part.ravel()[view.pixel] * np.float32(1e-3)
    measured = z_m > 0
    along_m = z_m * view.along
    above_m = camera.mount_height_m - z_m * view.fall
    stands = measured & (above_m > _FLOOR_M + _FLOOR_PER_M * along_m) & (above_m < _OVERHEAD_M)
    sectors = []
    for bearing_rad, start, end in zip(
        view.bearing_rad.tolist(), view.starts[:-1], view.starts[1:], strict=True
    ):
        own = slice(start, end)
        near_m = along_m[own][stands[own]]
        near_floor = view.near_floor[own]
        if len(near_m) >= _NTH_NEAREST:
            distance_m = float(np.partition(near_m, _NTH_NEAREST - 1)[_NTH_NEAREST - 1])
        elif measured[own][near_floor].sum() > _SEEN_SHARE * near_floor.sum():
            distance_m = math.inf
        else:
            distance_m = math.nan
        bearing_rad = math.remainder(bearing_rad + yaw_rad, 2 * math.pi)
        sectors.append(RangeSector(
            bearing_rad=bearing_rad, width_rad=_OVERLAP * view.width_rad, distance_m=distance_m
        ))  # fmt: skip
    return tuple(sectors)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """What of the pixels of a depth picture does not change with it; sector by sector.

    Attributes:
        pixel: (N,) their indices in the picture.
        along, fall: (N,) along the ground and down, per metre of depth.
        near_floor: (N,) whether the floor in this direction is near.
        starts: (count + 1,) where in these each sector begins, and the end.
        bearing_rad: (count,) middles of the sectors.
        width_rad: of each.
    """

    pixel: NDArray[np.intp]
    along: NDArray[np.float32]
    fall: NDArray[np.float32]
    near_floor: NDArray[np.bool_]
    starts: list[int]
    bearing_rad: FloatArray
    width_rad: float


@lru_cache(maxsize=4)
def _view(camera: GroundCamera, height: int, width: int, step: int) -> _View:
    rows, columns = np.mgrid[0:height:step, 0:width:step].reshape(2, -1) + 0.5
    pixels = np.stack(
        [columns * camera.width_px / width, rows * camera.height_px / height], axis=-1
    )
    ahead, left, fall = camera.rays(pixels)
    along, bearing = np.hypot(ahead, left), np.arctan2(left, ahead)
    first, last = float(bearing.min()), float(bearing.max())
    count = max(1, round((last - first) / _SECTOR_RAD))
    sector_rad = max(last - first, 1e-6) / count
    sector = np.minimum(((bearing - first) / sector_rad).astype(np.intp), count - 1)
    with np.errstate(divide="ignore"):
        floor_m = np.where(fall > 0, camera.mount_height_m * along / fall, np.inf)
    near = floor_m <= _FLOOR_WITHIN_M
    # A camera that hardly sees the floor is judged by all that it sees.
    blind = np.bincount(sector[near], minlength=count) == 0
    near |= blind[sector]
    pixel = np.argsort(sector, kind="stable")
    starts = np.searchsorted(sector[pixel], np.arange(count + 1)).tolist()
    return _View(
        pixel, along[pixel].astype(np.float32), fall[pixel].astype(np.float32), near[pixel],
        starts, np.asarray(first + (np.arange(count) + 0.5) * sector_rad, np.float64), sector_rad,
    )  # fmt: skip
