"""A recording as other footage: the same people mirrored, backwards, cut, thinned out, darkened.

A variant is written as a sequence folder of its own (pictures without loss, ground truth and boxes
of a file alike), so that whatever reads a recording reads it too.

Backwards in time is honest: people who walk backwards are people, meet and part like others, and
nothing in Heel knows which way people face. What differs is who is seen first, which is the point.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import REPOSITORY
from heel.evaluation.motchallenge import (
    SequenceInfo,
    read_detections,
    read_ground_truth,
    read_sequence_info,
    write_tracks,
)
from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.schemas.errors import HeelError, SettingsError
from heel.services.capture.sources import open_source

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Variant:
    """How footage differs from the recording as shot.

    Attributes:
        mirrored: left and right exchanged.
        backwards: the last frame first.
        start: share of the frames left out at the beginning, by the order in which they are played.
        every: one frame of so many is played, at so many times the interval.
        scale: of both sides of the picture, in (0, 1].
        gamma: of grey levels as shares of white; above 1 darker.
        noise: standard deviation of what is added to every value [grey levels].
    """

    mirrored: bool = False
    backwards: bool = False
    start: float = 0.0
    every: int = 1
    scale: float = 1.0
    gamma: float = 1.0
    noise: float = 0.0

    @property
    def moves_boxes(self) -> bool:
        """Whether it is more than the recording where only boxes are known.

        The tracker is the same for left and right, and at any scale.
        """
        return self == Variant() or self.backwards or self.start > 0 or self.every > 1

    def order(self, frame_count: int) -> NDArray[np.int64]:
        """The recording's frame numbers, from 1, in the order in which they are played."""
        numbers = np.arange(1, frame_count + 1, dtype=np.int64)
        numbers = numbers[::-1] if self.backwards else numbers
        return numbers[round(self.start * frame_count) :: self.every]

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Width and height of its pictures, by those of the recording [px]."""
        return round(self.scale * width), round(self.scale * height)

    def picture(self, image: Picture, random: np.random.Generator) -> Picture:
        """A picture (H, W, 3) BGR of the recording as it is shown."""
        size = self.size(image.shape[1], image.shape[0])
        if self.mirrored:
            image = np.ascontiguousarray(image[:, ::-1])
        if self.scale != 1.0:
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        if self.gamma != 1.0:
            table = 255.0 * (np.arange(256) / 255.0) ** self.gamma
            image = np.asarray(cv2.LUT(image, table.round().astype(np.uint8)), np.uint8)
        if self.noise > 0:
            added = image + random.normal(0.0, self.noise, image.shape).astype(np.float32)
            image = np.clip(added.round(), 0, 255).astype(np.uint8)
        return image

    def rows(self, rows: BoxRows, frame_count: int, width: int, height: int) -> BoxRows:
        """Boxes of the recording where and when they are to be seen; who is who stays.

        Detections, which are nobody's, get numbers, so that they can be written like people.
        """
        order = self.order(frame_count)
        place = np.zeros(max(frame_count, int(rows.frames.max(initial=0))) + 1, np.int64)
        place[order] = np.arange(1, len(order) + 1)
        rows = rows.select(place[rows.frames] > 0)
        boxes = rows.boxes_xyxy
        if self.mirrored:
            boxes = np.stack(
                [width - boxes[:, 2], boxes[:, 1], width - boxes[:, 0], boxes[:, 3]], axis=1
            )
        new_width, new_height = self.size(width, height)
        factor = np.array([new_width / width, new_height / height] * 2)
        named = (rows.identities >= 0).all()
        people = rows.identities if named else np.arange(1, len(rows) + 1)
        return rows_from_xyxy(place[rows.frames], people, boxes * factor, rows.values)


AS_SHOT = "as shot"
VARIANTS: dict[str, Variant] = {
    AS_SHOT: Variant(),
    "mirrored": Variant(mirrored=True),
    "backwards": Variant(backwards=True),
    "mirrored, backwards": Variant(mirrored=True, backwards=True),
    "a quarter in": Variant(start=0.25),
    "half in": Variant(start=0.5),
    "backwards, a quarter in": Variant(backwards=True, start=0.25),
    "every second frame": Variant(every=2),
    "scaled by 0.75": Variant(scale=0.75),
    "darker": Variant(gamma=1.5),
    "noise": Variant(noise=5.0),
}


def described(recording: Path, most_frames: int) -> SequenceInfo:
    """What is known of a recording, cut to its first frames.

    Raises:
        HeelError: it does not tell its rate and size.
    """
    info = read_sequence_info(recording)
    if not (info.frame_rate_fps and info.width_px and info.height_px):
        raise HeelError(f"{recording}: seqinfo.ini tells no frameRate, imWidth or imHeight: add it")
    count = min(info.frame_count, most_frames)
    return SequenceInfo(info.name, count, info.frame_rate_fps, info.width_px, info.height_px)


def write_variant(recording: Path, variant: Variant, to: Path, most_frames: int) -> None:
    """Write a variant as a sequence folder.

    Args:
        recording: a sequence folder.
        variant: what is to differ.
        to: a new folder, outside of the repository, for recordings are not to be copied into it.
        most_frames: of the recording, from its first, that are played.

    Raises:
        HeelError: the recording cannot be read, or `to` is in the repository.
    """
    if to.resolve().is_relative_to(REPOSITORY):
        raise SettingsError(f"{to}: pictures of recordings do not belong into the repository")
    info = described(recording, most_frames)
    width, height, fps = info.width_px or 0, info.height_px or 0, info.frame_rate_fps or 0.0
    new_width, new_height = variant.size(width, height)
    order = variant.order(info.frame_count)
    to.mkdir(parents=True)
    (to / "seqinfo.ini").write_text(
        f"[Sequence]\nname={info.name}\nimDir=img1\nframeRate={fps / variant.every:.6g}\n"
        f"seqLength={len(order)}\nimWidth={new_width}\nimHeight={new_height}\nimExt=.bmp\n",
        encoding="utf-8",
    )
    for name, read in (("gt", read_ground_truth), ("det", read_detections)):
        file = recording / name / f"{name}.txt"
        if file.is_file():
            (to / name).mkdir()
            rows = variant.rows(read(file), info.frame_count, width, height)
            write_tracks(to / name / file.name, rows)
    if has_pictures(recording):
        (to / "img1").mkdir()
        random = np.random.default_rng(1)
        place = {number: k for k, number in enumerate(order.tolist(), 1)}
        for number, image in _pictures(recording, info.frame_count):
            if number in place:
                shown = variant.picture(image, random)
                cv2.imwrite(str(to / "img1" / f"{place[number]:06d}.bmp"), shown)


def has_pictures(recording: Path) -> bool:
    """Whether a sequence folder holds more than boxes."""
    return (recording / "img1").is_dir() or (recording / "video.mp4").is_file()


def _pictures(recording: Path, frame_count: int) -> Iterator[tuple[int, Picture]]:
    source = open_source(str(recording))
    try:
        while (frame := source.read()) is not None and frame.index < frame_count:
            yield frame.index + 1, frame.image
    finally:
        source.close()
