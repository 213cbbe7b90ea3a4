"""Which description of the camera holds: where people stand rests on its field of view."""

from __future__ import annotations

import math
from collections import OrderedDict

from heel.schemas import CameraInfo

_KEPT = 8
"""Starts of the camera whose descriptions are remembered; chosen by hand."""
_FOV_TOLERANCE_RAD = 1e-3
"""Radians by which two statements of one field of view may differ: rounding."""
_MOUNT_TOLERANCE = 1e-3
"""Metres or radians: what is told twice is told by the same numbers."""
_LEAST_FOV_RAD = math.radians(2)
"""A telephoto lens of 1 m focal length sees 2 degrees."""
_GREATEST_FOV_RAD = math.radians(175)
"""The pinhole model ends before 180 degrees."""
_LEAST_MOUNT_M = 0.02
"""Metres above the floor: lower no lens has room."""
_GREATEST_MOUNT_M = 30.0
"""Metres above the floor: a camera of a whole square; no robot's. Chosen by hand."""
_GREATEST_PITCH_RAD = math.radians(85)
"""Nearer to straight down or up no horizon can be computed."""


def implausible(info: CameraInfo) -> str:
    """What no camera of a robot can be like, in words; "" if nothing is."""
    fov_rad, pitch_rad = info.horizontal_fov_rad, info.mount_pitch_rad
    height_m = info.mount_height_m
    if fov_rad is not None and not _LEAST_FOV_RAD <= fov_rad <= _GREATEST_FOV_RAD:
        return f"a field of view of {math.degrees(fov_rad):.3g} degrees: state 2 to 175"
    # A height of 0 says that it is not known.
    if height_m and not _LEAST_MOUNT_M <= height_m <= _GREATEST_MOUNT_M:
        return f"a mounting height of {height_m:.3g} m: state 0.02 to 30"
    if pitch_rad is not None and abs(pitch_rad) > _GREATEST_PITCH_RAD:
        return f"a pitch of {math.degrees(pitch_rad):.3g} degrees: state -85 to 85"
    if abs(info.mount_yaw_rad or 0.0) > math.pi:
        return f"a yaw of {math.degrees(info.mount_yaw_rad or 0.0):.3g} degrees: state -180 to 180"
    return ""


class CameraInfos:
    """Keeps one description for each start of the camera: the first one.

    A lens does not change while a camera runs, so another description of the same start is
    another sender's. Before frames of a start are in use it cannot be told which is true: then
    the one counts by which people are nearest.

    Args:
        camera: name of the camera that descriptions are wanted of.
    """

    def __init__(self, camera: str) -> None:
        self._camera = camera
        self._infos: OrderedDict[int, CameraInfo] = OrderedDict()
        self._epoch: int | None = None

    def hear(self, info: CameraInfo) -> str:
        """Take a description; says why it is not used, or "" if it is or may be."""
        if info.stream != self._camera:
            return f"it is of camera {info.stream}, not of {self._camera}"
        if problem := implausible(info):
            return f"camera info cannot be used: {problem}"
        known = self._infos.get(info.epoch)
        same = known is None or _same_optics(known, info)
        if known is None or same or (info.epoch != self._epoch and _fov(info) > _fov(known)):
            self._infos[info.epoch] = info
        while len(self._infos) > _KEPT:
            del self._infos[next(epoch for epoch in self._infos if epoch != self._epoch)]
        if known is None or same:
            return ""
        used = _shown(self._infos[info.epoch])
        return f"two descriptions: {_shown(known)} and {_shown(info)}; {used} is used"

    def of(self, epoch: int) -> CameraInfo | None:
        """What is known of the camera that frames in use come from, from now on."""
        self._epoch = epoch
        return self._infos.get(epoch)


def _fov(info: CameraInfo) -> float:
    return info.horizontal_fov_rad or 0.0


def _same_optics(one: CameraInfo, other: CameraInfo) -> bool:
    return one.lens == other.lens and all(
        (a is None) == (b is None) and math.isclose(a or 0.0, b or 0.0, abs_tol=tolerance)
        for a, b, tolerance in (
            (one.horizontal_fov_rad, other.horizontal_fov_rad, _FOV_TOLERANCE_RAD),
            (one.mount_height_m, other.mount_height_m, _MOUNT_TOLERANCE),
            (one.mount_pitch_rad, other.mount_pitch_rad, _MOUNT_TOLERANCE),
            (one.mount_yaw_rad, other.mount_yaw_rad, _MOUNT_TOLERANCE),
        )
    )


def _shown(info: CameraInfo) -> str:
    fov = info.horizontal_fov_rad
    seen = "no field of view" if fov is None else f"{math.degrees(fov):.3g} degrees"
    mount = info.mount_height_m
    return seen if mount is None else f"{seen} at {mount:.3g} m"
