"""Several cameras on one robot: which tracks of two of them are one person, and who sees it better.

Each camera has a tracker of its own, so that an id of one says nothing of the ids of another, and
appearance does not cross the wire. What tells that two tracks are one person is the ground: both
cameras are calibrated, and see it at one place for a while, and nobody else near that place. Where
that does not hold nothing is handed over, however well another camera sees somebody.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import CameraInfo, Track, Tracks
from heel.services.follower.estimate import polar_covariance
from heel.services.follower.learned_width import LearnedWidth
from heel.services.follower.own_motion import Pose
from heel.services.follower.place import PlaceReader
from heel.services.follower.settings import FollowerSettings

FloatArray = NDArray[np.float64]

_SAME = 9.21
"""Squared Mahalanobis distance of two sights of one person: 99 of 100 of a plane are nearer."""
_APART = 25.0
"""The same, five standard deviations: two people are told apart only where they are farther."""
_AGREE_S = 0.5
"""Seconds over which two tracks have to be at one place; chosen by hand."""
_AGREE_FRAMES = 6
"""And frames of the newer camera, at least; chosen by hand."""
_AGREE_GAP_S = 0.4
"""Longest time without agreement within that, seconds; chosen by hand."""
_KEPT_S = 5.0
"""How long two tracks that agreed count as one person where the ground cannot tell, seconds: each
tracker goes on saying how sure it is of its own. Chosen by hand."""
_AT_ONCE_S = 0.15
"""Two frames are compared if taken no farther apart, seconds; chosen by hand."""
_OFFSET_SIGMA_M = 0.25
"""Metres by which two cameras of a robot stand apart, which no message tells; chosen by hand."""
_EDGE = 0.01
"""Share of the picture's width: a box nearer to a side is cut off or soon will be; chosen by
hand."""


@dataclass(frozen=True, slots=True)
class Sight:
    """One person as one camera sees it, in the plane that does not move."""

    id: int
    place: FloatArray
    covariance: FloatArray
    whole: bool
    """Whether the box is clear of both sides of the picture."""
    sure: bool
    """Whether the tracker is sure who it is."""


@dataclass(frozen=True, slots=True)
class HandOver:
    """The target is another camera's track from now on."""

    camera: str
    track_id: int
    words: str


@dataclass(slots=True)
class _Link:
    """The target's track and another camera's that are at one place."""

    target_id: int
    other_id: int
    since_s: float
    last_s: float
    frames: int = 0
    agreed: bool = False


class _Camera:
    """What one camera sees."""

    def __init__(self, settings: FollowerSettings) -> None:
        fov_rad = math.radians(settings.horizontal_fov_deg)
        self._settings = settings
        self._reader = PlaceReader(settings.person_height_m, fov_rad)
        self._widths: dict[int, LearnedWidth] = {}
        self.calibrated = False
        self.source: tuple[str, int, int, int] | None = None
        self.t_s = -math.inf
        self.sights: dict[int, Sight] = {}

    def set_camera(self, info: CameraInfo) -> None:
        self._reader.set_camera(info)
        told = (info.horizontal_fov_rad, info.mount_height_m or None, info.mount_pitch_rad,
                info.mount_yaw_rad)  # fmt: skip
        self.calibrated = None not in told

    def observe(self, tracks: Tracks, t_s: float, pose: Pose) -> None:
        self._reader.look_at(tracks)
        self.t_s, self.sights = t_s, {}
        present = [one for one in tracks.tracks if one.shown and one.state == "tracked"]
        self._widths = {one.id: self._widths.get(one.id) or LearnedWidth() for one in tracks.tracks}
        for track in present:
            sight = self._sight(track, tracks.width, t_s, pose)
            if sight is not None:
                self.sights[track.id] = sight

    def _sight(self, track: Track, width_px: int, t_s: float, pose: Pose) -> Sight | None:
        left, top, right, bottom = track.box_xyxy
        if right - left < 1.0 or bottom - top < 1.0:
            return None
        place = self._reader.read(track, self._widths[track.id], t_s)
        if place is None:
            return None
        s, lead = self._settings, track.identity_confidence - track.runner_up_confidence
        covariance = polar_covariance(
            pose.heading_rad + place.bearing_rad, place.distance_m, place.distance_sigma_m,
            place.bearing_sigma_rad,
        ) + np.eye(2) * _OFFSET_SIGMA_M**2  # fmt: skip
        return Sight(
            track.id, np.array(pose.place(place.distance_m, place.bearing_rad)), covariance,
            left > _EDGE * width_px and right < (1.0 - _EDGE) * width_px,
            track.proven and track.identity_confidence >= s.resume_identity_confidence
            and lead >= s.resume_identity_lead,
        )  # fmt: skip


class Sights:
    """Compares what the cameras of one robot see. Pure: the caller brings times and poses.

    Args:
        settings: of the follower.
        cameras: names of all cameras.
    """

    def __init__(self, settings: FollowerSettings, cameras: tuple[str, ...]) -> None:
        self._max_age_s = settings.max_tracks_age_s
        self._cameras = {name: _Camera(settings) for name in cameras}
        self._links: dict[str, _Link] = {}
        self._active = cameras[0]
        self._target_id: int | None = None

    def set_camera(self, camera: str, info: CameraInfo) -> None:
        """Use what a camera says of itself."""
        self._cameras[camera].set_camera(info)

    def observe(
        self, camera: str, tracks: Tracks, tracker: str, t_s: float, pose: Pose
    ) -> None:  # fmt: skip
        """Take a camera's tracks.

        Args:
            camera: its name.
            tracks: its newest frame.
            tracker: that gave out the ids; those of another one mean other people.
            t_s: when the picture was taken.
            pose: where the robot was then.
        """
        source = (tracker, tracks.epoch, tracks.width, tracks.height)
        if self._cameras[camera].source != source:
            self._cameras[camera].source = source
            self._links = {} if camera == self._active else {
                name: link for name, link in self._links.items() if name != camera
            }  # fmt: skip
        self._cameras[camera].observe(tracks, t_s, pose)
        for other in self._cameras if camera == self._active else (camera,):
            if other != self._active:
                self._compare(other, t_s)

    def follow(self, camera: str, target_id: int | None) -> None:
        """Say whom the robot follows, by which camera; links of another person end."""
        if (camera, target_id) != (self._active, self._target_id):
            self._active, self._target_id = camera, target_id
            self._links.clear()

    def better(self, now_s: float) -> HandOver | None:
        """The camera to take the target from now on, if that is clear; None: stay."""
        active = self._cameras[self._active]
        mine = active.sights.get(self._target_id or 0)
        fresh = now_s - active.t_s <= self._max_age_s
        if mine is not None and mine.whole and fresh:
            return None
        for name, link in self._links.items():
            camera = self._cameras[name]
            seen = camera.sights.get(link.other_id)
            if (
                link.agreed and now_s - link.last_s <= _KEPT_S and seen is not None and seen.sure
                and seen.whole and now_s - camera.t_s <= self._max_age_s
            ):  # fmt: skip
                why = "seen better there" if mine is not None and fresh else "out of sight here"
                return HandOver(name, link.other_id, f"handed over from {self._active}: {why}")
        return None

    def handed_over(self, over: HandOver) -> None:
        """The hand-over was made: the link holds in the other direction, too."""
        link, before = self._links[over.camera], self._active
        self._active, self._target_id = over.camera, over.track_id
        self._links = {
            before: _Link(link.other_id, link.target_id, link.since_s, link.last_s, link.frames,
                          agreed=True)
        }  # fmt: skip

    @property
    def words(self) -> str:
        """Of whom it is known that two cameras see one person, for health."""
        agreed = [f"{name} {one.other_id}" for name, one in self._links.items() if one.agreed]
        linked = f", also {', '.join(agreed)}" if agreed else ""
        blind = [name for name, one in self._cameras.items() if not one.calibrated]
        missing = f"; no hand-over without fov, height, pitch, yaw of {', '.join(blind)}"
        return f"{self._active}{linked}{missing if blind else ''}"

    def _compare(self, name: str, now_s: float) -> None:
        """Whether the target is one of the people that another camera sees."""
        active, other = self._cameras[self._active], self._cameras[name]
        if self._target_id is None or not (active.calibrated and other.calibrated):
            return
        mine = active.sights.get(self._target_id)
        if mine is None or not mine.sure or abs(active.t_s - other.t_s) > _AT_ONCE_S:
            return
        near = _near(mine, other)
        link = self._links.get(name)
        if link is not None and link.other_id in other.sights and link.other_id not in near:
            # Seen by both, and at two places: it was somebody else.
            del self._links[name]
            return
        if len(near) != 1:
            return
        (found,) = near
        seen = other.sights[found]
        alone = len(_near(seen, active)) == 1
        if not (alone and seen.sure and _distance(mine, seen) <= _SAME):
            return
        if link is None or link.other_id != found or (
            not link.agreed and now_s - link.last_s > _AGREE_GAP_S
        ):  # fmt: skip
            if link is not None and link.agreed and link.other_id in other.sights:
                return
            link = self._links[name] = _Link(self._target_id, found, now_s, now_s)
        link.last_s, link.frames = now_s, link.frames + 1
        if now_s - link.since_s >= _AGREE_S and link.frames >= _AGREE_FRAMES:
            link.agreed = True


def _near(sight: Sight, camera: _Camera) -> list[int]:
    """People of a camera that may be the one of a sight."""
    return [one.id for one in camera.sights.values() if _distance(sight, one) <= _APART]


def _distance(one: Sight, other: Sight) -> float:
    """Squared Mahalanobis distance of two sights."""
    apart = one.place - other.place
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))
