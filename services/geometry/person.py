"""Where a person stands, from the box alone: feet on the ground, head at an assumed height.

A ray that falls by `s` per metre along the ground meets a point `f` metres below the camera at
`d = f / s`. Feet are the mounting height below the camera and the head the mounting height less
the person's, so each edge of the box that is seen says something of `q = 1 / d`:

    s_feet = mount * q        s_head = (mount - person) * q

The two are combined by generalised least squares in `q`. Their errors: edges of boxes, the
person's height (head only), and the pitch of a rocking robot, which moves both alike. Where the
mounting is not known only the difference says something: `s_feet - s_head = person * q`.
An end that is cut off tells, too: whoever is farther away would show it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.geometry.camera import GroundCamera, Pinhole

Evidence = Literal["feet and head", "feet", "head", "height", "cut height", "bound"]
_FARTHEST_M = 1000.0
_TALL_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class PersonModel:
    """What is assumed of people and their boxes.

    Attributes:
        height_m, height_sigma_m: of people (95 % of adults are within 0.2 m of 1.7).
        edge_sigma_px, edge_sigma_share: an edge of a box is that many pixels wrong, plus that
            share of the box's height.
        pitch_sigma_rad: how much a robot rocks; each 0.01 rad moves a person who is 3 m away
            from a camera 0.8 m high by 0.12 m.
        border_px: an edge so near to the picture's border is cut off.
    """

    height_m: float = 1.7
    height_sigma_m: float = 0.1
    edge_sigma_px: float = 1.5
    edge_sigma_share: float = 0.02
    pitch_sigma_rad: float = 0.01
    border_px: float = 2.0


@dataclass(frozen=True, slots=True)
class PersonPosition:
    """Where a person stands, from the camera.

    Attributes:
        distance_m: along the ground.
        bearing_rad: left is positive.
        distance_sigma_m, bearing_sigma_rad: standard deviations.
        evidence: what the distance rests on. `bound`: neither feet nor head are seen, or what is
            taken for them is not; the person is anywhere from touching to twice `distance_m`.
            `cut height`: one of them is cut off and the mounting is unknown; the person may be
            nearer.
    """

    distance_m: float
    bearing_rad: float
    distance_sigma_m: float
    bearing_sigma_rad: float
    evidence: Evidence


def locate_person(
    box_xyxy: Sequence[float], camera: Pinhole, model: PersonModel | None = None
) -> PersonPosition | None:
    """Bearing and distance of a person.

    Args:
        box_xyxy: left, top, right, bottom in pixels of the camera's picture.
        camera: a `GroundCamera` where the mounting is known, else a `Pinhole`.
        model: what is assumed of people.

    Returns:
        None for a box without area, one outside the picture, or one that nobody can have who
        stands on the ground (feet above the horizon).
    """
    model = model or PersonModel()
    left, top, right, bottom = box_xyxy
    if not _is_seen(left, top, right, bottom, camera):
        return None
    middle_px = (left + right) / 2
    sigma_px = model.edge_sigma_px + model.edge_sigma_share * (bottom - top)
    head_seen = top > model.border_px
    feet_seen = bottom < camera.height_px - model.border_px
    if isinstance(camera, GroundCamera):
        seen = _by_ground(middle_px, top if head_seen else None, bottom if feet_seen else None,
                          camera, model, sigma_px)  # fmt: skip
        seen = _not_beyond(_farthest_m(middle_px, head_seen, feet_seen, camera, model), seen)
    else:
        seen = _by_height(middle_px, top, bottom, head_seen, feet_seen, camera, model, sigma_px)
    if not (head_seen or feet_seen):
        seen = _by_bound(middle_px, top, bottom, camera, model)
    if seen is None:
        return None
    distance_m, distance_sigma_m, evidence = seen
    row_px = bottom if feet_seen else (top + bottom) / 2
    return PersonPosition(
        distance_m, camera.bearing_rad(middle_px, row_px), distance_sigma_m,
        _bearing_sigma_rad(left, right, camera, model, sigma_px), evidence,
    )  # fmt: skip


_Seen = tuple[float, float, Evidence]


def _is_seen(left: float, top: float, right: float, bottom: float, camera: Pinhole) -> bool:
    """Whether the box has an area within the picture; NaN fails every comparison."""
    across = left < right and right > 0 and left < camera.width_px
    return across and top < bottom and bottom > 0 and top < camera.height_px


def _bearing_sigma_rad(
    left: float, right: float, camera: Pinhole, model: PersonModel, sigma_px: float
) -> float:
    """Both edges are seen: their mean; one is cut off: half the box may be missing, too."""
    cut = left <= model.border_px or right >= camera.width_px - model.border_px
    off_px = (right - left) / 2 if cut else 0.0
    return math.hypot(sigma_px / math.sqrt(2), off_px) / camera.focal_px


def _by_ground(
    middle_px: float, top: float | None, bottom: float | None, camera: GroundCamera,
    model: PersonModel, sigma_px: float,
) -> _Seen | None:  # fmt: skip
    """Distance from the edges that are seen (None: cut off), the mounting known."""
    falls, slopes, edge_sigma, height_share = [], [], [], []
    for row_px, fall_m, share in (
        (bottom, camera.mount_height_m, 0.0),
        (top, camera.mount_height_m - model.height_m, 1.0),
    ):
        if row_px is not None:
            slope = camera.slope(middle_px, row_px)
            falls.append(fall_m)
            slopes.append(slope)
            edge_sigma.append((1 + slope * slope) * sigma_px / camera.focal_px)
            height_share.append(share)
    if not falls or not all(map(math.isfinite, slopes)):
        return None
    solved = _least_squares(
        np.array(falls), np.array(slopes), np.array(edge_sigma), np.array(height_share), model
    )
    if solved is None:
        return None
    evidence: Evidence = "feet" if top is None else "head" if bottom is None else "feet and head"
    return *solved, evidence


def _farthest_m(
    middle_px: float, head_seen: bool, feet_seen: bool, camera: GroundCamera, model: PersonModel
) -> float:
    """Where the ends that are cut off would come into the picture; infinite if nothing is."""
    farthest_m = math.inf
    over_camera_m = model.height_m + _TALL_SIGMAS * model.height_sigma_m - camera.mount_height_m
    highest = camera.slope(middle_px, model.border_px)
    lowest = camera.slope(middle_px, camera.height_px - model.border_px)
    if not head_seen and over_camera_m > 0 and highest < 0:
        farthest_m = over_camera_m / -highest
    if not feet_seen and lowest > 0:
        farthest_m = min(farthest_m, camera.mount_height_m / lowest)
    return farthest_m


def _not_beyond(farthest_m: float, seen: _Seen | None) -> _Seen | None:
    """What is seen, unless what is cut off contradicts it: half a person's lower edge is no feet.

    A network's boxes of rendered people 1 m away ended at the hips: 3.8 m, said the "feet".
    """
    if seen is None or seen[0] <= farthest_m:
        return seen
    distance_m, distance_sigma_m, evidence = seen
    if distance_m - 2 * distance_sigma_m <= farthest_m:
        return farthest_m, distance_sigma_m, evidence
    return farthest_m / 2, farthest_m / math.sqrt(12), "bound"


def _least_squares(
    falls: NDArray[np.float64], slopes: NDArray[np.float64], edge_sigma: NDArray[np.float64],
    height_share: NDArray[np.float64], model: PersonModel,
) -> tuple[float, float] | None:  # fmt: skip
    """Distance and its standard deviation; the height's error scales with 1/d, hence two rounds."""
    inverse_m = 0.3
    variance = math.inf
    for _ in range(3):
        height = height_share * (model.height_sigma_m * inverse_m)
        # Pitch moves an angle; slope is its tangent.
        pitch = (1 + slopes**2) * model.pitch_sigma_rad
        covariance = np.diag(edge_sigma**2 + height**2) + np.outer(pitch, pitch)
        weights = np.linalg.solve(covariance, falls)
        information = float(weights @ falls)
        if information <= 0:
            return None
        inverse_m = float(weights @ slopes) / information
        variance = 1.0 / information
        if inverse_m <= 1.0 / _FARTHEST_M:
            return None
    return 1.0 / inverse_m, math.sqrt(variance) / inverse_m**2


def _by_height(
    middle_px: float, top: float, bottom: float, head_seen: bool, feet_seen: bool,
    camera: Pinhole, model: PersonModel, sigma_px: float,
) -> _Seen | None:  # fmt: skip
    """Apparent distance: a person who looks half as tall is twice as far away."""
    span = camera.slope(middle_px, bottom) - camera.slope(middle_px, top)
    if span <= model.height_m / _FARTHEST_M:
        return None
    distance_m = model.height_m / span
    edges = math.sqrt(2) * sigma_px / (bottom - top)
    relative = math.hypot(model.height_sigma_m / model.height_m, edges)
    if head_seen and feet_seen:
        return distance_m, distance_m * relative, "height"
    return distance_m, distance_m * math.hypot(relative, 0.25), "cut height"


def _by_bound(
    middle_px: float, top: float, bottom: float, camera: Pinhole, model: PersonModel
) -> _Seen:
    """Neither end is seen: uniform between touching and the distance at which one would be."""
    span = camera.slope(middle_px, bottom) - camera.slope(middle_px, top)
    farthest_m = model.height_m / span
    if isinstance(camera, GroundCamera):
        slope = camera.slope(middle_px, bottom)
        if slope > 0:
            farthest_m = min(farthest_m, camera.mount_height_m / slope)
    return farthest_m / 2, farthest_m / math.sqrt(12), "bound"
