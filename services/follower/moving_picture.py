"""Whether the picture moves as it has to while the robot does: one that stands still is frozen.

A frozen sensor, a hung encoder or a relay that repeats its last picture with a running clock in it
looks like a person that walks ahead exactly as fast as the robot drives, for ever.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heel.schemas import CameraMotion, Track, Tracks
from heel.schemas.base import BoxXyxy
from heel.services.follower.own_motion import Pose

_BOX_PX = 2.0
"""Pixels; a box with edges that move by less has not moved."""
_NOISY_SHARE = 0.04
"""The same as a share of the box's height, where a frozen picture still has noise."""
_CLEAN_SHARE = 0.01
"""The same share where a frozen picture is repeated as it is."""
_STILL_PX = 2.0
"""Drift of the picture's corners that is noise; half a metre at walls 20 m off makes 10 px."""
_ALL_AGREE = 0.85
"""Share of corners that agree in a picture that stands still, noise and all. A robot that drives
straight on sees those far away stand still as well, but not those of the floor: 0.4 to 0.75."""
_DRIFT_S = 1.0
"""Seconds in which the drift of corners falls to 1/e; chosen by hand."""
_LEAST_S = 0.6
"""Seconds: in the picture of a moving robot no person stands still for so long, but for less by
chance."""
_LONGEST_S = 2.5
"""What the robot did before that is another matter."""
_DRIVEN_M = 0.5
"""Metres driven after which a picture must have moved; chosen by hand."""
_TURNED_RAD = 0.12
"""Radians turned after which a picture must have moved; chosen by hand."""
_UNEVEN_M = 0.06
"""Metres by which a drive differs from an even one, from which a person cannot keep pace by chance;
chosen by hand."""
_UNEVEN_RAD = 0.08
"""The same of a turn, radians; chosen by hand."""
_TIMES_NOISE = 3.0
"""A motion counts if it would change the box by so many times what counts as no change."""
_CUT_SHARE = 0.9
"""A box that fills so much of the picture's height does not grow with nearness."""


class _Stillness:
    """For how long a box has not moved, and what the robot did meanwhile.

    Args:
        share: of its height, by which the box may move.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._box: BoxXyxy | None = None
        self._poses: list[tuple[float, Pose]] = []

    def end(self) -> None:
        """The picture moves."""
        self._box, self._poses = None, []

    def goes_on(self, t_s: float, box: BoxXyxy, pose: Pose) -> bool:
        """Take a frame; whether the box is where it was."""
        still = self._box is not None and not self.moved(box)
        if not still:
            self._box, self._poses = box, []
        self._poses.append((t_s, pose))
        while self._poses[0][0] < t_s - _LONGEST_S:
            self._poses.pop(0)
        return still

    def moved(self, box: BoxXyxy) -> bool:
        """Whether a box is elsewhere than the one this began with."""
        if self._box is None:
            return True
        allowed_px = max(_BOX_PX, self._share * (self._box[3] - self._box[1]))
        return any(abs(a - b) > allowed_px for a, b in zip(self._box, box, strict=True))

    @property
    def lasted_s(self) -> float:
        """How long, as far as it is looked back."""
        return self._poses[-1][0] - self._poses[0][0] if self._poses else 0.0

    @property
    def noise(self) -> float:
        """Share of the distance by which a person may have moved unseen."""
        if self._box is None:
            return math.inf
        return max(self._share, _BOX_PX / max(self._box[3] - self._box[1], 1.0))

    def robot_moved(self) -> tuple[float, float]:
        """How far the robot drove (m) and turned (rad) meanwhile."""
        _, first = self._poses[0]
        driven_m = max(math.hypot(p.x_m - first.x_m, p.y_m - first.y_m) for _, p in self._poses)
        return driven_m, max(abs(p.heading_rad - first.heading_rad) for _, p in self._poses)

    def robot_changed(self) -> tuple[float, float]:
        """By how much its way (m) and heading (rad) are off those of any even motion."""
        if len(self._poses) < 3:
            return 0.0, 0.0
        first = self._poses[0]
        times = np.array([t_s - first[0] for t_s, _ in self._poses])
        ways = [math.hypot(p.x_m - first[1].x_m, p.y_m - first[1].y_m) for _, p in self._poses]
        return _unevenness(times, ways), _unevenness(times, [p.heading_rad for _, p in self._poses])


class PictureWatch:
    """Compares the robot's motion with the chosen person's box and the camera's motion.

    Where tracks tell the camera's motion, a picture that stands still while the robot drives or
    turns, with a box that does too, is frozen. Where they do not, a person may walk ahead as fast
    as the robot drives; but no person speeds up, stops and turns at the very moments when the robot
    does, which is later than they do. So then only uneven motion of the robot is evidence.
    """

    def __init__(self) -> None:
        self.frozen = False
        """Whether the picture stands still though the robot moved; until it moves."""
        self._noisy, self._clean = _Stillness(_NOISY_SHARE), _Stillness(_CLEAN_SHARE)
        self._told = True
        self._drift = np.zeros((4, 2))
        self._t_s = -math.inf
        self._t_capture_ns = -1

    def restart(self) -> None:
        """Another picture, or another person is chosen."""
        self.frozen = False
        self._noisy.end()
        self._clean.end()
        self._drift = np.zeros((4, 2))
        self._t_capture_ns = -1

    def frame(
        self, tracks: Tracks, t_s: float, target: Track | None, distance_m: float, pose: Pose
    ) -> None:
        """Take a frame.

        Args:
            tracks: what was seen; one that was taken no later than that before says nothing.
            t_s: when it was taken, on the clock of the pose.
            target: the person followed, None if not seen in this frame.
            distance_m: how far they are.
            pose: of the robot then.
        """
        if tracks.t_capture_ns <= self._t_capture_ns:
            return
        self._t_capture_ns = tracks.t_capture_ns
        moved = self._camera_moved(tracks, t_s)
        if self.frozen:
            self.frozen = not moved and (target is None or not self._noisy.moved(target.box_xyxy))
            return
        if moved or target is None:
            self._noisy.end()
            self._clean.end()
            return
        box, told = target.box_xyxy, _is_told(tracks.camera_motion)
        goes_on = self._noisy.goes_on(t_s, box, pose)
        self._told = told and (self._told or not goes_on)
        self._clean.goes_on(t_s, box, pose)
        cut = box[3] - box[1] >= _CUT_SHARE * tracks.height
        self.frozen = self._ought_to_move(math.inf if cut else distance_m)

    def _ought_to_move(self, distance_m: float) -> bool:
        """Whether what the robot did has to show in the picture or the box."""
        if self._told and self._noisy.lasted_s >= _LEAST_S:
            driven_m, turned_rad = self._noisy.robot_moved()
            noise_m = _TIMES_NOISE * self._noisy.noise * distance_m
            if driven_m > max(_DRIVEN_M, noise_m) or turned_rad > _TURNED_RAD:
                return True
        if self._clean.lasted_s < _LEAST_S:
            return False
        uneven_m, uneven_rad = self._clean.robot_changed()
        noise_m = _TIMES_NOISE * self._clean.noise * distance_m
        return uneven_m > max(_UNEVEN_M, noise_m) or uneven_rad > _UNEVEN_RAD

    def _camera_moved(self, tracks: Tracks, t_s: float) -> bool:
        """Whether what is told of the camera lately is more than noise."""
        self._drift *= math.exp(-max(t_s - self._t_s, 0.0) / _DRIFT_S)
        self._t_s = t_s
        motion = tracks.camera_motion
        if motion is not None and _is_told(motion):
            self._drift += _corner_shifts(motion, tracks.width, tracks.height)
        near_ones_moved = motion is not None and 0.0 < motion.quality < _ALL_AGREE
        moved = near_ones_moved or float(np.sqrt((self._drift**2).sum(axis=1).mean())) > _STILL_PX
        if moved:
            # What has moved by now says nothing of whether it goes on.
            self._drift = np.zeros((4, 2))
        return moved


def _is_told(motion: CameraMotion | None) -> bool:
    return motion is not None and motion.quality > 0.0


def _unevenness(times: NDArray[np.float64], values: list[float]) -> float:
    """Half the spread of values about the straight line that fits them best."""
    line = np.polynomial.Polynomial.fit(times, values, 1)
    off = np.array(values) - line(times)
    return float(off.max() - off.min()) / 2


def _corner_shifts(motion: CameraMotion, width: int, height: int) -> NDArray[np.float64]:
    """(4, 2) pixels by which the picture's corners move, no more than its size."""
    corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1]], float)
    matrix = np.array(motion.affine).reshape(2, 3)
    shifts: NDArray[np.float64] = corners @ matrix.T - corners[:, :2]
    return shifts.clip(-width - height, width + height)
