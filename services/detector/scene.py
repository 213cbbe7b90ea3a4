"""One stream of equal pictures: the size at which it is looked at, and what starts over with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Tracks
from heel.schemas.base import BoxXyxy

T = TypeVar("T")

_MAX_WORK_SIDE_PX = 2048
"""The schema's bound of an evidence map's side."""
_MAX_WORK_PIXELS = 1_000_000
"""Two bit planes of this size stay under the evidence map's byte cap, even where zlib cannot shrink
them."""


@dataclass(frozen=True, slots=True)
class WorkSize:
    """Frame size and the size at which it is looked at, pixels."""

    frame_width: int
    frame_height: int
    width: int
    height: int

    @classmethod
    def of_frame(cls, frame_width: int, frame_height: int, work_width_px: int) -> WorkSize:
        """The largest size of the same shape within all bounds; never larger than the frame."""
        scale = min(
            1.0,
            work_width_px / frame_width,
            _MAX_WORK_SIDE_PX / frame_height,
            math.sqrt(_MAX_WORK_PIXELS / (frame_width * frame_height)),
        )
        width, height = (max(1, int(side * scale)) for side in (frame_width, frame_height))
        return cls(frame_width, frame_height, width, height)

    @property
    def scale_x(self) -> float:
        """Frame pixels per working pixel, horizontally."""
        return self.frame_width / self.width

    @property
    def scale_y(self) -> float:
        """Frame pixels per working pixel, vertically."""
        return self.frame_height / self.height

    def shrink(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(frame_height, frame_width, 3) uint8 to (height, width, 3).

        Whole factors by area averaging, what remains, less than 2, by interpolation, which takes a
        sixth of the time of averaging by a fraction.
        """
        whole = min(self.frame_width // self.width, self.frame_height // self.height)
        if whole > 1:
            between = (self.frame_width // whole, self.frame_height // whole)
            image = np.asarray(cv2.resize(image, between, interpolation=cv2.INTER_AREA), np.uint8)
        if image.shape[:2] != (self.height, self.width):
            size = (self.width, self.height)
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), np.uint8)
        return image

    def to_frame(self, box: tuple[int, int, int, int]) -> BoxXyxy:
        """A working box left, top, width, height as a frame box xyxy."""
        left, top, width, height = box
        return self.box_to_frame((left, top, left + width, top + height))

    def box_to_frame(self, box: BoxXyxy) -> BoxXyxy:
        """A box of working pixels, xyxy, in frame pixels."""
        left, top, right, bottom = box
        return (
            left * self.scale_x, top * self.scale_y, right * self.scale_x, bottom * self.scale_y,
        )  # fmt: skip


class SceneKey(NamedTuple):
    """What tells one scene from another; width and height of the frames, pixels."""

    stream: str
    epoch: int
    width: int
    height: int

    def matching(self, tracks: Tracks | None) -> Tracks | None:
        """The tracks if they are of this scene, else None."""
        if tracks is None:
            return None
        of = (tracks.stream, tracks.epoch, tracks.width, tracks.height)
        return tracks if of == self else None


@dataclass(frozen=True, slots=True, eq=False)
class Scene(Generic[T]):
    """One scene.

    Attributes:
        key: which one.
        size: the working size of its frames.
        state: whatever a detector learns of it.
        reason: why it began, in words.
    """

    key: SceneKey
    size: WorkSize
    state: T
    reason: str


class Scenes(Generic[T]):
    """The scene of the newest frame; a new stream, epoch or size starts over."""

    def __init__(self, work_width_px: int, begin: Callable[[WorkSize], T]) -> None:
        """Scenes looked at in this width, pixels, whose state begins as `begin` makes it."""
        self._work_width_px = work_width_px
        self._begin = begin
        self._scene: Scene[T] | None = None

    @property
    def current(self) -> Scene[T] | None:
        """The scene of the newest frame; None before the first."""
        return self._scene

    def resume(self, key: SceneKey, state: T) -> None:
        """Go on in a scene of which another process has learned so much."""
        size = WorkSize.of_frame(key.width, key.height, self._work_width_px)
        self._scene = Scene(key, size, state, "resumed")

    def of(self, key: SceneKey) -> Scene[T]:
        """The scene of this key."""
        if self._scene is None or key != self._scene.key:
            size = WorkSize.of_frame(key.width, key.height, self._work_width_px)
            reason = _reason(self._scene.key if self._scene else None, key)
            self._scene = Scene(key, size, self._begin(size), reason)
        return self._scene


def _reason(before: SceneKey | None, now: SceneKey) -> str:
    if before is None:
        return "started"
    if (before.width, before.height) != (now.width, now.height):
        return f"size changed from {before.width}x{before.height} to {now.width}x{now.height}"
    return f"stream restarted: epoch {now.epoch} of {now.stream}"
