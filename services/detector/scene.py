"""What belongs to one stream of equal pictures, and starts over with another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from heel.schemas import Tracks
from heel.services.detector.work_size import WorkSize

T = TypeVar("T")


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
