"""A window that moves over a recording by a script, whatever is seen in it.

The easy moving camera: no parallax, blur, zoom or rolling shutter. The window trembles and its
pixels are noisy, so that no picture is the other's exact copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import align
from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.evaluation.sequence_scores import SequenceScores, score_sequence
from heel.schemas import FrameId, Tracks
from heel.services.capture.pan_window import PanSettings, PanWindow
from heel.services.capture.sources import open_source
from heel.services.geometry.boxes import as_array, clipped
from heel.services.loops.panning.perception import WindowPerception
from heel.services.loops.panning.truth import (
    NOBODY,
    InWindow,
    TruePeople,
    in_window,
    read_people,
)

COUNTS_FROM = 0.6
"""Share of a person within the recording that has to lie in the window, else they do not count."""
TREMBLE_PX = 0.5
"""Standard deviation of the window's place in each direction; chosen by hand."""
NOISE = 2.0
"""Standard deviation of grey levels; chosen by hand."""
_APPROACH = 0.15
"""Share of its way to the person that the window goes in a frame; chosen by hand."""
_FASTEST_PX = 8.0
"""Farthest that it goes in a frame; chosen by hand."""
_PAN_PERIOD = 464.0
"""Frames of a swing to either side; with the tilt's it has no common divisor, so that no way is
gone twice."""
_TILT_PERIOD = 331.0
"""Frames of a swing up and down."""
_TILT_SHARE = 0.42
"""Of the height that is free, up and down; chosen by hand: robots pan more than they tilt."""
_LEAST_PX = 0.5
"""A box with a smaller side is cut to nothing by the window."""

Path2d = NDArray[np.float64]
"""(N, 2) pixels of the recording in the middle of the window, frame by frame."""
Size = tuple[int, int]
Script = Callable[[dict[int, TruePeople], int, Size, Size], Path2d]
"""Makes a path of so many frames from the people by frame number, the recording's and the
window's (width, height)."""


@dataclass(frozen=True, eq=False)
class ScriptedFrame:
    """One picture of a scripted window.

    Attributes:
        id: which frame this is.
        image: (H, W, 3) uint8 BGR.
        offset_px: (left, top) of the window in the recording.
        truth: everybody in it.
    """

    id: FrameId
    image: NDArray[np.uint8]
    offset_px: tuple[float, float]
    truth: InWindow


@dataclass(frozen=True)
class Played:
    """What a perception made of a scripted window.

    Attributes:
        scores: against the ground truth in the window.
        shifts_px: (N - 1,) how far the window moved from frame to frame.
    """

    scores: SequenceScores
    shifts_px: NDArray[np.float64]


def following(people: dict[int, TruePeople], frames: int, recording: Size, window: Size) -> Path2d:
    """After one person by the ground truth, 15 % of the way a frame, at most 8 pixels.

    When the person is gone, after the person that will be annotated for longest.
    """
    last = {
        person: frame for frame in sorted(people) for person in people[frame].identities.tolist()
    }
    middle, followed = np.array(recording, np.float64) / 2, None
    path = np.zeros((frames, 2))
    for index in range(frames):
        seen = people.get(index + 1, NOBODY)
        if followed not in seen.identities and len(seen.identities):
            followed = max(seen.identities.tolist(), key=lambda person: (last[person], -person))
        box = seen.boxes_xyxy[seen.identities == followed]
        if len(box):
            way = (box[0, :2] + box[0, 2:]) / 2 - middle
            far = float(np.hypot(*way))
            middle = middle + way * (min(_APPROACH, _FASTEST_PX / far) if far else 0.0)
        middle = path[index] = _within(middle, recording, window)
    return path


def panning(people: dict[int, TruePeople], frames: int, recording: Size, window: Size) -> Path2d:
    """From border to border and up and down, as two sines of unlike periods; people do not matter.

    At most 2.6 pixels a frame sideways and 1.1 up or down in a recording twice the window's size.
    """
    index = np.arange(frames)
    swing = (np.array(recording, np.float64) - window) / 2 * [1.0, _TILT_SHARE]
    periods = np.array([_PAN_PERIOD, _TILT_PERIOD])
    turns = np.sin(2 * np.pi * index[:, None] / periods)
    return np.asarray(np.array(recording) / 2 + swing * turns)


def scripted_frames(
    sequence: Path, window: Size, script: Script, seed: int = 0
) -> Iterator[ScriptedFrame]:
    """The pictures of a scripted window up to the last with ground truth.

    Args:
        sequence: MOTChallenge directory with pictures and ground truth.
        window: its (width, height).
        script: says where it goes.
        seed: of trembling and noise; the same seed gives the same pictures.

    Raises:
        HeelError: pictures or ground truth cannot be read, or the window does not fit.
    """
    people = read_people(sequence)
    rng = np.random.default_rng(seed)
    with open_source(str(sequence)) as source:
        recording = (source.width, source.height)
        path = script(people, max(people), recording, window)
        path += rng.normal(0.0, TREMBLE_PX, path.shape)
        while (picture := source.read()) is not None and picture.index < len(path):
            pan = _placed(recording, window, path[picture.index])
            image = _noisy(pan.view(picture.image, picture.index), rng)
            seen = people.get(picture.index + 1, NOBODY)
            truth = in_window(seen, recording, pan.offset_px, window)
            t_ns = round(picture.media_time_s * 1e9)
            frame = FrameId(
                stream="front", epoch=1, seq=picture.index, index=picture.index, t_capture_ns=t_ns
            )
            yield ScriptedFrame(frame, image, pan.offset_px, truth)


def play(
    sequence: Path, window: Size, script: Script, perception: WindowPerception, seed: int = 0
) -> Played:
    """Show a scripted window of a recording and score what is seen in it.

    Every frame from the first, online, IoU 0.5. Ground truth is cut at the window's border and
    counts from 60 % inside; a box on any other is a false alarm, and so is one on people that
    the ground truth marks as not to be counted. Boxes shown are cut at the border, too.

    Args:
        sequence: as `scripted_frames`.
        window: as there.
        script: as there.
        perception: knows nobody yet.
        seed: as there.

    Raises:
        HeelError: as there, or nobody is ever far enough in the window.
    """
    truth, shown = _Rows(), _Rows()
    offsets: list[tuple[float, float]] = []
    for frame in scripted_frames(sequence, window, script, seed):
        tracks = perception.see(frame.id, frame.image, frame.offset_px, frame.truth)
        truth.add(frame.id.index + 1, *counted(frame.truth))
        shown.add(frame.id.index + 1, *boxes_shown(tracks, window))
        offsets.append(frame.offset_px)
    aligned = align(truth.rows(), shown.rows(), name=sequence.name)
    moved = np.diff(np.array(offsets), axis=0)
    return Played(score_sequence(aligned), np.hypot(moved[:, 0], moved[:, 1]))


def counted(seen: InWindow) -> tuple[list[int], NDArray[np.float64]]:
    """Identities and boxes of the people that lie in the window far enough to count."""
    counts = (seen.inside >= COUNTS_FROM) & (_sides(seen.boxes_xyxy) >= _LEAST_PX)
    return seen.identities[counts].tolist(), seen.boxes_xyxy[counts]


def boxes_shown(tracks: Tracks, window: Size) -> tuple[list[int], NDArray[np.float64]]:
    """Identities and boxes of the people shown, cut at the window's border."""
    shown = [track for track in tracks.tracks if track.shown]
    boxes = clipped(as_array(track.box_xyxy for track in shown), window)
    kept = _sides(boxes) >= _LEAST_PX
    return [track.id for track, keep in zip(shown, kept, strict=True) if keep], boxes[kept]


class _Rows:
    """Boxes of frame after frame."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._identities: list[int] = []
        self._boxes: list[NDArray[np.float64]] = [np.zeros((0, 4))]

    def add(self, frame: int, identities: list[int], boxes: NDArray[np.float64]) -> None:
        self._frames += [frame] * len(identities)
        self._identities += identities
        self._boxes.append(boxes)

    def rows(self) -> BoxRows:
        return rows_from_xyxy(self._frames, self._identities, np.concatenate(self._boxes))


def _placed(recording: Size, window: Size, middle: NDArray[np.float64]) -> PanWindow:
    x, y = _within(middle, recording, window).tolist()
    return PanWindow(recording, PanSettings(width=window[0], height=window[1], x=x, y=y))


def _within(middle: NDArray[np.float64], recording: Size, window: Size) -> NDArray[np.float64]:
    half = np.array(window) / 2
    return np.clip(middle, half, np.array(recording) - half)


def _noisy(image: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    noise = np.round(rng.normal(0.0, NOISE, image.shape))
    return np.asarray(np.clip(image + noise, 0, 255), np.uint8)


def _sides(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shorter side (N,) of boxes (N, 4)."""
    return np.asarray((boxes[:, 2:] - boxes[:, :2]).min(axis=1, initial=np.inf))
