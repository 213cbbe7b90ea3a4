"""Parts of a frame that are worth a closer look: a network sees small people only enlarged."""

from __future__ import annotations

from dataclasses import dataclass

from heel.schemas.base import BoxXyxy

_HEIGHTS = 4.0
"""Height of a view, in heights of the person it is for: they are then about 100 of a network's 416
pixels high, the size at which it finds most, and who stands beside them is in the view as well."""
_LEAST_GAIN = 1.25
"""A view that enlarges less than this against the whole frame shows nothing new."""
_TILE_GAIN = 2.0


@dataclass(frozen=True, slots=True)
class View:
    """A part of a frame, whole pixels."""

    left: int
    top: int
    width: int
    height: int

    def holds(self, box: BoxXyxy) -> bool:
        """Whether a box lies wholly inside."""
        left, top, right, bottom = box
        across = self.left <= left and right <= self.left + self.width
        return across and self.top <= top and bottom <= self.top + self.height

    def cuts(self, box: BoxXyxy, frame_width: int, frame_height: int, margin_px: float) -> bool:
        """Whether a box seen in this view reaches an edge of it that is none of the frame's."""
        left, top, right, bottom = box
        return bool(
            (self.left > 0 and left < self.left + margin_px)
            or (self.top > 0 and top < self.top + margin_px)
            or (self.left + self.width < frame_width and right > self.left + self.width - margin_px)
            or (
                self.top + self.height < frame_height
                and bottom > self.top + self.height - margin_px
            )
        )


class Views:
    """The views of frames of one size."""

    def __init__(self, frame_size: tuple[int, int], input_size: tuple[int, int]) -> None:
        """Of frames and for a network input of these widths and heights, pixels."""
        self._frame, self._input = frame_size, input_size
        self.whole = View(0, 0, *frame_size)
        self._whole_scale = self._scale(self.whole)
        self.tiles = self._tiled()

    def around(self, box: BoxXyxy) -> View | None:
        """The view for a person in this box; None where the whole frame shows them as well."""
        height = _HEIGHTS * max(1.0, box[3] - box[1])
        width = height * self._input[0] / self._input[1]
        view = self._placed((box[0] + box[2]) / 2, (box[1] + box[3]) / 2, width, height)
        return view if self._scale(view) >= _LEAST_GAIN * self._whole_scale else None

    def _scale(self, view: View) -> float:
        return min(self._input[0] / view.width, self._input[1] / view.height)

    def _placed(self, x: float, y: float, width: float, height: float) -> View:
        """As near to a centre as the frame allows."""
        w = max(1, min(round(width), self._frame[0]))
        h = max(1, min(round(height), self._frame[1]))
        left = min(max(0, round(x - w / 2)), self._frame[0] - w)
        top = min(max(0, round(y - h / 2)), self._frame[1] - h)
        return View(left, top, w, h)

    def _tiled(self) -> tuple[View, ...]:
        """Views that together cover the frame, overlapping; none where it is small anyway."""
        if self._whole_scale * _LEAST_GAIN > 1.0:
            return ()
        width, height = (side / (self._whole_scale * _TILE_GAIN) for side in self._input)
        return tuple(
            self._placed(x, y, width, height)
            for y in _centres(self._frame[1], height)
            for x in _centres(self._frame[0], width)
        )


def _centres(length: float, tile: float) -> list[float]:
    """Where tiles that overlap by a quarter at least lie along one side."""
    if tile >= length:
        return [length / 2]
    count = 1 + max(1, -int(-(length - tile) // (0.75 * tile)))
    step = (length - tile) / (count - 1)
    return [tile / 2 + step * place for place in range(count)]
