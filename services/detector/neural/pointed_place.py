"""Where a user pointed at somebody whom the network does not see in the whole frame.

Small networks miss a person in the colours of what is behind, whom a closer look at just this place
finds. How large the person is nobody knows: likely sizes take turns.
"""

from __future__ import annotations

from collections.abc import Sequence

from heel.schemas.base import Point
from heel.services.detector.interface import Frame
from heel.services.detector.neural.views import Expected
from heel.services.geometry.boxes import around, holds
from heel.services.geometry.picture_motion import CameraPath, moved_point

_LOOK_NS = 5_000_000_000
"""For so long a place is looked at: as long as the follower waits for somebody there."""
_HEIGHTS = (0.1, 0.2, 0.35)
"""Of the frame's height, of people at 11, 5 and 3 m: nearer ones the whole frame shows as well."""
_WIDTH = 0.4
"""Of their height; chosen by hand."""


class PointedPlace:
    """The place pointed at last, carried along with the picture."""

    def __init__(self) -> None:
        """Nobody was pointed at yet."""
        self._point: Point | None = None
        self._from_ns = 0
        self._seq = 0
        self._turn = 0

    def expected(
        self, frame: Frame, camera: CameraPath, others: Sequence[Expected]
    ) -> list[Expected]:
        """A person of a likely size at the place; nobody where one is expected there anyway.

        Args:
            frame: this one; a point of another stream or size is of no use.
            camera: how it has moved, up to this frame.
            others: people that are expected.
        """
        if frame.pointed is not None:
            self._take(frame)
        if self._point is None:
            return []
        motion = camera.since(self._seq)
        if motion is None or not 0 <= frame.id.t_capture_ns - self._from_ns <= _LOOK_NS:
            self._point = None
            return []
        self._point, self._seq = moved_point(motion, self._point), frame.id.seq
        if any(holds(one.box_xyxy, self._point) for one in others):
            return []
        self._turn = (self._turn + 1) % len(_HEIGHTS)
        height = _HEIGHTS[self._turn] * frame.image.shape[0]
        return [Expected(around(self._point, _WIDTH * height, height), None)]

    def _take(self, frame: Frame) -> None:
        pointed = frame.pointed
        assert pointed is not None
        if (
            pointed.frame.stream,
            pointed.frame.epoch,
            pointed.width,
            pointed.height,
        ) == frame.scene:
            self._point, self._seq = (pointed.x_px, pointed.y_px), pointed.frame.seq
            self._from_ns = frame.id.t_capture_ns
