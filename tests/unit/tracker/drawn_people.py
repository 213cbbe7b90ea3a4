"""Blobs messages with evidence maps drawn from people who walk on a ground plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, Evidence, Patch, Track, Tracks
from heel.schemas.base import BoxXyxy
from heel.schemas.blobs import FOREGROUND, MOVING
from heel.services.geometry import boxes
from heel.services.tracker.core import Tracker

WIDTH, HEIGHT, FPS = 320, 240, 10
RATIO = 0.37
RED, GREEN, BLUE = (20, 20, 230), (20, 220, 30), (230, 40, 20)


def tall(foot_row: float) -> float:
    """Height of a person on the drawn ground plane, pixels."""
    return 0.3 * (foot_row + 20.0)


@dataclass(frozen=True)
class Walker:
    """Somebody in one colour; `where` gives the foot point in a frame, None when away."""

    colour: tuple[int, int, int]
    where: Callable[[int], tuple[float, float] | None]

    def box(self, seq: int) -> BoxXyxy:
        foot = self.where(seq)
        assert foot is not None
        height = tall(foot[1])
        half = 0.5 * RATIO * height
        return foot[0] - half, foot[1] - height, foot[0] + half, foot[1]


def straight(
    colour: tuple[int, int, int], x: float, speed: float, row: float = 200.0,
    present: range = range(100000),
) -> Walker:  # fmt: skip
    """Walks along the row from `x` by `speed` pixels a frame."""
    return Walker(colour, lambda seq: (x + speed * seq, row) if seq in present else None)


def draw(walkers: Sequence[Walker], seq: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The picture (H, W, 3) and the evidence map (H, W); nearer people hide farther ones."""
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    evidence = np.zeros((HEIGHT, WIDTH), np.uint8)
    feet = [(walker, walker.where(seq), walker.where(seq - 1)) for walker in walkers]
    present = [(walker, foot, before) for walker, foot, before in feet if foot is not None]
    for walker, foot, before in sorted(present, key=lambda item: item[1][1]):
        mask = _silhouette(foot)
        picture[mask] = walker.colour
        evidence[mask] = FOREGROUND if foot == before else MOVING
    return picture, evidence


def _silhouette(foot: tuple[float, float]) -> NDArray[np.bool_]:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    x, height = round(foot[0]), tall(foot[1])
    top = foot[1] - height
    head, shoulder, hip = (round(top + share * height) for share in (0.09, 0.18, 0.55))
    cv2.circle(mask, (x, head), round(0.08 * height), 1, -1)
    wide, narrow = round(0.15 * height), round(0.12 * height)
    cv2.rectangle(mask, (x - wide, shoulder), (x + wide, hip), 1, -1)
    cv2.rectangle(mask, (x - narrow, hip), (x + narrow, round(foot[1])), 1, -1)
    return np.asarray(mask > 0)


def message(
    evidence: NDArray[np.uint8] | None,
    seq: int,
    picture: NDArray[np.uint8] | None = None,
    **changes: object,
) -> Blobs:
    """A message of `evidence`, with its connected components as blobs."""
    fields: dict[str, object] = {
        "stream": "front",
        "epoch": 1,
        "seq": seq,
        "index": seq,
        "t_capture_ns": seq * 10**9 // FPS,
        "width": WIDTH,
        "height": HEIGHT,
        "source_width": WIDTH,
        "source_height": HEIGHT,
        "blobs": () if evidence is None or picture is None else _components(evidence, picture),
        "evidence": None if evidence is None else Evidence.from_array(evidence),
        "detector": "drawn",
    }
    return Blobs.model_validate({**fields, **changes})


def _components(evidence: NDArray[np.uint8], picture: NDArray[np.uint8]) -> tuple[Blob, ...]:
    mask = (evidence >= FOREGROUND).astype(np.uint8)
    stats = np.asarray(cv2.connectedComponentsWithStats(mask)[2])
    return tuple(
        Blob(
            box_xyxy=(float(x), float(y), float(x + width), float(y + height)),
            area_px=float(area),
            centroid=(x + width / 2, y + height / 2),
            patch=Patch.from_array(picture[y : y + height, x : x + width]),
        )
        for x, y, width, height, area in stats[1:].tolist()
    )


def blobs_of(walkers: Sequence[Walker], seq: int, **changes: object) -> Blobs:
    picture, evidence = draw(walkers, seq)
    return message(evidence, seq, picture, **changes)


def follow(tracker: Tracker, walkers: Sequence[Walker], frames: range) -> list[Tracks]:
    return [tracker.update(blobs_of(walkers, seq)) for seq in frames]


def track_at(tracks: Tracks, box: BoxXyxy) -> Track | None:
    """The one shown track on a box, IoU above a half."""
    found = [
        track for track in tracks.tracks if track.shown and boxes.iou(track.box_xyxy, box) > 0.5
    ]
    return found[0] if len(found) == 1 else None


def id_at(tracks: Tracks, box: BoxXyxy) -> int | None:
    track = track_at(tracks, box)
    return track.id if track else None
