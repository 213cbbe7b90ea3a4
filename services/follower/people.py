"""Everybody in sight, where they are and how they walk, in a plane that does not move."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schemas import CameraInfo, Track, Tracks
from services.follower.box_scale import BoxScale
from services.follower.clearance import Sectors
from services.follower.estimate import PlaceFilter, polar_covariance
from services.follower.own_motion import OwnMotion
from services.follower.people_ranges import RangesInTime
from services.geometry.camera import Pinhole, camera_from_info
from services.geometry.person import PersonModel, locate_person

_FORGOTTEN_AFTER_S = 0.6
_FARTHEST_M = 100.0
_VARYING_SHARE = 0.4
"""Of the distance's uncertainty: the rest, the person's height, is the same in every frame."""
_TOLD_DISTANCE_SHARE = 0.1
_TOLD_BEARING_SIGMA_RAD = 0.02
"""Assumed errors of places that a tracker tells without theirs."""


@dataclass(frozen=True, slots=True)
class Person:
    """One person as last seen.

    Attributes:
        distance_m, bearing_rad: from the camera when the picture was taken.
        seen_s: when that was.
    """

    id: int
    distance_m: float
    bearing_rad: float
    seen_s: float
    filter: PlaceFilter
    box_scale: BoxScale


class People:
    """Turns tracks into places.

    Args:
        person_height_m: assumed of everybody.
        horizontal_fov_rad: where the camera does not state its own.
    """

    def __init__(self, person_height_m: float, horizontal_fov_rad: float) -> None:
        self._model = PersonModel(height_m=person_height_m)
        self._fov_rad = horizontal_fov_rad
        self._info: CameraInfo | None = None
        self._camera: Pinhole | None = None
        self._known: dict[int, Person] = {}
        self._seen: dict[int, Person] = {}
        self._ranges: RangesInTime | None = None

    def set_camera(self, info: CameraInfo) -> None:
        """Use what the camera says of itself."""
        self._info, self._camera = info, None

    def clear(self) -> None:
        """Forget everybody: another tracker, other ids."""
        self._known, self._seen = {}, {}

    @property
    def seen(self) -> dict[int, Person]:
        """Those seen well in the newest frame."""
        return self._seen

    @property
    def known(self) -> dict[int, Person]:
        """Those seen well within the last moments, and the one who is kept."""
        return self._known

    @property
    def focal_px(self) -> float:
        """Of the camera that took the newest frame."""
        return self._camera.focal_px if self._camera is not None else 1.0

    def observe(self, sectors: Sectors, now_s: float) -> None:
        """Take free distances at their arrival: they also tell how far people are."""
        self._ranges = RangesInTime(sectors, now_s)

    def update(self, tracks: Tracks, t_s: float, motion: OwnMotion, keep: int | None) -> None:
        """Take a frame's tracks.

        Args:
            tracks: the frame's people.
            t_s: when the picture was taken.
            motion: where the robot was then.
            keep: who is never forgotten.
        """
        camera = self._camera_for(tracks)
        self._seen = {}
        for track in tracks.tracks:
            if track.shown and track.state == "tracked":
                place = _place(track, camera, self._model)
                if place is not None:
                    self._seen[track.id] = self._filtered(track.id, place, t_s, motion)
        self._known |= self._seen
        self._known = {
            person.id: person
            for person in self._known.values()
            if person.id == keep or t_s - person.seen_s <= _FORGOTTEN_AFTER_S
        }

    def _filtered(
        self, track_id: int, place: tuple[float, float, float, float], t_s: float, motion: OwnMotion
    ) -> Person:
        known = self._known.get(track_id)
        box_scale = BoxScale() if known is None else known.box_scale
        told_m, bearing_rad, distance_sigma_m, bearing_sigma_rad = place
        distance_m = box_scale.scale * told_m
        pose = motion.pose_at(t_s)
        where = np.array(pose.place(distance_m, bearing_rad))
        covariance = polar_covariance(
            pose.heading_rad + bearing_rad, distance_m, distance_sigma_m, bearing_sigma_rad
        )
        if known is None or t_s - known.seen_s > _FORGOTTEN_AFTER_S:
            made = PlaceFilter(where, covariance, t_s)
        else:
            made = known.filter
            made.update(where, covariance, t_s)
        if self._ranges is not None:
            measured_m = self._ranges.sharpen(made, t_s, motion)
            if measured_m is not None:
                box_scale.learn(told_m, measured_m, t_s)
        return Person(track_id, distance_m, bearing_rad, t_s, made, box_scale)

    def _camera_for(self, tracks: Tracks) -> Pinhole:
        size = (tracks.width, tracks.height)
        if self._camera is None or (self._camera.width_px, self._camera.height_px) != size:
            made = None
            if self._info is not None:
                info = self._info.model_copy(update={"width": size[0], "height": size[1]})
                made = camera_from_info(info, self._fov_rad)
            self._camera = made or Pinhole.from_fov(*size, self._fov_rad)
        return self._camera


def _place(
    track: Track, camera: Pinhole, model: PersonModel
) -> tuple[float, float, float, float] | None:
    """Distance, bearing and their standard deviations; the tracker's own word comes first."""
    seen = locate_person(track.box_xyxy, camera, model)
    if seen is None:
        # A kerb or a ramp lifts feet over the horizon of flat ground; the height still tells.
        unmounted = Pinhole(camera.width_px, camera.height_px, camera.focal_px)
        seen = locate_person(track.box_xyxy, unmounted, model)
    share = 1.0 if seen is None or seen.evidence in ("bound", "cut height") else _VARYING_SHARE
    if track.distance_m is not None:
        distance_m = track.distance_m
        sigma_m = track.distance_sigma_m or _TOLD_DISTANCE_SHARE * distance_m
    elif seen is not None:
        distance_m, sigma_m = seen.distance_m, seen.distance_sigma_m
    else:
        return None
    if track.bearing_rad is not None:
        bearing_rad = math.remainder(track.bearing_rad, 2 * math.pi)
        bearing_sigma_rad = track.bearing_sigma_rad or _TOLD_BEARING_SIGMA_RAD
    elif seen is not None:
        bearing_rad, bearing_sigma_rad = seen.bearing_rad, seen.bearing_sigma_rad
    else:
        return None
    return (
        min(distance_m, _FARTHEST_M), bearing_rad, min(share * sigma_m, _FARTHEST_M),
        min(bearing_sigma_rad, math.pi),
    )  # fmt: skip
