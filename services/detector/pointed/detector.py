"""Boxes of the person a user pointed at, once there is evidence that it is one."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs
from heel.services.detector.interface import Frame
from heel.services.detector.messages import blobs_message, person_blobs
from heel.services.detector.pointed.finding import looks_upright, most_contrast, outline_box
from heel.services.detector.pointed.person import PointedPerson, Sighting
from heel.services.detector.pointed.proof import Proof
from heel.services.detector.pointed.state import PointedState
from heel.services.detector.scene import SceneKey, WorkSize
from heel.services.geometry.boxes import holds
from heel.services.geometry.picture_motion import EgoMotion, MotionEstimate

NAME = "pointed"
_FORGET_S = 30.0  # a person that was not seen for so long is given up; chosen by hand
_PENDING_S = 5.0
"""Time for which a place without evidence is watched; users were told to wait for so long."""
_MARGIN = 0.1  # of a box, left out of the camera's motion, heights
_BEST_SCORE = 0.95  # of a person that is proven; chosen by hand
_UNPROVEN_SCORE = 0.6  # of what may be a thing; chosen by hand
_DOUBTED_SCORE = 0.5  # of what may be another person; chosen by hand


class PointedAt:
    """Looks for one person: the one pointed at last.

    Attributes:
        count: of the people looked for so far.
    """

    def __init__(self) -> None:
        """Nobody was pointed at yet."""
        self.count = 0
        self._person: PointedPerson | None = None
        self._proof = Proof()
        self._shown = False
        self._pending_s = 0.0
        self._ego = EgoMotion()
        self._last_ns: int | None = None

    @classmethod
    def resumed(cls, state: PointedState) -> PointedAt:
        """Go on after a gap; the person has to be found again in the whole picture."""
        made = cls()
        made.count, made._person = state.count, state.person
        made._proof, made._shown = state.proof, state.shown
        if made._person is not None:
            made._person.interrupt()
        return made

    def state(self, scene: SceneKey) -> PointedState:
        """What `resumed` goes on from, in pictures of this scene."""
        key = scene.stream, scene.epoch, scene.width, scene.height
        return PointedState(key, self._person, self._proof, self._shown, self.count)

    @property
    def is_looking(self) -> bool:
        """Whether a person is being looked for, or may be there."""
        return self._person is not None

    def point(self, smooth: NDArray[np.uint8], x_px: float, y_px: float) -> bool:
        """Look for the person at a point from now on; False where nothing has the shape of one.

        Args:
            smooth: (H, W, 3) uint8 BGR at working size, as the next `look` gets it.
            x_px, y_px: working pixels.
        """
        if self._person is not None and holds(self._person.box_xyxy, (x_px, y_px)):
            # It is watched already: what has been seen of it so far goes on counting.
            self._pending_s = 0.0
            return True
        contrast = most_contrast(smooth, x_px, y_px)
        if contrast is None:
            return False
        if self._person is None:
            self._ego, self._last_ns = EgoMotion(), None
        self.count += 1
        box = outline_box(smooth, contrast.box_xyxy)
        self._person = PointedPerson(box, smooth.shape[0])
        self._proof, self._pending_s = Proof(), 0.0
        self._shown = looks_upright(smooth, contrast, box)
        return True

    def look(self, smooth: NDArray[np.uint8], t_ns: int) -> tuple[Sighting | None, MotionEstimate]:
        """Where the person is in this frame if it is seen, and how the camera has moved.

        Args:
            smooth: (H, W, 3) uint8 BGR at working size; kept, not to be written to afterwards.
            t_ns: its time.
        """
        assert self._person is not None
        dt_s = 0.0 if self._last_ns is None else max(0.0, (t_ns - self._last_ns) * 1e-9)
        self._last_ns = t_ns
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        free = self._free(self._person, grey.shape)
        motion = self._ego.update(grey, free)
        sighting = self._person.look(smooth, motion.affine, dt_s)
        if not self._proof.proves:
            self._proof.look(grey, self._person.box_xyxy, free, t_ns * 1e-9)
        self._pending_s += dt_s
        self._shown = self._shown or self._proof.proves
        if self._person.missed_s > _FORGET_S or (not self._shown and self._pending_s > _PENDING_S):
            self._person = None
        if sighting is None or not self._shown:
            return None, motion
        return replace(sighting, proven=self._proof.proves), motion

    @staticmethod
    def _free(person: PointedPerson, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """Where nobody is, as `estimate_motion` takes it."""
        free = np.full(shape[:2], 255, np.uint8)
        left, top, right, bottom = person.box_xyxy
        margin = _MARGIN * (bottom - top)
        rows = slice(max(0, int(top - margin)), max(0, int(bottom + margin)))
        free[rows, max(0, int(left - margin)) : max(0, int(right + margin))] = 0
        return free


def people_message(
    frame: Frame, size: WorkSize, sighting: Sighting | None, motion: MotionEstimate, count: int
) -> Blobs:
    """Blobs of kind `people`; the score is how alike the person looks to itself before.

    It goes no higher than such boxes are trusted. How often boxes of which score are on people,
    benchmarks/empty_clicks.py prints.

    Args:
        frame: the frame.
        size: its size and working size.
        sighting: of the person in it, None if it is not seen.
        motion: of the camera, working pixels.
        count: number of the person among those pointed at.
    """
    blobs: list[Blob] = []
    if sighting is not None:
        most = _BEST_SCORE if sighting.proven else _UNPROVEN_SCORE
        score = _DOUBTED_SCORE if sighting.doubted else min(most, sighting.likeness)
        box = size.box_to_frame(sighting.box_xyxy)
        blobs = person_blobs([(box, score)], frame.image, proven=sighting.proven)
    return blobs_message(frame, size, NAME, blobs, motion, kind="people", sought=count)
