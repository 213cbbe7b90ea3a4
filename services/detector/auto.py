"""The detector that adapts: to what the camera does, and to what a user points at."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, Pointed, Tracks
from heel.schemas.blobs import FOREGROUND
from heel.services.detector.background.detector import BackgroundDetector
from heel.services.detector.background.evidence import Seen, smoothed
from heel.services.detector.background.foreground import MovingForeground, StandingForeground
from heel.services.detector.feedback import free_mask
from heel.services.detector.interface import Frame
from heel.services.detector.pointed.detector import PointedAt, people_message
from heel.services.detector.pointed.proof import Proof
from heel.services.detector.pointed.state import PointedState, read, write
from heel.services.detector.scene import Scene, Scenes, WorkSize
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.picture_motion import MotionEstimate, RestWatch, StandingWatch

_FLOODED_SHARE = 0.6
"""More foreground than this share of the picture is no people but a model that does not hold."""
_FLOODED_S = 0.5  # flooded for longer than this, the model starts over; chosen by hand


class AutoDetector:
    """A background while it shows the person wanted, else the colours of the one pointed at.

    A person that stands from the start is background, and a robot that drives close behind a person
    sees the floor move otherwise than the walls, so that no background can be warped along. A point
    at which nobody is tracked says where to look all the same.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        """With nothing known of the scene."""
        self._settings = settings
        self._background = BackgroundDetector(AutoForeground, settings)
        self._scenes = Scenes(settings.work_width_px, lambda _: PointedAt())

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame, of kind `people` while a person pointed at is looked for."""
        scene = self._scenes.of(frame.scene)
        if frame.pointed is None and not scene.state.is_looking:
            return self._background.detect(frame)
        smooth = smoothed(scene.size.shrink(frame.image), self._settings.blur_px)
        if frame.pointed is not None:
            self._point(scene, smooth, frame.pointed)
        if not scene.state.is_looking:
            return self._background.detect(frame)
        sighting, motion = scene.state.look(smooth, frame.id.t_capture_ns)
        return people_message(frame, scene.size, sighting, motion, scene.state.count)

    def snapshot(self) -> bytes:
        """The person pointed at, as `restore` takes it; the background is learned anew."""
        scene = self._scenes.current
        state = PointedState(None, None, Proof(), False, 0)
        if scene is not None:
            state = scene.state.state(scene.key)
        return write(state, self._fingerprint())

    def restore(self, snapshot: bytes) -> None:
        """Look for the person that a detector with the same settings has looked for.

        Raises:
            StateError: it is no such snapshot; nothing has changed then.
        """
        state = read(snapshot, self._fingerprint())
        if state.key is not None:
            self._scenes.resume(state.key, PointedAt.resumed(state))

    def _fingerprint(self) -> str:
        return repr([self._settings.work_width_px, self._settings.blur_px])

    def _point(self, scene: Scene[PointedAt], smooth: NDArray[np.uint8], pointed: Pointed) -> None:
        of = (pointed.frame.stream, pointed.frame.epoch, pointed.width, pointed.height)
        if of != scene.key:
            return
        x, y = pointed.x_px / scene.size.scale_x, pointed.y_px / scene.size.scale_y
        if scene.state.point(smooth, x, y):
            # Whatever it has learned is of another view by the time it is needed again.
            self._background = BackgroundDetector(AutoForeground, self._settings)


class AutoForeground:
    """The standing background while the camera stands still, the moving one while it moves.

    Either begins with what the other has learned, so that a change of model floods nothing with
    foreground. Where neither holds (the camera's motion cannot be told, or most of the picture
    would be foreground) nothing is reported as seen, and the message says so.
    """

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        self._size = size
        self._settings = settings
        self._standing: StandingForeground | None = StandingForeground(size, settings)
        self._moving: MovingForeground | None = None
        self._watch = StandingWatch()
        self._rest = RestWatch(size.width, size.height)
        self._flooded_ns: int | None = None

    @property
    def name(self) -> str:
        """Of the background that is believed."""
        return MovingForeground.name if self._standing is None else StandingForeground.name

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame with the model that fits."""
        moved = self._has_moved(image, frame, feedback)
        if moved is not None and self._standing is not None:
            self._start_moving(self._standing)
        if self._standing is not None:
            seen = self._standing.look(image, frame, feedback)
        else:
            assert self._moving is not None
            seen = self._moving.look(image, frame, feedback, moved)
            if seen.motion is not None and self._rest.update(seen.motion, frame.t_capture_ns):
                self._start_standing(self._moving)
        return self._judged(seen, frame.t_capture_ns)

    def _has_moved(
        self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None
    ) -> MotionEstimate | None:
        if self._standing is None:
            return None
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        free = free_mask(feedback, frame, self._size)
        return self._watch.update(grey, free, frame.t_capture_ns)

    def _start_moving(self, before: StandingForeground) -> None:
        self._moving = MovingForeground(self._size, self._settings, before.learned)
        self._rest = RestWatch(self._size.width, self._size.height)
        self._standing = None

    def _start_standing(self, before: MovingForeground) -> None:
        self._standing = StandingForeground(self._size, self._settings, before.learned)
        self._watch = StandingWatch()
        self._moving = None

    def _judged(self, seen: Seen, t_ns: int) -> Seen:
        """What was seen, or nothing where that cannot be people."""
        share = 0.0
        if seen.evidence is not None and not seen.learning:
            share = float(np.count_nonzero(seen.evidence >= FOREGROUND)) / seen.evidence.size
        if share < _FLOODED_SHARE:
            self._flooded_ns = None
            return seen
        if self._flooded_ns is None:
            self._flooded_ns = t_ns
        elif t_ns - self._flooded_ns > _FLOODED_S * 1e9:
            self._start_over()
        reason = f"{share:.0%} of the picture differs from the background"
        return Seen(None, [], False, seen.protected_seq, seen.motion, reason)

    def _start_over(self) -> None:
        """The light or the scene is another one: nothing that was learned is of use."""
        self._flooded_ns = None
        self._watch = StandingWatch()
        if self._standing is not None:
            self._standing = StandingForeground(self._size, self._settings)
        else:
            self._moving = MovingForeground(self._size, self._settings)
