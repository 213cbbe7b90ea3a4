"""From a track's box to a place as the camera sees it, with what was learned of both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from heel.schemas import CameraInfo, Track, Tracks
from heel.services.follower.learned_ground import LearnedGround
from heel.services.follower.learned_width import LearnedWidth
from heel.services.geometry.camera import GroundCamera, Pinhole, camera_from_info, resized
from heel.services.geometry.person import PersonModel, PersonPosition, locate_person, locate_raised
from heel.services.geometry.person_box import PersonBox

_FARTHEST_M = 100.0
"""Metres; no place is said to be farther."""
_VARYING_SHARE = 0.4
"""Of the distance's uncertainty: the rest, the person's height, is the same in every frame."""
_TOLD_DISTANCE_SHARE = 0.1
"""Assumed standard deviation of a distance that a tracker gives without one, of that distance."""
_TOLD_BEARING_SIGMA_RAD = 0.02
"""The same of a bearing, radians."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the camera sees a person.

    Attributes:
        distance_m, bearing_rad: along the ground, from the robot's ahead; left is positive.
        distance_sigma_m, bearing_sigma_rad: what varies of them from frame to frame.
        certain: whether all that is seen fits a person that stands there.
        by_height: whether it rests on the assumed height of people alone.
        told: whether the tracker itself stated the distance.
    """

    distance_m: float
    bearing_rad: float
    distance_sigma_m: float
    bearing_sigma_rad: float
    certain: bool
    by_height: bool
    told: bool


class PlaceReader:
    """Reads places from boxes; of a camera of unknown mounting it learns the ground as it goes.

    Args:
        person_height_m: assumed of every person.
        horizontal_fov_rad: where the camera does not state its own.
    """

    def __init__(self, person_height_m: float, horizontal_fov_rad: float) -> None:
        self._model = PersonModel(height_m=person_height_m)
        self._fov_rad = horizontal_fov_rad
        self._info: CameraInfo | None = None
        self._camera: Pinhole | None = None
        self._ground = LearnedGround()
        self._yaw_rad = 0.0

    def set_camera(self, info: CameraInfo) -> None:
        """Use what the camera says of itself; another one is mounted elsewhere."""
        known = self._info
        if known is None or _optics(info) != _optics(known):
            self._ground = LearnedGround()
        self._info, self._camera = info, None
        self._yaw_rad = info.mount_yaw_rad or 0.0

    @property
    def focal_px(self) -> float:
        """Of the camera that took the newest frame."""
        return self._camera.focal_px if self._camera is not None else 1.0

    @property
    def half_view_rad(self) -> float:
        """Of that camera, from the middle to a side."""
        if self._camera is None:
            return 0.0
        return self._camera.horizontal_fov_rad / 2

    def look_at(self, tracks: Tracks) -> None:
        """Take the size of a frame's picture; before `read` of its tracks."""
        size = (tracks.width, tracks.height)
        if self._camera is None or (self._camera.width_px, self._camera.height_px) != size:
            made = None
            if self._info is not None:
                made = camera_from_info(resized(self._info, *size), self._fov_rad)
            self._camera = made or Pinhole.from_fov(*size, self._fov_rad)

    def read(self, track: Track, width: LearnedWidth, t_s: float) -> Place | None:
        """Where a person is; the tracker's own word comes first.

        Args:
            track: of a person in the frame that was looked at.
            width: of that person; learned from this box if it is certain where it is.
            t_s: when the picture was taken.
        """
        camera = self._camera
        if camera is None:
            return None
        model = self._model
        if width.width_m is not None:
            model = replace(model, width_m=width.width_m, width_known=True)
        line = self._ground.line
        seen = locate_person(track.box_xyxy, camera, model, line)
        if seen is None:
            seen = locate_raised(track.box_xyxy, camera, model)
        box = PersonBox.of(track.box_xyxy, camera, model)
        if seen is not None and box is not None:
            self._learn(box, seen, width, t_s)
        place = _told_or_seen(track, seen, not isinstance(camera, GroundCamera))
        return place if not self._yaw_rad or place is None else replace(
            place, bearing_rad=math.remainder(place.bearing_rad + self._yaw_rad, 2 * math.pi)
        )  # fmt: skip

    def _learn(
        self, box: PersonBox, seen: PersonPosition, width: LearnedWidth, t_s: float
    ) -> None:  # fmt: skip
        if not box.both_sides_seen:
            return
        if seen.certain:
            width.learn(box.wide_m(seen.distance_m), t_s, box.feet_seen)
        whole = box.head_seen and box.feet_seen and box.height_m() < math.inf
        if whole and seen.evidence != "width" and not isinstance(box.camera, GroundCamera):
            self._ground.learn(box.lower_slope, box.height_m(), box.height_noise(), t_s)


def _optics(info: CameraInfo) -> tuple[object, ...]:
    return info.horizontal_fov_rad, info.mount_height_m, info.mount_pitch_rad, info.lens


def _told_or_seen(track: Track, seen: PersonPosition | None, unmounted: bool) -> Place | None:
    if track.distance_m is not None:
        distance_m = track.distance_m
        sigma_m = track.distance_sigma_m or _TOLD_DISTANCE_SHARE * distance_m
    elif seen is not None:
        share = _VARYING_SHARE if seen.certain else 1.0
        distance_m, sigma_m = seen.distance_m, share * seen.distance_sigma_m
    else:
        return None
    if track.bearing_rad is not None:
        bearing_rad = math.remainder(track.bearing_rad, 2 * math.pi)
        bearing_sigma_rad = track.bearing_sigma_rad or _TOLD_BEARING_SIGMA_RAD
    elif seen is not None:
        bearing_rad, bearing_sigma_rad = seen.bearing_rad, seen.bearing_sigma_rad
    else:
        return None
    told = track.distance_m is not None
    return Place(
        min(distance_m, _FARTHEST_M), bearing_rad, min(sigma_m, _FARTHEST_M),
        min(bearing_sigma_rad, math.pi), told or (seen is not None and seen.certain),
        unmounted and not told, told,
    )  # fmt: skip
