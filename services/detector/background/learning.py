"""What a background may learn, and what it has to unlearn.

`StillnessGate` keeps it from learning the people in view at the start, `LateFrames` those that are
confirmed, and `GhostFinder` finds where a person was learned all the same and has walked away.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.blobs import FOREGROUND, NONE
from heel.services.detector.background.evidence import Indices, indices_of
from heel.services.detector.feedback import free_mask, shift_s
from heel.services.detector.scene import WorkSize
from heel.services.geometry.picture_motion import Affine

_SETTLE_S = 0.16  # a pixel that has been still for this long is background; chosen by hand
_KNOWN_SHARE = 0.9  # of the pixels: with fewer the background is not to be believed; chosen by hand
_HALF_A_PERSON = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 17))
"""At working size: plain clothes move unseen between their edges."""
_MAX_SHIFT_S = 1.0
"""Tracks speak for frames at most this far from their own: beyond it a position is a guess."""
_SPARE_FRAMES = 6
"""A tracker may be late by so many frames before a frame is learned without its tracks."""
_GHOST_EDGES = 0.6
"""A region is suspected when more of the edge strength on its outline is the background's."""
_GHOST_AFTER_S = 0.4  # suspected for this long, it is a ghost; chosen by hand
_RING = np.ones((5, 5), np.uint8)  # width of an outline, working pixels
_SPECKS = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 7))
"""Opening before outlines are looked at."""
_NOTHING = np.zeros(0, np.intp)  # no pixel


class StillnessGate:
    """Says per pixel when the background is first known.

    The first frame is not an empty scene. Until a pixel has been still for a while its background
    is unknown: nothing is learned there, and what moves is foreground.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        t_ns: int,
        limit_s: float,
        known: NDArray[np.uint8] | None = None,
    ) -> None:
        """Know nothing, or what another model has learned.

        Args:
            shape: height and width of the maps.
            t_ns: time of the first frame.
            limit_s: every pixel counts as known after this time: waving leaves never settle.
            known: (H, W) uint8, 255 where the background is known already.
        """
        self._known = np.zeros(shape, np.uint8) if known is None else known.copy()
        self._still_s = np.zeros(shape, np.float32)
        self._start_ns = self._last_ns = t_ns
        self._limit_s = limit_s
        self._share = float(np.count_nonzero(self._known)) / self._known.size
        self.done = False

    @property
    def known(self) -> NDArray[np.uint8]:
        """(H, W) uint8, 255 where the background is known."""
        return np.full_like(self._known, 255) if self.done else self._known

    @property
    def learning(self) -> bool:
        """Whether so much is unknown that the background is not to be believed."""
        return not self.done and self._share < _KNOWN_SHARE

    def allow(self, free: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """What may be learned of what is free; (H, W) uint8, 0 or 255."""
        return free if self.done else free & self._known

    def settle(self, moving: NDArray[np.uint8], t_ns: int) -> Indices:
        """Take one frame; the pixels whose background is known from now on.

        Args:
            moving: (H, W) uint8, 255 where it moves.
            t_ns: time of the frame.
        """
        if self.done or t_ns == self._start_ns:
            return _NOTHING
        self._still_s += np.float32(max(0, t_ns - self._last_ns) * 1e-9)
        self._still_s[_whole(moving) > 0] = 0.0
        self._last_ns = t_ns
        self.done = t_ns - self._start_ns > self._limit_s * 1e9
        still = (self._still_s >= 0.99 * _SETTLE_S) | self.done
        settled = (self._known == 0) & still
        self._known[settled] = 255
        self._share = float(np.count_nonzero(self._known)) / self._known.size
        return np.flatnonzero(settled)

    def correct(self, labels: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Labels with what moves, whole, as foreground where the background is unknown."""
        if self.done:
            return labels
        guess = np.where(_whole(moving) > 0, np.uint8(FOREGROUND), np.uint8(NONE))
        return np.where(self._known == 0, guess, labels)


def _whole(moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.morphologyEx(moving, cv2.MORPH_CLOSE, _HALF_A_PERSON), np.uint8)


@dataclass(frozen=True, slots=True)
class LateFrame:
    """A frame that is due.

    Attributes:
        image: (H, W, 3) uint8.
        free: (H, W) uint8, 0 under protected people, else 255.
        dt_s: seconds since the frame that was due before.
        protected_seq: frame whose tracks protected it, None without.
    """

    image: NDArray[np.uint8]
    free: NDArray[np.uint8]
    dt_s: float
    protected_seq: int | None


@dataclass(frozen=True, slots=True)
class _Waiting:
    frame: FrameId
    image: NDArray[np.uint8]
    forgotten: list[Indices] = field(default_factory=list)


class LateFrames:
    """Frames that wait for their tracks, at most `lag_frames` and a few more.

    Protection is then exact whatever the lag. Every confirmed person is protected, seen or not: one
    that is `occluded` or `lost` may well stand there unseen, and would be learned just then.

    A frame that was never tracked (a live stream skips some) takes the tracks of the nearest later
    one. When the queue is full the oldest goes with the last tracks there were.
    """

    def __init__(self, size: WorkSize, lag_frames: int, start_ns: int) -> None:
        self._size = size
        self._bound = lag_frames + _SPARE_FRAMES
        self._waiting: deque[_Waiting] = deque()
        self._tracks: Tracks | None = None
        self._last_ns = start_ns

    def add(self, frame: FrameId, image: NDArray[np.uint8]) -> None:
        """Let a frame wait; the image is kept and must not be written to afterwards."""
        self._waiting.append(_Waiting(frame, image))

    def forget(self, index: Indices) -> None:
        """Let no waiting frame teach these pixels: the model has started over there since."""
        if index.size:
            for waiting in self._waiting:
                waiting.forgotten.append(index)

    def due(self, tracks: Tracks | None) -> Iterator[LateFrame]:
        """The frames to be learned now, oldest first.

        Args:
            tracks: of an earlier frame of the same size; None when there are none.
        """
        if tracks is not None and (self._tracks is None or tracks.seq > self._tracks.seq):
            self._tracks = tracks
        done = -1 if self._tracks is None else self._tracks.seq
        while self._waiting and (
            self._waiting[0].frame.seq <= done or len(self._waiting) > self._bound
        ):
            yield self._release(self._waiting.popleft())

    def _release(self, waiting: _Waiting) -> LateFrame:
        frame, people = waiting.frame, self._tracks
        if people is not None and abs(shift_s(people, frame)) > _MAX_SHIFT_S:
            people = None
        free = free_mask(people, frame, self._size)
        for index in waiting.forgotten:
            free.reshape(-1)[index] = 0
        dt_s = max((frame.t_capture_ns - self._last_ns) * 1e-9, 1e-3)
        self._last_ns = frame.t_capture_ns
        return LateFrame(waiting.image, free, dt_s, None if people is None else people.seq)


class GhostFinder:
    """Finds foreground that is not there: the hole left by a person that was learned as background.

    A region is a ghost when its outline is an edge of the background model and not of the frame.
    R. Cucchiara et al., "Detecting moving objects, ghosts, and shadows in video streams", PAMI
    2003, ask the same of motion; the outline also tells for people at rest.
    """

    def __init__(self, shape: tuple[int, int], t_ns: int | None = None) -> None:
        """For maps of this height and width, beginning at this time or with the first look."""
        self._suspected_s = np.zeros(shape, np.float32)
        self._last_ns = t_ns

    def warp(self, affine: Affine) -> None:
        """Follow the motion of the camera, (2, 3), old to new pixels."""
        rows, columns = self._suspected_s.shape
        self._suspected_s = np.asarray(
            cv2.warpAffine(self._suspected_s, affine, (columns, rows), flags=cv2.INTER_NEAREST),
            np.float32,
        )

    def find(
        self,
        image: NDArray[np.uint8],
        background: NDArray[np.float32],
        mask: NDArray[np.uint8],
        t_ns: int,
    ) -> Indices:
        """Pixels that are to be learned at once.

        Args:
            image: (H, W, 3) uint8.
            background: (H, W, 3) float32, the mean of the model.
            mask: (H, W) uint8, 255 where there is foreground.
            t_ns: time of the frame.
        """
        dt_s = 0.0 if self._last_ns is None else max(0, t_ns - self._last_ns) * 1e-9
        self._last_ns = t_ns
        region = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, _SPECKS), np.uint8)
        labels = np.asarray(cv2.connectedComponents(region)[1], np.int32)
        suspect = _suspects(image, background, region, labels)
        if not suspect.any():
            self._suspected_s.fill(0.0)
            return _NOTHING
        index = indices_of(region)
        index = index[suspect[labels.reshape(-1).take(index)]]
        so_far_s = self._suspected_s.reshape(-1).take(index) + np.float32(dt_s)
        self._suspected_s.fill(0.0)
        self._suspected_s.reshape(-1)[index] = so_far_s
        ghost = np.asarray(self._suspected_s > _GHOST_AFTER_S, np.uint8)
        return indices_of(np.asarray(cv2.dilate(ghost, _RING), np.uint8))


def _suspects(
    image: NDArray[np.uint8],
    background: NDArray[np.float32],
    region: NDArray[np.uint8],
    labels: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """By label, whether the outline is an edge of the background; label 0 is never."""
    count = int(labels.max(initial=0)) + 1
    if count == 1:
        return np.zeros(1, np.bool_)
    index = indices_of(np.asarray(cv2.morphologyEx(region, cv2.MORPH_GRADIENT, _RING), np.uint8))
    # Labels up to 2^24 are exact in float32, which is what dilation takes.
    near = np.asarray(cv2.dilate(labels.astype(np.float32), _RING))
    near = near.reshape(-1)[index].astype(np.intp)
    in_image = np.bincount(near, _edges(image, index), count)
    in_model = np.bincount(near, _edges(background, index), count)
    suspect = in_model > _GHOST_EDGES * (in_model + in_image + 1e-6)
    suspect[0] = False
    return np.asarray(suspect, np.bool_)


def _edges(image: NDArray[np.uint8] | NDArray[np.float32], index: Indices) -> NDArray[np.float32]:
    """Strength of the edges of a (H, W, 3) image at some of its pixels."""
    grey = cv2.cvtColor(cv2.convertScaleAbs(image), cv2.COLOR_BGR2GRAY)
    across, down = cv2.spatialGradient(grey)
    return np.hypot(across.reshape(-1).take(index), down.reshape(-1).take(index), dtype=np.float32)
