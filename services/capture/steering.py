"""What turns the window of a virtual pan: the wheels' turn rate, and the person's row."""

from __future__ import annotations

import math

from heel.schemas import Odometry, Tracks
from heel.services.capture.pan_window import PanWindow

STALE_S = 0.2
"""Without news from the drive for so long, the window stands."""


class Steering:
    """Pans with what the wheels are told, tilts after the person that is followed.

    A robot has no tilt, so the window has a gimbal that follows no command: it brings the row of
    the target's box to the middle, and holds where the target is not seen.

    Args:
        window: is turned by `advance`; its angles start where they are.
    """

    def __init__(self, window: PanWindow) -> None:
        self._window = window
        self._angular_radps = 0.0
        self._heard_s = -math.inf
        self._now_s: float | None = None
        self._told_yaw_rad, self._told_s = window.yaw_rad, -math.inf
        self._target: int | None = None
        self._row_px: float | None = None

    def hear_drive(self, angular_radps: float, at_s: float) -> None:
        """Take what the wheels are told from `at_s` on."""
        self.advance(at_s)
        self._angular_radps, self._heard_s = angular_radps, at_s

    def hear_target(self, track_id: int | None) -> None:
        """Take the person followed; without one the tilt stays as it is."""
        if track_id != self._target:
            self._target, self._row_px = track_id, None

    def hear_tracks(self, tracks: Tracks) -> None:
        """Take where people are in the window of a frame."""
        offset = self._window.offset_of(tracks.index)
        if offset is None:
            return
        for track in tracks.tracks:
            if track.id == self._target and track.shown and track.state == "tracked":
                row = (track.box_xyxy[1] + track.box_xyxy[3]) / 2.0
                self._row_px = offset[1] + row * self._window.height / tracks.height

    def odometry(self, seq: int) -> Odometry:
        """How the window has really turned since this was last asked: not beyond a border."""
        now_s = self._told_s if self._now_s is None else self._now_s
        yaw_rad, passed_s = self._window.yaw_rad, now_s - self._told_s
        rate = (yaw_rad - self._told_yaw_rad) / passed_s if passed_s > 0.0 else 0.0
        self._told_yaw_rad, self._told_s = yaw_rad, now_s
        return Odometry(
            seq=seq, x_m=0.0, y_m=0.0, heading_rad=math.remainder(yaw_rad, 2.0 * math.pi),
            linear_mps=0.0, angular_radps=rate,
        )  # fmt: skip

    def advance(self, now_s: float) -> None:
        """Turn the window on to `now_s`; time that runs backwards is ignored."""
        before_s = now_s if self._now_s is None else self._now_s
        if now_s < before_s:
            return
        self._now_s = now_s
        turning_s = min(now_s, self._heard_s + STALE_S) - before_s
        if turning_s > 0.0:
            self._window.turn(self._angular_radps, turning_s)
        if self._row_px is not None:
            self._window.tilt_towards(self._row_px, now_s - before_s)
