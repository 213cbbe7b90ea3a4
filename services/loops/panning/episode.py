"""One person followed through a recording by a window that turns as the follower commands."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heel.schemas import CameraInfo, DriveState, FrameId, TargetRequest, Tracks
from heel.services.capture.pan_window import PanSettings, PanWindow
from heel.services.capture.steering import Steering
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveSettings
from heel.services.follower.choosing import at_point
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.geometry.boxes import clipped, iou, iou_matrix
from heel.services.loops.control_loop import CONTROL_NS, Body, ControlLoop
from heel.services.loops.judge import ACTING
from heel.services.loops.panning.perception import WindowPerception
from heel.services.loops.panning.truth import InWindow, TruePeople, in_window

LEAST_INSIDE = 0.5
"""Share of a person inside the window from which the person counts as in sight; chosen by hand:
half a body."""
LEAST_OVERLAP = 0.5
"""Intersection over union from which a box is on a person: MOTChallenge's."""
_STREAM = "front"


@dataclass
class PanOutcome:
    """Frames of one person's episode in which they are to be seen in the recording.

    Attributes:
        person: identity in the ground truth.
        visible: all of them.
        since_chosen: those after the frame in which the person was pointed at; the others count
            for none of the following.
        in_window: the person is in the window with half of their box or more.
        kept: in the window, and the target's box lies on them.
        wrong: the target's box lies on another person.
        acted_wrong: those of them in which the robot acts upon it, rather than wait.
        lost: frames after the choice in which the person was not kept, and the follower's state.
    """

    person: int
    visible: int = 0
    since_chosen: int = 0
    in_window: int = 0
    kept: int = 0
    wrong: int = 0
    acted_wrong: int = 0
    lost: list[tuple[int, str]] = field(default_factory=list)

    @property
    def chosen(self) -> bool:
        """Whether the person was ever pointed at."""
        return self.since_chosen > 0


class Episode:
    """Window, perception, follower and drive on a simulated clock.

    The person is pointed at in the first frame in which a shown box lies on them. The robot
    stands and turns: nothing in a recording answers to its driving.

    Args:
        person: identity in the ground truth.
        recording_size: (width, height) of its pictures, pixels.
        settings: of the window; starts where the person will first be seen.
        perception: knows nobody yet.
    """

    def __init__(
        self, person: int, recording_size: tuple[int, int], settings: PanSettings,
        perception: WindowPerception,
    ) -> None:  # fmt: skip
        self._size = recording_size
        self._window = PanWindow(recording_size, settings)
        self._steering = Steering(self._window)
        self._perception = perception
        self._follower = Follower(FollowerSettings(max_linear_mps=0.0))
        self._control = ControlLoop(self._follower, Drive(DriveSettings()), self._look)
        self._seq = self._rounds = 0
        self._now_ns: int | None = None
        self.outcome = PanOutcome(person)

    def frame(self, index: int, t_s: float, image: NDArray[np.uint8], people: TruePeople) -> None:
        """Go on to the moment of a frame, look at it, and judge.

        Args:
            index: of the frame, from 0.
            t_s: its time; the first frame's is where the clock starts.
            image: (H, W, 3) uint8 BGR, the whole picture.
            people: everybody in it.
        """
        t_ns = round(t_s * 1e9)
        if self._now_ns is None:
            self._now_ns = t_ns
            self._follower.set_camera(self._camera())
        while self._now_ns < t_ns:
            self._control.round(self._now_ns, self._move)
            self._steering.hear_target(self._follower.target.track_id)
            self._now_ns += CONTROL_NS
            self._rounds += 1
        self._steering.advance(t_s)
        window = self._window.view(image, index)
        size = (self._window.width, self._window.height)
        truth = in_window(people, self._size, self._window.offset_px, size)
        frame = FrameId(stream=_STREAM, epoch=1, seq=self._seq, index=index, t_capture_ns=t_ns)
        self._seq += 1
        tracks = self._perception.see(frame, window, self._window.offset_px, truth)
        self._judge(index, tracks, truth)
        self._control.show(t_ns, tracks, truth)

    def _move(self, told: DriveState) -> Body:
        self._steering.hear_drive(told.angular_radps, (self._now_ns or 0) / 1e9)
        return Body(self._steering.odometry(self._rounds))

    def _look(self, tracks: Tracks, truth: InWindow) -> None:
        if self._follower.target.track_id is None:
            self._point(tracks, truth)
        self._steering.hear_tracks(tracks)

    def _point(self, tracks: Tracks, truth: InWindow) -> None:
        """Click on the person, if that hits nobody else's box."""
        box = _box_of(truth, self.outcome.person)
        if box is None:
            return
        x, y = float(box[0] + box[2]) / 2, float(box[1] + box[3]) / 2
        hit = at_point(tracks, x, y)
        if hit is not None and iou(box.tolist(), hit.box_xyxy) >= LEAST_OVERLAP:
            self._follower.choose(TargetRequest(mode="point", x_px=x, y_px=y))

    def _judge(self, index: int, tracks: Tracks, truth: InWindow) -> None:
        outcome = self.outcome
        target = self._follower.target.track_id
        mine = truth.identities == outcome.person
        outcome.visible += int(mine.any())
        if target is None or not mine.any():
            return
        outcome.since_chosen += 1
        inside = bool(truth.inside[mine][0] >= LEAST_INSIDE)
        outcome.in_window += int(inside)
        on = _on_whom(tracks, target, truth)
        if inside and on == outcome.person:
            outcome.kept += 1
            return
        wrong = on not in (None, outcome.person)
        outcome.wrong += int(wrong)
        outcome.acted_wrong += int(wrong and self._follower.state.state in ACTING)
        outcome.lost.append((index + 1, self._follower.state.state))

    def _camera(self) -> CameraInfo:
        width, height = self._window.width, self._window.height
        return CameraInfo(
            stream=_STREAM, epoch=1, width=width, height=height, source_width=width,
            source_height=height, fps=1.0, source="virtual pan",
            horizontal_fov_rad=self._window.fov_rad,
        )  # fmt: skip


def _box_of(truth: InWindow, person: int) -> NDArray[np.float64] | None:
    mine = truth.identities == person
    if not mine.any() or truth.inside[mine][0] < LEAST_INSIDE:
        return None
    return np.asarray(truth.boxes_xyxy[mine][0])


def _on_whom(tracks: Tracks, target: int, truth: InWindow) -> int | None:
    """The person that the target's box lies on best, if on any; None if it is not shown."""
    track = next((track for track in tracks.tracks if track.id == target), None)
    if track is None or not track.shown or not len(truth.identities):
        return None
    box = clipped(np.array([track.box_xyxy]), (tracks.width, tracks.height))
    shares = iou_matrix(box, truth.boxes_xyxy)[0]
    best = int(np.argmax(shares))
    return int(truth.identities[best]) if shares[best] >= LEAST_OVERLAP else None
