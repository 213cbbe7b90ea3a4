"""A video with what the stack believed, drawn on the very frames it believed it about."""

from __future__ import annotations

from collections import OrderedDict, deque
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import HeelError, Track, Tracks
from heel.services.colours import UNSURE_BELOW, Rgb, colour_of
from heel.services.runtime.quiet import silence_decoders

_TRAIL_FRAMES = 40
_MAX_TRAILS = 256
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_WHITE = (255, 255, 255)


@dataclass(frozen=True, slots=True)
class Mark:
    """What is drawn of one person, whoever draws it.

    Attributes:
        id: of the track.
        box: xyxy pixels of the frame.
        rgb: colour of the id, 0 to 1 each.
        measured: whether the person was measured on their own; else the box is an estimate.
        is_target: whether the robot follows them.
        label: id, and what there is to say.
    """

    id: int
    box: tuple[float, float, float, float]
    rgb: Rgb
    measured: bool
    is_target: bool
    label: str

    @property
    def foot(self) -> tuple[float, float]:
        """Where the person stands: the middle of the lower edge."""
        left, _, right, bottom = self.box
        return (left + right) / 2, bottom


def marks(tracks: Tracks, target_id: int | None) -> list[Mark]:
    """What is drawn of the people of a frame: of those that are shown."""
    return [_mark_of(track, track.id == target_id) for track in tracks.tracks if track.shown]


def _mark_of(track: Track, is_target: bool) -> Mark:
    label = str(track.id)
    if track.occluded_by:
        label += " behind " + ",".join(map(str, track.occluded_by))
    elif track.state != "tracked":
        label += f" {track.state}"
    if track.identity_confidence < UNSURE_BELOW:
        label += " ?"
    measured = track.state == "tracked"
    return Mark(track.id, track.box_xyxy, colour_of(track.id), measured, is_target, label)


class Trails:
    """Where people stood in the last frames."""

    def __init__(self) -> None:
        self._of: OrderedDict[int, deque[tuple[float, float]]] = OrderedDict()

    def add(self, mark: Mark) -> list[tuple[float, float]]:
        """Take a person's place in the next frame; returns the trail up to it, the oldest first."""
        trail = self._of.setdefault(mark.id, deque(maxlen=_TRAIL_FRAMES))
        self._of.move_to_end(mark.id)
        while len(self._of) > _MAX_TRAILS:
            self._of.popitem(last=False)
        trail.append(mark.foot)
        return list(trail)


class Annotator:
    """Draws boxes, ids, trails, occlusion marks and the target; remembers trails."""

    def __init__(self) -> None:
        self._trails = Trails()

    def draw(
        self, image: NDArray[np.uint8], tracks: Tracks, target_id: int | None, caption: str
    ) -> NDArray[np.uint8]:
        """A copy of `image`, (H, W, 3) uint8 BGR, with the marks of its frame."""
        canvas = image.copy()
        for mark in marks(tracks, target_id):
            trail = [(round(x), round(y)) for x, y in self._trails.add(mark)]
            points = np.array(trail, np.int32).reshape(-1, 1, 2)
            cv2.polylines(canvas, [points], False, _bgr(mark.rgb), 1, cv2.LINE_AA)
            _draw(canvas, mark)
        if tracks.occlusion:
            _text(canvas, "occlusion", (8, canvas.shape[0] - 10), (0, 200, 255))
        _text(canvas, caption, (8, 20), _WHITE)
        return canvas


def _draw(canvas: NDArray[np.uint8], mark: Mark) -> None:
    left, top, right, bottom = (round(value) for value in mark.box)
    colour = _bgr(mark.rgb)
    if mark.measured:
        cv2.rectangle(canvas, (left, top), (right, bottom), colour, 2)
    else:
        _dashed(canvas, (left, top, right, bottom), colour)
    if mark.is_target:
        cv2.rectangle(canvas, (left - 4, top - 4), (right + 4, bottom + 4), _WHITE, 2)
    _text(canvas, mark.label, (left, max(12, top - 5)), colour)


def _bgr(rgb: Rgb) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in rgb)
    return blue, green, red


def _dashed(
    canvas: NDArray[np.uint8], box: tuple[int, int, int, int], colour: tuple[int, int, int]
) -> None:
    left, top, right, bottom = box
    for x in range(left, right, 8):
        end = min(x + 4, right)
        cv2.line(canvas, (x, top), (end, top), colour, 2)
        cv2.line(canvas, (x, bottom), (end, bottom), colour, 2)
    for y in range(top, bottom, 8):
        end = min(y + 4, bottom)
        cv2.line(canvas, (left, y), (left, end), colour, 2)
        cv2.line(canvas, (right, y), (right, end), colour, 2)


def _text(
    canvas: NDArray[np.uint8], text: str, at: tuple[int, int], colour: tuple[int, int, int]
) -> None:
    cv2.putText(canvas, text, at, _FONT, 0.45, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(canvas, text, at, _FONT, 0.45, colour, 1, cv2.LINE_AA)


class AnnotatedVideo:
    """Writes annotated frames to an mp4 of the first frame's size."""

    def __init__(self, path: Path) -> None:
        silence_decoders()
        self._path = path
        self._annotator = Annotator()
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)

    def __enter__(self) -> AnnotatedVideo:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> bool:
        """End the film; False if there is none to look at: no frame came, or the disk is full.

        OpenCV does not tell: without its index, which is written last, the file is nothing.
        """
        if self._writer is None:
            return False
        self._writer.release()
        self._writer = None
        film = cv2.VideoCapture(str(self._path))
        readable = film.isOpened() and film.get(cv2.CAP_PROP_FRAME_COUNT) > 0
        film.release()
        return readable

    def write(
        self,
        image: NDArray[np.uint8],
        tracks: Tracks,
        target_id: int | None,
        caption: str,
        fps: float,
    ) -> None:
        """Draw and append one frame.

        Raises:
            HeelError: the video cannot be written.
        """
        height, width = image.shape[:2]
        if self._writer is None:
            self._size = (max(2, width & ~1), max(2, height & ~1))
            fourcc = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), fourcc, fps, self._size)
            if not self._writer.isOpened():
                raise HeelError(f"{self._path} cannot be written as mp4: leave out --annotate")
        frame = self._annotator.draw(image, tracks, target_id, caption)
        if (width, height) != self._size:
            frame = np.asarray(cv2.resize(frame, self._size), np.uint8)
        self._writer.write(frame)
