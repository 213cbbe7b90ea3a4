"""The people in sight, where they are and how they walk, in a plane that does not move."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heel.schemas import CameraInfo, Track, Tracks
from heel.services.follower.box_scale import BoxScale
from heel.services.follower.clearance import Sectors
from heel.services.follower.estimate import PlaceFilter, polar_covariance
from heel.services.follower.learned_width import LearnedWidth
from heel.services.follower.own_motion import OwnMotion, Pose
from heel.services.follower.people_ranges import RangesInTime
from heel.services.follower.place import Place, PlaceReader

_LEAST_BOX_PX = 1.0
"""Pixels; a thinner box has no direction."""
_FORGOTTEN_AFTER_S = 0.6
"""Seconds unseen after which a person other than the target is forgotten; chosen by hand."""
# No person is suddenly farther away: people walk there, and a box is only so much wrong.
_LEAVES_MPS = 2.0  # metres per second; chosen by hand
_DOUBTFULLY_LEAVES_MPS = 0.5  # the same where the place is not certain; chosen by hand
_LEAVES_SHARE = 0.1  # of the distance, once; chosen by hand
_DOUBTFULLY_LEAVES_SHARE = 0.02  # the same where the place is not certain; chosen by hand
_NEARER = 0.95
"""Share of the old distance, beyond what boxes vary: below it the nearer place counts, as surely as
if it were certain."""
_NEARER_SHARE = 0.1
"""Standard deviation of such a place as a share of its distance; chosen by hand."""
_HEIGHT_RESERVE_M = 0.25
"""Metres kept from an adult on top where only the height tells the distance; chosen by hand."""
_TOWARDS_RAD = 0.3
"""Off a direction, within which somebody is in it: they are half a metre wide. Chosen by hand."""
_LEAST_HEIGHT_M = 0.9
"""Metres: a child that walks by itself; smaller ones are carried."""


@dataclass(frozen=True, slots=True)
class Person:
    """One person as last seen.

    Attributes:
        distance_m, bearing_rad: from the camera when the picture was taken.
        seen_s: when that was.
        place: where the camera saw them, in the plane of `filter`, which smooths it.
        certain: whether all that is seen fits a person that stands there.
        by_height: whether their distance rests on the assumed height of people.
        reserve_m: by how much it may be less than told for that reason.
        least_share: of the distance that is left if they are the smallest of people; 1 where it
            does not rest on their height.
    """

    id: int
    distance_m: float
    bearing_rad: float
    seen_s: float
    place: tuple[float, float]
    filter: PlaceFilter
    box_scale: BoxScale
    width: LearnedWidth
    certain: bool
    by_height: bool
    reserve_m: float
    least_share: float

    def velocity(self, pose: Pose, t_s: float) -> tuple[float, float]:
        """Over ground, in the axes of a robot at a pose.

        Nothing of it leads away from a robot that is not certain where they are: a box that shrinks
        may be that of a person that bends down.
        """
        velocity = pose.turned(*self.filter.velocity)
        place = pose.seen(*self.filter.place_at(t_s))
        away = place[0] * velocity[0] + place[1] * velocity[1]
        if self.certain or away <= 0:
            return velocity
        share = away / max(place[0] ** 2 + place[1] ** 2, 1e-6)
        return velocity[0] - share * place[0], velocity[1] - share * place[1]


class People:
    """Turns tracks into places.

    Args:
        person_height_m: assumed of every person.
        horizontal_fov_rad: where the camera does not state its own.
    """

    def __init__(self, person_height_m: float, horizontal_fov_rad: float) -> None:
        self._reader = PlaceReader(person_height_m, horizontal_fov_rad)
        self._least_share = min(1.0, _LEAST_HEIGHT_M / person_height_m)
        self._known: dict[int, Person] = {}
        self._seen: dict[int, Person] = {}
        self._ranges: RangesInTime | None = None

    def set_camera(self, info: CameraInfo) -> None:
        """Use what the camera says of itself."""
        self._reader.set_camera(info)

    def clear(self) -> None:
        """Forget all: another tracker, other ids."""
        self._known, self._seen = {}, {}

    @property
    def seen(self) -> dict[int, Person]:
        """Those seen well in the newest frame."""
        return self._seen

    @property
    def known(self) -> dict[int, Person]:
        """Those seen well within the last moments, and the one that is kept."""
        return self._known

    @property
    def focal_px(self) -> float:
        """Of the camera that took the newest frame."""
        return self._reader.focal_px

    @property
    def half_view_rad(self) -> float:
        """From the middle of the newest frame to its side."""
        return self._reader.half_view_rad

    def observe(self, sectors: Sectors, now_s: float) -> None:
        """Take free distances at their arrival: they also tell how far people are."""
        self._ranges = RangesInTime(sectors, now_s)

    def update(self, tracks: Tracks, t_s: float, motion: OwnMotion, keep: int | None) -> None:
        """Take a frame's tracks.

        Args:
            tracks: the frame's people.
            t_s: when the picture was taken.
            motion: where the robot was then.
            keep: the person that is never forgotten.
        """
        self._reader.look_at(tracks)
        self._seen = {}
        for track in tracks.tracks:
            if track.shown and track.state == "tracked" and _has_area(track):
                known = self._known.get(track.id)
                width = LearnedWidth() if known is None else known.width
                place = self._reader.read(track, width, t_s)
                if place is not None:
                    self._seen[track.id] = self._filtered(track.id, place, width, t_s, motion)
        self._known |= self._seen
        self._known = {
            person.id: person
            for person in self._known.values()
            if person.id == keep or t_s - person.seen_s <= _FORGOTTEN_AFTER_S
        }

    def anybody_towards(
        self, pose: Pose, bearing_rad: float, way_m: float, t_s: float, but: int | None
    ) -> bool:
        """Whether somebody is about in a direction, and nearer than so far.

        Args:
            pose: of the robot.
            bearing_rad: from there.
            way_m: how far.
            t_s: the present.
            but: who does not count.
        """
        for person in self._known.values():
            ahead_m, left_m = pose.seen(*person.filter.place_at(t_s))
            off_rad = math.remainder(math.atan2(left_m, ahead_m) - bearing_rad, 2 * math.pi)
            if (
                person.id != but
                and abs(off_rad) < _TOWARDS_RAD
                and math.hypot(ahead_m, left_m) < way_m
            ):
                return True
        return False

    def _filtered(
        self, track_id: int, place: Place, width: LearnedWidth, t_s: float, motion: OwnMotion
    ) -> Person:
        known = self._known.get(track_id)
        box_scale = BoxScale() if known is None else known.box_scale
        pose = motion.pose_at(t_s)
        distance_m = box_scale.scale * place.distance_m
        if known is not None:
            distance_m = min(distance_m, _farthest_m(known, pose, t_s, place.certain))
        sigma_m = place.distance_sigma_m
        if known and not place.certain and distance_m < _NEARER * _smoothed_m(known, pose):
            # In doubt the nearer one wins, and at once.
            sigma_m = min(sigma_m, _NEARER_SHARE * distance_m)
        seen_at = pose.place(distance_m, place.bearing_rad)
        where = np.array(seen_at)
        covariance = polar_covariance(
            pose.heading_rad + place.bearing_rad, distance_m, sigma_m, place.bearing_sigma_rad
        )
        if known is None or t_s - known.seen_s > _FORGOTTEN_AFTER_S:
            made = PlaceFilter(where, covariance, t_s)
        else:
            made = known.filter
            made.update(where, covariance, t_s)
        if self._ranges is not None:
            measured_m = self._ranges.sharpen(made, t_s, motion)
            if measured_m is not None:
                box_scale.learn(place.distance_m, measured_m, t_s)
        unsure = place.by_height and not box_scale.measured(t_s)
        return Person(
            track_id, distance_m, place.bearing_rad, t_s, seen_at, made, box_scale, width,
            place.certain, place.by_height, _HEIGHT_RESERVE_M if unsure else 0.0,
            self._least_share if unsure else 1.0,
        )  # fmt: skip


def _has_area(track: Track) -> bool:
    """Whether a box is one of pixels: of a thinner one nothing can be told."""
    left, top, right, bottom = track.box_xyxy
    return right - left >= _LEAST_BOX_PX and bottom - top >= _LEAST_BOX_PX


def _farthest_m(known: Person, pose: Pose, t_s: float, certain: bool) -> float:
    """As far as a person can have walked since the last sight."""
    since_s = max(0.0, t_s - known.seen_s)
    last_m = math.hypot(*pose.seen(*known.place))
    if certain:
        return (1.0 + _LEAVES_SHARE) * last_m + _LEAVES_MPS * since_s
    return (1.0 + _DOUBTFULLY_LEAVES_SHARE) * last_m + _DOUBTFULLY_LEAVES_MPS * since_s


def _smoothed_m(known: Person, pose: Pose) -> float:
    """How far away from a pose a person was when last seen, as the filter says."""
    return math.hypot(*pose.seen(*known.filter.place_at(known.filter.t_s)))
