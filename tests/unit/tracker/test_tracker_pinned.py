"""What the tracker says of drawn people, frame by frame, pinned through its public core.

Each film is rich in one kind of trouble: contacts, hiding, returns, twins, a camera that moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cache

import numpy as np
import pytest

from heel.schemas import Blob, Blobs, CameraMotion, Patch, Tracks
from heel.schemas.blobs import FOREGROUND, MOVING
from heel.services.geometry.calibration_file import Calibration
from heel.services.tracker.boxes.frame import checked
from heel.services.tracker.boxes.sequence import box_tracker
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.support.pinned import Pinned, Value, sums
from tests.unit.tracker import drawn_detections as detections
from tests.unit.tracker import drawn_people as drawn

Row = list[Value]
Place = tuple[float, float]
OF_PICTURES = {"relative": 2e-3, "absolute": 5e-3}


def film(messages: Iterable[Tracks], every: int) -> dict[str, Row]:
    """Tracks of some frames as they are, and the sums of all."""
    rows: dict[str, Row] = {}
    totals = []
    for message in messages:
        values = []
        for track in message.tracks:
            values.append(
                (*track.box_xyxy, *track.velocity_pxps, track.identity_confidence,
                 track.runner_up_confidence, float(track.id), float(track.shown),
                 float(track.missed_frames))
            )  # fmt: skip
        totals.append([math.fsum(column) for column in zip(*values, strict=True)] or [0.0] * 11)
        if message.seq % every == 0:
            row: Row = []
            for track in message.tracks:
                row += [track.id, track.state, track.shown, *track.box_xyxy,
                        track.identity_confidence, track.runner_up_confidence]  # fmt: skip
            rows[f"{message.seq}"] = row
    rows["sums"] = [*sums(totals)]
    return rows


# --- Regions before a background


def hidden_at(walker: drawn.Walker, away: range) -> drawn.Walker:
    return drawn.Walker(walker.colour, lambda seq: None if seq in away else walker.where(seq))


def to_and_fro(colour: tuple[int, int, int], x: float, reach: float, row: float) -> drawn.Walker:
    return drawn.Walker(colour, lambda seq: (x + reach * math.sin(0.12 * seq), row))


def comes(colour: tuple[int, int, int], x: float, from_row: float, speed: float) -> drawn.Walker:
    return drawn.Walker(colour, lambda seq: (x, min(from_row + speed * seq, 235.0)))


GREY = (128, 128, 128)
WALKERS: dict[str, Sequence[drawn.Walker]] = {
    "alone": [drawn.straight(drawn.RED, 30, 3)],
    "crossing": [drawn.straight(drawn.RED, 30, 4), drawn.straight(drawn.BLUE, 290, -3, 185.0)],
    "three": [
        drawn.straight(drawn.RED, 20, 4), drawn.straight(drawn.BLUE, 300, -4, 190.0),
        drawn.straight(drawn.GREEN, 160, 0.5, 210.0),
    ],
    "twins": [to_and_fro(drawn.RED, 120, 70, 200.0), to_and_fro(drawn.RED, 190, -60, 190.0)],
    "comes": [comes(drawn.GREEN, 100, 90.0, 2.0), drawn.straight(drawn.BLUE, 300, -1.5)],
    "away and back": [
        hidden_at(drawn.straight(drawn.RED, 60, 1.5), range(25, 55)),
        drawn.straight(drawn.BLUE, 280, -0.7, 150.0),
    ],
    "away for a moment": [
        hidden_at(drawn.straight(drawn.RED, 60, 2.0), range(25, 31)),
        hidden_at(drawn.straight(drawn.GREEN, 250, -1.0, 160.0), range(40, 43)),
    ],
    "stands": [
        drawn.Walker(drawn.RED, lambda seq: (60.0 + 4.0 * min(seq, 15), 200.0)),
        drawn.straight(drawn.BLUE, 330, -3, 205.0),
    ],
    "crowd": [
        *(drawn.straight(colour, 20 + 60 * k, 2.5 * (-1) ** k, 140.0 + 18 * k)
          for k, colour in enumerate((drawn.RED, drawn.GREEN, drawn.BLUE, (200, 200, 40), GREY)))
    ],
}  # fmt: skip


def seen(name: str, seq: int) -> Blobs:
    """With noise in the evidence: specks, holes and a lamp post."""
    picture, evidence = drawn.draw(WALKERS[name], seq)
    rng = np.random.default_rng(seq)
    if name in ("three", "stands", "crowd"):
        evidence[rng.random(evidence.shape) < 0.02] = 0
        evidence[rng.random(evidence.shape) < 0.0004] = FOREGROUND
        evidence[:, 150:156] = 0
    if name == "comes":
        evidence[200:230, 20:60] = MOVING if seq % 7 == 0 else FOREGROUND
    jump = 1.0 if seq < 40 or name != "alone" else 4.0
    return drawn.message(evidence, seq, picture).model_copy(
        update={"t_capture_ns": round(seq * 1e8 * jump)}
    )


@pytest.mark.parametrize("name", WALKERS)
def test_people_before_a_background(name: str, pinned: Pinned) -> None:
    tracker = Tracker(TrackerSettings())
    rows = film((tracker.update(seen(name, seq)) for seq in range(72)), 6)
    pinned(rows, **OF_PICTURES)


@pytest.mark.parametrize("height_m", [2.5, 5.83])
def test_people_before_a_calibrated_camera(height_m: float, pinned: Pinned) -> None:
    mounted = Calibration(mount_height_m=height_m, mount_pitch_deg=24.0, horizontal_fov_deg=60.0)
    tracker = Tracker(TrackerSettings(), mounted)
    pinned(film((tracker.update(seen("three", seq)) for seq in range(40)), 6), **OF_PICTURES)


@pytest.mark.parametrize("name", ["crossing", "three", "away for a moment"])
def test_people_by_the_papers_tracker(name: str, pinned: Pinned) -> None:
    tracker = Tracker(TrackerSettings(preset="paper"))
    pinned(film((tracker.update(seen(name, seq)) for seq in range(60)), 6), **OF_PICTURES)


# --- Boxes of people with their pixels


def walks(start: Place, speed: Place, *hidden: tuple[float, float]) -> Callable[
    [float], Place | None
]:  # fmt: skip
    def where(t_s: float) -> Place | None:
        if any(first <= t_s < last for first, last in hidden):
            return None
        return start[0] + speed[0] * t_s, start[1] + speed[1] * t_s

    return where


def sways(x: float, reach: float, per_s: float, y: float = 400.0) -> Callable[[float], Place]:
    return lambda t_s: (x + reach * math.sin(per_s * t_s), y)


RED, GREEN, BLUE = detections.RED, detections.GREEN, detections.BLUE
PALE = ((50, 45, 180), (70, 60, 55))
PEOPLE: dict[str, Sequence[detections.Person]] = {
    "alone": [detections.Person(RED, walks((100, 400), (40, 0)))],
    "crossing": [
        detections.Person(RED, walks((80, 400), (70, 0))),
        detections.Person(BLUE, walks((560, 395), (-60, 0))),
    ],
    "twins": [
        detections.Person(RED, sways(250, 120, 0.9)), detections.Person(RED, sways(330, -110, 0.9)),
    ],
    "alike": [
        detections.Person(RED, sways(250, 130, 0.8)),
        detections.Person(PALE, sways(340, -120, 0.8)),
    ],
    "gone and back": [
        detections.Person(RED, walks((150, 400), (5, 0), (2.0, 2.3), (3.0, 4.5))),
        detections.Person(GREEN, walks((450, 400), (-3, 0), (3.5, 6.0))),
    ],
    "gone for long": [
        detections.Person(RED, walks((150, 400), (0, 0), (2.0, 6.0))),
        detections.Person(BLUE, walks((500, 400), (0, 0), (0.0, 3.0))),
    ],
    "another one": [
        detections.Person(RED, walks((150, 400), (0, 0), (2.5, 99.0))),
        detections.Person(PALE, walks((170, 400), (0, 0), (0.0, 3.5))),
    ],
    "three": [
        detections.Person(RED, sways(200, 150, 0.6)), detections.Person(GREEN, sways(330, 90, 1.1)),
        detections.Person(BLUE, sways(450, -160, 0.5, 410.0)),
    ],
}  # fmt: skip


def boxes_of(name: str, seq: int, fps: float = 8.0) -> Blobs:
    """Some boxes have a poor score, some are missed, some are false or doubled."""
    made = detections.message(PEOPLE[name], seq, fps)
    rng = np.random.default_rng(100 + seq)
    blobs = [
        blob.model_copy(update={"score": 0.35 if rng.random() < 0.12 else 0.9})
        for blob in made.blobs
        if rng.random() > 0.06
    ]
    if name in ("three", "crossing") and seq % 9 == 4 and blobs:
        left, top, right, bottom = blobs[0].box_xyxy
        blobs.append(blobs[0].model_copy(
            update={"box_xyxy": (left + 9, top - 6, right + 12, bottom - 8), "score": 0.5}
        ))  # fmt: skip
    if name == "alone" and seq % 11 == 3:
        blobs.append(_box(500.0 + 3 * seq, 300.0, 40.0, 90.0, 0.45))
    return made.model_copy(update={"blobs": tuple(blobs)})


@cache
def _plain() -> Patch:
    return Patch.from_array(np.full((40, 16, 3), 90, np.uint8))


def _box(x: float, bottom: float, wide: float, tall: float, score: float) -> Blob:
    box = (x - wide / 2, bottom - tall, x + wide / 2, bottom)
    return Blob(box_xyxy=box, area_px=wide * tall, centroid=(x, bottom - tall / 2), patch=_plain(),
                score=score)  # fmt: skip


@pytest.mark.parametrize("name", PEOPLE)
def test_people_in_boxes(name: str, pinned: Pinned) -> None:
    tracker = Tracker(TrackerSettings())
    rows = film((tracker.update(boxes_of(name, seq)) for seq in range(64)), 6)
    pinned(rows, **OF_PICTURES)


def merged(seq: int) -> Blobs:
    """Two who walk towards each other and together have one box for a while."""
    x = 150.0 + min(seq, 30) * 5.0, 450.0 - min(seq, 30) * 4.0
    x = x if seq < 42 else (x[0] + 5.0 * (seq - 42), x[1] - 5.0 * (seq - 42))
    boxes = [_box(at, 400.0, 80.0, 200.0, 0.9) for at in x]
    if abs(x[0] - x[1]) < 60:
        boxes = [_box((x[0] + x[1]) / 2, 401.0, 80.0 + abs(x[0] - x[1]), 203.0, 0.8)]
    made = detections.message([], seq, 8.0)
    return made.model_copy(update={"blobs": tuple(boxes)})


def turning(seq: int) -> Blobs:
    """A camera that pans, zooms a little and once jerks by more than any camera does."""
    people = [detections.Person(RED, walks((200, 400), (10, 0), (3.0, 4.0))),
              detections.Person(GREEN, walks((420, 400), (-8, 0)))]  # fmt: skip
    shift = 6.0 * seq if seq < 40 else 240.0
    zoom = 1.01 if seq % 10 == 5 else 2.5 if seq == 33 else 0.3 if seq == 35 else 1.0
    affine = (zoom, 0.0, -6.0 if seq < 40 else 0.0, 0.0, zoom, 0.0)
    motion = CameraMotion(affine=affine, quality=0.9) if seq else None
    return detections.message(people, seq, 8.0, motion, shift)


@pytest.mark.parametrize("scene", [merged, turning], ids=["merged", "turning"])
def test_boxes_that_merge_and_cameras_that_turn(
    scene: Callable[[int], Blobs], pinned: Pinned
) -> None:
    tracker = Tracker(TrackerSettings())
    pinned(film((tracker.update(scene(seq)) for seq in range(64)), 6), **OF_PICTURES)


# --- Boxes without pixels


def jostling(
    seed: int, frames: int, shake: float = 0.0
) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """People that walk, stop and go out of sight, seen by a detector that misses and doubles."""
    rng = np.random.default_rng(seed)
    count = 6
    place, speed = rng.uniform(120, 520, (count, 2)), rng.normal(0, 35, (count, 2))
    tall = rng.uniform(60, 160, count)
    made, t_s = [], 0.0
    for frame in range(frames):
        t_s += 0.125 if frame != 50 else 1.5
        speed = np.where(rng.random((count, 1)) < 0.04, rng.normal(0, 35, (count, 2)), speed)
        place = place + 0.125 * speed
        jolt = rng.normal(0, shake, 2) if shake else 0.0
        away = np.array([20 <= frame < 26 + 9 * k and k % 2 == 0 for k in range(count)])
        there = (rng.random(count) < 0.88) & ~away
        foot = place[there] + rng.normal(0, 2, (int(there.sum()), 2)) + jolt
        high = tall[there] * np.exp(rng.normal(0, 0.03, int(there.sum())))
        boxes = np.stack([foot[:, 0] - 0.2 * high, foot[:, 1] - high, foot[:, 0] + 0.2 * high,
                          foot[:, 1]], axis=1)  # fmt: skip
        scores = rng.uniform(0.4, 1.0, len(boxes))
        if rng.random() < 0.3:
            false = rng.uniform(50, 500, 2)
            boxes = np.vstack([boxes, [*false, false[0] + 30, false[1] + 80]])
            scores = np.append(scores, rng.uniform(0.2, 0.6))
        made.append((t_s, boxes, scores))
    return made


@pytest.mark.parametrize("shake", [0.0, 9.0], ids=["standing", "shaking"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_boxes_without_pixels(seed: int, shake: float, pinned: Pinned) -> None:
    tracker, totals = box_tracker(image_size=(640, 640)), []
    rows: dict[str, Row] = {}
    for frame, (t_s, boxes, scores) in enumerate(jostling(seed, 110, shake)):
        reports = tracker.update(checked(boxes, scores), t_s)
        values = [(*one.box_xyxy, *one.velocity_pxps, one.identity_confidence,
                   one.runner_up_confidence, float(one.id or 0), float(one.shown))
                  for one in reports]  # fmt: skip
        totals.append([math.fsum(column) for column in zip(*values, strict=True)] or [0.0] * 10)
        if frame % 10 == 9:
            row: Row = []
            for one in reports:
                row += [one.id, one.confirmed, one.shown, one.box_xyxy[0], one.identity_confidence]
            rows[f"{frame}"] = row
    rows["sums"] = [*sums(totals)]
    pinned(rows, relative=1e-5, absolute=1e-5)


# --- The person that was pointed at


def test_a_person_pointed_at(pinned: Pinned) -> None:
    """Comes, turns, is hidden for 0.3 to 3 s, and is doubted; the camera moves on."""
    tracker = Tracker(TrackerSettings())

    def frame(seq: int) -> Blobs:
        away = seq in (12, 13) or 20 <= seq < 27 or 34 <= seq < 54
        x = 200.0 + 90.0 * math.sin(0.2 * seq)
        score = 0.5 if 28 <= seq < 31 else 0.9
        motion = CameraMotion(affine=(1.0, 0.0, -3.0 * (seq % 4 == 0), 0.0, 1.0, 0.0), quality=0.9)
        return detections.message([], seq, 8.0, motion).model_copy(
            update={"blobs": () if away else (_box(x, 400.0, 60.0, 150.0, score),), "sought": 1}
        )

    pinned(film((tracker.update(frame(seq)) for seq in range(64)), 3))
