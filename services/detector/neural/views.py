"""Parts of a frame that the network looks at in another size: it sees small people only enlarged,
and people who fill the picture only made smaller, with grey around the frame.

`Views` are the parts there are, `Attention` chooses those of a frame in turns, so that nobody is
forgotten, `look` runs the network on one, and `together` makes one list of what it found in two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.geometry.boxes import cover_matrix, iou_matrix
from heel.services.networks.person_model import PAD_GREY, Detections, PersonModel, without_doubles

_PERSON_PX = 104.0
"""Of the network's input: height of the person that a view is for. Networks of 192 and of 416
pixels alike find most people at 50 to 160, and the neighbours are to be in the view as well."""
_PERSON_SHARE = 0.5  # of the input's height, at most: as much again is around the person
_MOST_ZOOM = 1.5
"""Of the frame's own pixels: enlarged further they are blurred, and fewer people are found."""
_LEAST_GAIN = 1.25  # a view that enlarges less than this against the whole frame shows nothing new
_TOO_LARGE = 0.6
"""Of the input's height: a person that is higher fills the picture, and is found seldom. From 1.1 m
one has a score of 0.2 to 0.8 by a network of 192 pixels, and 0.8 and more with grey around."""
_TILE_GAIN = 2.0  # how much the tiles of a search enlarge; chosen by hand
_NEAR_LEAST_PX = 56.0
"""Height in the frame from which the smaller of two networks finds a person as well as the larger:
of people of 42 pixels it finds 68 to 80 of 100, the larger one 92 to 100, at 65 both 92 to 98."""
_NEWCOMER_TURN = 2
"""A person without an identity waits as long as one that was looked at so many frames ago."""
_SEARCH_LOOKS = 16
"""Where nobody is expected one look goes among so many that a frame may have, and one in every
frame as long as nobody is expected anywhere."""
_FRAME_PIXELS = 350_000
"""That a network is shown of a frame, in closer looks: two of 416x416 pixels, eight of 192x192."""
_MOST_LOOKS = 8
"""Closer looks at a frame, however small the network: so many people in turns; chosen by hand."""
_NEAR_LOOKS = 3
"""Of the smaller of two networks: with more the pair takes as long as the larger one alone."""
_EDGE_SHARE = 0.01
"""Boxes nearer to the edge of a view than this share of its height are cut off by it."""
_SAME_IOU = 0.4  # from this overlap on a box of the frame and one of a view are of the same person
_FRAGMENT = 0.7
"""A box of a view with this share of its area inside a larger person is a piece of it."""


@dataclass(frozen=True, slots=True)
class View:
    """A part of a frame, or more than all of it, in whole pixels.

    Attributes:
        left, top: negative where it reaches beyond the frame.
        width, height: of the view.
        near: whether the smaller of two networks is to see it.
    """

    left: int
    top: int
    width: int
    height: int
    near: bool = False

    @property
    def reaches_beyond(self) -> bool:
        """Whether there is grey around the frame in it."""
        return self.left < 0 or self.top < 0

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

    def __init__(
        self, frame_size: tuple[int, int], input_size: tuple[int, int], near: bool = False
    ) -> None:
        """Of frames and for a network input of these widths and heights, pixels."""
        self._frame, self._input, self._near = frame_size, input_size, near
        self.whole = View(0, 0, *frame_size, near)
        self._whole_scale = self._scale(self.whole)
        self.tiles = self._tiled()

    def around(self, box: BoxXyxy) -> View | None:
        """The view for a person in this box; None where the whole frame shows them as well."""
        person_px = min(_PERSON_PX, _PERSON_SHARE * self._input[1])
        height_px = max(1.0, box[3] - box[1])
        zoom = min(_MOST_ZOOM, person_px / height_px)
        if height_px * self._whole_scale > _TOO_LARGE * self._input[1]:
            return self._beyond(zoom)
        width, height = (side / zoom for side in self._input)
        view = self._placed((box[0] + box[2]) / 2, (box[1] + box[3]) / 2, width, height)
        return view if self._scale(view) >= _LEAST_GAIN * self._whole_scale else None

    def _scale(self, view: View) -> float:
        return min(self._input[0] / view.width, self._input[1] / view.height)

    def _beyond(self, zoom: float) -> View:
        """The whole frame with as much around it as makes it so small."""
        width, height = (round(side / zoom) for side in self._input)
        left, top = (self._frame[0] - width) // 2, (self._frame[1] - height) // 2
        return View(left, top, width, height, self._near)

    def _placed(self, x: float, y: float, width: float, height: float) -> View:
        """As near to a centre as the frame allows."""
        w = max(1, min(round(width), self._frame[0]))
        h = max(1, min(round(height), self._frame[1]))
        left = min(max(0, round(x - w / 2)), self._frame[0] - w)
        top = min(max(0, round(y - h / 2)), self._frame[1] - h)
        return View(left, top, w, h, self._near)

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


@dataclass(frozen=True, slots=True)
class Expected:
    """A person that is likely to be in this frame.

    Attributes:
        box_xyxy: where, frame pixels.
        track_id: of the person, None for one without an identity yet.
    """

    box_xyxy: BoxXyxy
    track_id: int | None


class Attention:
    """Chooses the views of a frame."""

    def __init__(self, views: Views, most: int, near: tuple[Views, int] | None = None) -> None:
        """Start with nobody looked at.

        Args:
            views: of the network, for whom it looks at whole frames.
            most: views of it in a frame.
            near: of a second, smaller network for those that are not small; and most views of both.
        """
        self._views, self._most_far = views, most
        self._near, self._most = near or (views, most)
        self._search_turn = -(-_SEARCH_LOOKS // max(1, most))
        self._looked: dict[int, int] = {}
        self._searched, self._tile, self._turn = 0, 0, 0

    def next_views(self, expected: Sequence[Expected]) -> list[View]:
        """The views of the people that have waited longest, and now and then a tile of the frame.

        None where a closer look at anybody would show no more than the whole frame does.

        Args:
            expected: people likely to be in this frame.
        """
        views: list[View] = []
        while len(views) < self._most and (view := self._next_view(expected, views)) is not None:
            views.append(view)
        return views

    def _next_view(self, expected: Sequence[Expected], chosen: Sequence[View]) -> View | None:
        self._turn += not chosen
        known = {person.track_id for person in expected}
        self._looked = {one: turn for one, turn in self._looked.items() if one in known}
        far_left = sum(not view.near for view in chosen) < self._most_far
        waiting = [
            (self._last_look(person), view)
            for person in expected
            if not any(view.holds(person.box_xyxy) for view in chosen)
            and (view := self._around(person.box_xyxy)) is not None
            and (view.near or far_left)
        ]
        if (
            self._views.tiles
            and far_left
            and (not expected or self._turn - self._searched >= self._search_turn)
        ):
            return self._search(expected)
        if not waiting:
            return None
        view = min(waiting, key=lambda entry: entry[0])[1]
        self._note(view, expected)
        return view

    def _search(self, expected: Sequence[Expected]) -> View | None:
        if self._searched == self._turn:
            return None
        self._searched = self._turn
        tiles = self._views.tiles
        self._tile = (self._tile + 1) % len(tiles)
        self._note(tiles[self._tile], expected)
        return tiles[self._tile]

    def _around(self, box: BoxXyxy) -> View | None:
        small = box[3] - box[1] < _NEAR_LEAST_PX
        return (self._views if small else self._near).around(box)

    def _last_look(self, person: Expected) -> int:
        if person.track_id is None:
            return self._turn - _NEWCOMER_TURN
        return self._looked.get(person.track_id, 0)

    def _note(self, view: View, expected: Sequence[Expected]) -> None:
        for person in expected:
            if person.track_id is not None and view.holds(person.box_xyxy):
                self._looked[person.track_id] = self._turn


def usual_looks(input_size: tuple[int, int], beside_another: bool = False) -> int:
    """Closer looks in a frame by a network.

    Args:
        input_size: its width and height, pixels.
        beside_another: whether it is the smaller of two.
    """
    width, height = input_size
    most = _NEAR_LOOKS if beside_another else _MOST_LOOKS
    return min(most, max(1, round(_FRAME_PIXELS / (width * height))))


def look(
    model: PersonModel, image: NDArray[np.uint8], least_score: float, part: View
) -> Detections:
    """People in a part of a frame, whole ones only.

    Args:
        model: the network.
        image: (H, W, 3) uint8 BGR, the frame.
        least_score: of a person.
        part: the part, or the whole frame.

    Raises:
        HeelError: OpenCV failed on this picture.
    """
    found = model.detect(_cut_out(image, part), least_score)
    offset = np.array([part.left, part.top, part.left, part.top], np.float32)
    boxes = found.boxes + offset
    if part.reaches_beyond:
        boxes = np.clip(boxes, 0, np.tile(np.array(image.shape[1::-1], np.float32), 2))
    size, margin = (image.shape[1], image.shape[0]), _EDGE_SHARE * part.height
    good = [not part.cuts((a, b, c, d), *size, margin) for a, b, c, d in boxes.tolist()]
    return Detections(boxes[good], found.scores[good])


def _cut_out(image: NDArray[np.uint8], part: View) -> NDArray[np.uint8]:
    """The pixels of a view (height, width, 3), grey beyond the frame."""
    rows, columns = image.shape[:2]
    top, left = max(0, part.top), max(0, part.left)
    bottom, right = min(rows, part.top + part.height), min(columns, part.left + part.width)
    inside = image[top:bottom, left:right]
    if inside.shape[:2] == (part.height, part.width):
        return inside
    around = (
        top - part.top, part.top + part.height - bottom,
        left - part.left, part.left + part.width - right,
    )  # fmt: skip
    grey = (PAD_GREY,) * 3
    return np.asarray(
        cv2.copyMakeBorder(inside, *around, cv2.BORDER_CONSTANT, value=grey), np.uint8
    )


def together(whole: Detections, close: Detections, part: View) -> Detections:
    """Both looks as one, each person once, best first.

    A person that is seen in both is where the closer look says: of small people the whole frame
    often shows the upper half alone, with as good a score.
    """
    if len(whole.boxes) and len(close.boxes):
        beyond = np.array([not part.holds((a, b, c, d)) for a, b, c, d in whole.boxes.tolist()])
        inside = cover_matrix(close.boxes, whole.boxes[beyond])
        kept = ~(inside >= _FRAGMENT).any(axis=1)
        close = Detections(close.boxes[kept], close.scores[kept])
    if len(whole.boxes) and len(close.boxes):
        same = iou_matrix(whole.boxes, close.boxes) >= _SAME_IOU
        best = np.where(same, whole.scores[:, None], 0.0).max(axis=0)
        close = Detections(close.boxes, np.maximum(close.scores, best).astype(np.float32))
        whole = Detections(whole.boxes[~same.any(axis=1)], whole.scores[~same.any(axis=1)])
    boxes = np.concatenate([whole.boxes, close.boxes])
    scores = np.concatenate([whole.scores, close.scores])
    kept_of_both = without_doubles(boxes, scores)
    return Detections(boxes[kept_of_both], scores[kept_of_both])


def nobody() -> Detections:
    """No people."""
    return Detections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32))
