"""Messages of a detector of people: boxes on drawn people, their scores and pixels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, CameraMotion, Patch, Track, Tracks
from heel.services.tracker.core import Tracker

WIDTH, HEIGHT = 640, 480
TALL, WIDE = 200, 80
Colours = tuple[tuple[int, int, int], tuple[int, int, int]]
RED, GREEN = ((30, 30, 200), (60, 50, 40)), ((40, 160, 30), (90, 80, 160))
BLUE = ((200, 60, 30), (40, 40, 40))


@dataclass(frozen=True)
class Person:
    """Shirt and trousers; `where` gives the foot point at a time in s, None without a box."""

    colours: Colours
    where: Callable[[float], tuple[float, float] | None]


def box(place: tuple[float, float]) -> tuple[float, float, float, float]:
    return place[0] - WIDE / 2, place[1] - TALL, place[0] + WIDE / 2, place[1]


def patch(colours: Colours, seed: int, noise: float = 12.0) -> NDArray[np.uint8]:
    """A person on a grey wall, with a new pattern of noise for every seed."""
    rng = np.random.default_rng(seed)
    pixels = np.full((TALL, WIDE, 3), 128.0)
    pixels[10:40, 28:52] = (120, 150, 210)
    pixels[40:110, 16:64] = colours[0]
    pixels[110:195, 22:58] = colours[1]
    coarse = rng.normal(0, noise, (TALL // 10, WIDE // 10, 3)).repeat(10, 0).repeat(10, 1)
    return np.clip(pixels + coarse + rng.normal(0, noise), 0, 255).astype(np.uint8)


def message(
    people: Sequence[Person], seq: int, fps: float, motion: CameraMotion | None = None,
    shift: float = 0.0, **changes: object,
) -> Blobs:  # fmt: skip
    """One frame; `shift` moves everybody to the left, as a camera that turns right does."""
    rng = np.random.default_rng(seq)
    blobs = []
    for index, person in enumerate(people):
        place = person.where(seq / fps)
        if place is None:
            continue
        jitter = rng.normal(0, 2, 2)
        outline = box((place[0] - shift + jitter[0], place[1] + jitter[1]))
        blobs.append(
            Blob(
                box_xyxy=outline,
                area_px=float(TALL * WIDE),
                centroid=((outline[0] + outline[2]) / 2, (outline[1] + outline[3]) / 2),
                patch=Patch.from_array(patch(person.colours, 1000 * seq + index)),
                score=0.9,
            )
        )
    fields: dict[str, object] = {
        "stream": "front", "epoch": 1, "seq": seq, "index": seq,
        "t_capture_ns": round(seq * 1e9 / fps), "width": WIDTH, "height": HEIGHT,
        "source_width": WIDTH, "source_height": HEIGHT, "blobs": tuple(blobs),
        "kind": "people", "camera_motion": motion, "detector": "drawn",
    }  # fmt: skip
    return Blobs.model_validate({**fields, **changes})


def follow(
    tracker: Tracker, people: Sequence[Person], seconds: float, fps: float = 10.0
) -> list[Tracks]:
    """Everything that is said about people whom a standing camera sees."""
    return [tracker.update(message(people, seq, fps)) for seq in range(round(seconds * fps))]


def track_at(tracks: Tracks, place: tuple[float, float]) -> Track | None:
    """The shown track within a third of a width of a foot point."""
    for track in tracks.tracks:
        middle = (track.box_xyxy[0] + track.box_xyxy[2]) / 2
        if track.shown and abs(middle - place[0]) < WIDE / 3:
            return track
    return None
