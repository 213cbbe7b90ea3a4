"""What the backgrounds make of drawn pictures, pinned: how many pixels of which kind, and blobs.

Counts of pixels may differ by a few on another processor. Every scene holds patches in steps of
less than a factor of two, so that a threshold that is halved or doubled lies between two others.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs, FrameId, Tracks
from heel.schemas.blobs import FOREGROUND, NONE, SHADOW
from heel.services.detector.background.evidence import FrameDifference, Region, find_regions
from heel.services.detector.background.learning import GhostFinder, LateFrames, StillnessGate
from heel.services.detector.background.pixel_model import StandingBackground
from heel.services.detector.core import Detector
from heel.services.detector.feedback import FeedbackBuffer, free_mask
from heel.services.detector.messages import person_blobs, region_blobs
from heel.services.detector.mog2 import true_blobs
from heel.services.detector.scene import WorkSize
from heel.services.detector.settings import DetectorSettings
from tests.support.pinned import Pinned, Value
from tests.unit.detector.drawn_scene import tracks_of

Row = list[Value]
Picture = NDArray[np.uint8]
WIDTH, HEIGHT = 320, 240
OF_PICTURES = {"relative": 0.01, "absolute": 3.0}


@cache
def wall(width: int = 3 * WIDTH) -> Picture:
    """Blocks of eight pixels, coarse and fine, three pictures wide."""
    rng = np.random.default_rng(1)
    coarse = np.kron(rng.integers(70, 150, (HEIGHT // 24, width // 24, 3)), np.ones((24, 24, 1)))
    fine = np.kron(rng.integers(-12, 12, (HEIGHT // 8, width // 8, 3)), np.ones((8, 8, 1)))
    return (coarse + fine).astype(np.uint8)


def frame_at(seq: int, t_s: float, epoch: int = 1) -> FrameId:
    return FrameId(stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=round(t_s * 1e9))


def noisy(picture: NDArray[Any], seq: int, sigma: float = 1.5) -> Picture:
    noise = np.random.default_rng(seq).normal(0, sigma, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def steps(seq: int, from_seq: int) -> NDArray[np.float64]:
    """Patches that are lighter, and patches that are darker, by steps; from a frame on."""
    picture = np.full((HEIGHT, WIDTH, 3), 110.0) + 6.0 * np.sin(np.arange(WIDTH) / 9)[None, :, None]
    if seq >= from_seq:
        for place, off in enumerate((3, 5, 7, 10, 14, 20, 28, 40, 56, 80)):
            picture[20:60, 30 * place + 6 : 30 * place + 26] += off
        for place, share in enumerate((0.3, 0.4, 0.5, 0.6, 0.68, 0.74, 0.82, 0.9, 0.95, 0.985)):
            picture[90:130, 30 * place + 6 : 30 * place + 26] *= share
        for place, tint in enumerate((2, 4, 6, 8, 11, 15, 20, 28, 38, 50)):
            column = slice(30 * place + 6, 30 * place + 26)
            picture[160:200, column] *= 0.85
            picture[160:200, column, 0] += tint
            picture[160:200, column, 2] -= tint
    return picture


def busy(seq: int, pan: int = 0) -> NDArray[np.float64]:
    """Two stand from the start and go, one comes and stays, one walks, small things flicker."""
    picture = wall()[:, WIDTH + pan : 2 * WIDTH + pan].astype(np.float64)
    boxes = [
        (40 + (8 * max(0, seq - 14)), 60, 34, 110, (200, 60, 40)),
        (150, 40, 26, 90, (40, 170, 60)) if seq < 22 else None,
        (300 - 6 * min(max(0, seq - 8), 12), 90, 40, 120, (30, 40, 230)) if seq >= 8 else None,
        (10 + 5 * seq, 190, 10, 24, (20, 30, 220)),
        (240, 10 + (seq % 3), 12, 12, (230, 230, 230)),
    ]
    for box in boxes:
        if box is not None:
            left, top, width, height, colour = box
            picture[top : top + height, max(0, left - pan) : max(0, left - pan + width)] = colour
    picture[200:230, 60 + 4 * seq : 110 + 4 * seq] *= 0.8
    return picture


def told(sent: Blobs) -> Row:
    """Pixels of each kind, blobs and the state of a message."""
    row: Row = [sent.kind, len(sent.blobs), sent.background, sent.protected_seq]
    if sent.evidence is not None:
        row += [float(count) for count in np.bincount(sent.evidence.array().ravel(), minlength=4)]
    if sent.camera_motion is not None:
        row += [value + 100.0 for value in sent.camera_motion.affine]
    for blob in sent.blobs[:4]:
        row += [*blob.box_xyxy, blob.area_px, *blob.centroid]
    return row


Film = Callable[[int], NDArray[np.float64]]
FILMS: dict[str, tuple[Film, Callable[[int], float]]] = {
    "steps": (lambda seq: steps(seq, 14), lambda seq: 0.1 * seq),
    "steps late": (lambda seq: steps(seq, 18), lambda seq: 0.25 * seq),
    "busy": (busy, lambda seq: 0.1 * seq),
    "busy and slow": (busy, lambda seq: 0.3 * seq),
    "busy and fast": (busy, lambda seq: 0.03 * seq),
    "lighter": (lambda seq: busy(seq) * (1.0 + 0.004 * seq), lambda seq: 0.08 * seq),
    "turning": (lambda seq: busy(seq, 2 * max(0, seq - 10)), lambda seq: 0.06 * seq),
    "turning and stopping": (
        lambda seq: busy(seq, 3 * min(max(0, seq - 4), 10)), lambda seq: 0.06 * seq
    ),
    "cut to another place": (
        lambda seq: busy(seq, 0 if seq < 16 else 300), lambda seq: 0.1 * seq
    ),
}  # fmt: skip
CASES = [
    *(("mixture", name) for name in ("steps", "steps late", "busy", "busy and slow", "lighter")),
    *(("ego", name) for name in ("steps", "busy", "turning", "busy and fast")),
    *(("auto", name) for name in ("turning and stopping", "cut to another place")),
    *(("mog2", name) for name in ("steps", "busy", "lighter")),
]


@pytest.mark.parametrize(("method", "film"), CASES)
def test_films(method: str, film: str, pinned: Pinned) -> None:
    """With tracks of the walking one that come some frames later, and not of every frame."""
    picture, time_s = FILMS[film]
    startup = {"startup_s": 3.0} if method == "mixture" else {}
    settings = DetectorSettings.model_validate({"detector": method, **startup})
    detector, rows = Detector(settings), cast(dict[str, Row], {})
    for seq in range(34):
        lag = settings.feedback_lag_frames
        feedback: Tracks | None = None
        if seq >= lag + 2 and seq % 5 != 4 and not 18 <= seq < 26:
            left = 300 - 6 * min(max(0, seq - lag - 8), 12)
            feedback = tracks_of(seq - lag, [(min(left, WIDTH - 40), 90, 40, 120)]).model_copy(
                update={"t_capture_ns": round(time_s(seq - lag) * 1e9)}
            )
        image = noisy(picture(seq), seq)
        sent = detector.detect(frame_at(seq, time_s(seq)), image, (WIDTH, HEIGHT), feedback)
        if seq % 3 == 0 or seq in (1, 2, 4, 5, 19, 20):
            rows[f"{seq}"] = told(sent)
    pinned(rows, **OF_PICTURES)


@pytest.mark.parametrize("lasts", [3, 6, 9])
def test_a_picture_that_is_another_for_a_while(lasts: int, pinned: Pinned) -> None:
    """The share of the picture that changes, and for how long it does: what is said of it."""
    rows: dict[str, Row] = {}
    for share in (0.25, 0.4, 0.55, 0.65):
        detector, row = Detector(DetectorSettings(work_width_px=160)), cast(Row, [])
        for seq in range(26):
            picture = wall()[:120, :160].astype(np.float64)
            if 12 <= seq < 12 + lasts:
                picture[:, : round(share * 160)] = 255.0 - picture[:, : round(share * 160)]
            image = noisy(picture, seq)
            sent = detector.detect(frame_at(seq, 0.1 * seq), image, (160, 120), None)
            row.append(f"{sent.background[0]}{len(sent.blobs)}")
        rows[f"{share}"] = row
    pinned(rows)


def test_mog2_after_hundreds_of_frames(pinned: Pinned) -> None:
    """A patch that stays: how long it is foreground depends on how long there was none."""
    rows: dict[str, Row] = {}
    for empty in (60, 180, 420):
        detector, row = Detector(DetectorSettings(detector="mog2", work_width_px=80)), cast(Row, [])
        for seq in range(empty + 60):
            picture = np.full((60, 80, 3), 100.0)
            if seq >= empty:
                picture[10:50, 30:50] = 180.0
            sent = detector.detect(frame_at(seq, 0.04 * seq), noisy(picture, seq), (80, 60), None)
            if seq >= empty and sent.evidence is not None:
                row.append(float(np.count_nonzero(sent.evidence.array() >= FOREGROUND)))
        rows[f"{empty}"] = row
    pinned(rows, **OF_PICTURES)


def test_true_blobs(pinned: Pinned) -> None:
    """Boxes of every size, with gaps of every width: those that pass."""
    rows: dict[str, Row] = {}
    for side, gap in itertools.product((6, 9, 12, 15, 20, 26, 30, 36, 44), (0, 2, 3, 4, 6, 9)):
        labels = np.full((120, 160), NONE, np.uint8)
        labels[20 : 20 + side, 20 : 20 + side] = FOREGROUND
        labels[20 + side // 2 : 20 + side // 2 + gap, 20 : 20 + side] = NONE
        labels[90:92, 100:140] = FOREGROUND
        found = true_blobs(labels, WorkSize.of_frame(160, 120, 160))
        rows[f"{side} {gap}"] = [value for one in found for value in (one.width, one.height)]
    pinned(rows)


# --- Parts


def test_how_fast_a_background_follows(pinned: Pinned) -> None:
    """Daylight that rises and stays, over minutes; pixels that only now and then may be learned."""
    model, rows = StandingBackground(np.full((6, 8, 3), 100, np.uint8)), cast(dict[str, Row], {})
    free = np.full((6, 8), 255, np.uint8)
    for seq in range(240):
        light = 100 + min(seq // 12, 12)
        free[:, 4:] = 255 if seq % 5 == 0 else 0
        model.learn(np.full((6, 8, 3), light, np.uint8), free, 0.1 if seq < 200 else 0.7)
        if seq % 12 == 0:
            rows[f"{seq}"] = [
                *map(float, model.mean[0, ::5, 0]),
                *map(float, model.variance[0, ::5]),
            ]
    pinned(rows, relative=1e-4)


def test_what_moves_between_frames(pinned: Pinned) -> None:
    """Patches that jump by steps of grey, in pictures with noise of every strength."""
    rows: dict[str, Row] = {}
    for sigma, step_s in itertools.product((0.0, 1.0, 2.5, 5.0), (0.02, 0.05, 0.1, 0.2)):
        difference, row = FrameDifference(), cast(Row, [])
        for seq in range(9):
            picture = np.full((120, 160, 3), 100.0)
            for place, off in enumerate((3, 5, 8, 11, 15, 20, 28, 40)):
                left = 18 * place + 2 * seq
                picture[20:80, left : left + 12] += off
            moving = difference.update(noisy(picture, seq, sigma), round(seq * step_s * 1e9))
            row.append(float(np.count_nonzero(moving)))
        rows[f"{sigma} {step_s}"] = row
    pinned(rows, **OF_PICTURES)


def test_how_many_frames_are_kept_to_compare(pinned: Pinned) -> None:
    """Frames that come so fast that none is old enough: the oldest kept is compared with."""
    difference, rows = FrameDifference(), cast(dict[str, Row], {})
    for seq in range(180):
        picture = np.full((40, 220, 3), 100, np.uint8)
        # Every frame lights another column: those of the frame compared with are not lit any more.
        picture[:, seq : seq + 4] = 200
        picture[: seq % 90 * 40 // 90] = 180
        rows[f"{seq}"] = [float(np.count_nonzero(difference.update(picture, seq * 100_000)))]
    pinned({at: row for at, row in rows.items() if int(at) % 9 == 0})


def test_regions(pinned: Pinned) -> None:
    """Bodies cut across by gaps of every height, and down by gaps of every width."""
    rows: dict[str, Row] = {}
    for gap in (1, 2, 3, 4, 5, 6, 8, 11):
        evidence = np.zeros((120, 160), np.uint8)
        evidence[10:110, 20:60] = evidence[10:110, 90:130] = FOREGROUND
        evidence[60 : 60 + gap, 20:60] = NONE
        evidence[10:110, 110 : 110 + gap] = NONE
        found = find_regions(evidence, 20)
        rows[f"{gap}"] = [float(value) for one in found for value in (one.area, one.centroid_x)]
    pinned(rows)


def test_what_is_known_at_first(pinned: Pinned) -> None:
    """Shares of the picture that move, at several frame rates: when the rest is known, and all."""
    rows: dict[str, Row] = {}
    for share, step_s in itertools.product((0.02, 0.08, 0.14, 0.3), (0.03, 0.07, 0.12, 0.2)):
        gate, row = StillnessGate((96, 128), 0, 2.0), cast(Row, [])
        for seq in range(12):
            moving = np.zeros((96, 128), np.uint8)
            moving[: round(96 * share)] = 255 * (seq % 2)
            moving[50 : 50 + 12, 20 + 3 * seq : 24 + 3 * seq] = 255
            moving[50 : 50 + 12, 27 + 3 * seq : 29 + 3 * seq] = 255
            settled = gate.settle(moving, round(seq * step_s * 1e9))
            labels = gate.correct(np.zeros((96, 128), np.uint8), moving)
            row += [float(settled.size), gate.learning, float(np.count_nonzero(labels))]
        rows[f"{share} {step_s}"] = row
    pinned(rows)


def test_frames_that_wait_for_their_tracks(pinned: Pinned) -> None:
    """Tracks of every lag and pause: which frames are due when, and by which they are protected."""
    rows: dict[str, Row] = {}
    size = WorkSize.of_frame(WIDTH, HEIGHT, 80)
    for lag, step_s, late in itertools.product((1, 4), (0.1, 0.3, 0.7), (1, 5, 9, 30)):
        frames, row = LateFrames(size, lag, 0), cast(Row, [])
        for seq in range(24):
            frame = frame_at(seq, step_s * seq)
            frames.add(frame, np.zeros((size.height, size.width, 3), np.uint8))
            tracks = None
            if seq >= late and seq % 3 == 0:
                tracks = tracks_of(seq - late, [(100, 60, 40, 120)]).model_copy(
                    update={"t_capture_ns": round(step_s * (seq - late) * 1e9)}
                )
            for due in frames.due(tracks):
                row += [seq, due.protected_seq, float(np.count_nonzero(due.free == 0)), due.dt_s]
        rows[f"{lag} {step_s} {late}"] = row
    pinned(rows)


def test_margins_of_protection(pinned: Pinned) -> None:
    size, rows = WorkSize.of_frame(WIDTH, HEIGHT, 160), cast(dict[str, Row], {})
    for box in ((100, 60, 40, 120), (0, 0, 20, 60), (250, 150, 70, 90)):
        tracks = tracks_of(3, [box], velocity_pxps=(40.0, -10.0))
        for later_s in (0.0, 0.3):
            free = free_mask(tracks, frame_at(4, 0.3 + later_s), size)
            at = np.nonzero(free == 0)
            rows[f"{box} {later_s}"] = [
                float(end) for side in at for end in (side.min(), side.max())
            ]
    pinned(rows)


def test_how_many_tracks_are_kept(pinned: Pinned) -> None:
    buffer = FeedbackBuffer(0)
    for seq in range(200):
        buffer.add(tracks_of(seq, []))
    kept = [buffer.exact(frame_at(seq, 0.1 * seq)) is not None for seq in range(200)]
    pinned({"kept": [sum(kept)]})


def test_ghosts(pinned: Pinned) -> None:
    """Where a background shows what the frame does not, more and more; when it is a ghost."""
    rows: dict[str, Row] = {}
    for share, step_s in itertools.product((0.3, 0.45, 0.55, 0.65, 0.75, 1.0), (0.06, 0.15, 0.3)):
        finder, row = GhostFinder((96, 128), 0), cast(Row, [])
        background = np.full((96, 128, 3), 100.0, np.float32)
        image = np.full((96, 128, 3), 100, np.uint8)
        for first, last in ((20, 80),):
            mask = np.zeros((96, 128), np.uint8)
            mask[first:last, 40:70] = 255
            background[first:last, 40:70] += np.float32(80 * share)
            image[first:last, 40:70] += np.uint8(80 * (1 - share))
        mask[5:7, 100:104] = 255
        mask[60:62, 10:13] = 255
        mask[85:92, 110:112] = 255
        for seq in range(12):
            ghost = finder.find(image, background, mask, round(seq * step_s * 1e9))
            row.append(float(ghost.size))
        rows[f"{share} {step_s}"] = row
    pinned(rows)


def test_sizes_at_which_frames_are_looked_at(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for width, height in ((320, 240), (1920, 1080), (1000, 1000), (1600, 1600), (600, 4000),
                          (300, 3000), (100, 9000), (4000, 600)):  # fmt: skip
        for work in (160, 480, 1600, 4000):
            size = WorkSize.of_frame(width, height, work)
            rows[f"{width} {height} {work}"] = [size.width, size.height]
    pinned(rows)


def test_pixels_of_people_and_regions(pinned: Pinned) -> None:
    """How far the pixels under boxes are reduced: tall ones, wide ones, and many."""
    image, rows = np.zeros((1200, 1600, 3), np.uint8), cast(dict[str, Row], {})
    for count, height, width in itertools.product(
        (1, 3, 12, 40, 90), (40, 70, 120, 260, 900), (30, 90, 300, 700)
    ):
        box = (10.0, 20.0, 10.0 + width, 20.0 + height)
        patch = person_blobs([(box, 0.5)] * count, image)[0].patch
        region = Region(10, 20, width, height, width * height, 10.0, 20.0)
        size = WorkSize(1600, 1200, 1600, 1200)
        of_region = region_blobs([region] * min(count, 12), image, size)[0].patch
        rows[f"{count} {height} {width}"] = [patch.width, patch.height, of_region.width,
                                             of_region.height]  # fmt: skip
    pinned(rows)


def test_shadows_are_darker_by_less_than_a_third() -> None:
    """A coat has less light than the floor, a shadow keeps 0.7 of it; noise is no shadow."""
    detector = Detector(DetectorSettings(detector="mixture", blur_px=0))
    for seq in range(20):
        sent = detector.detect(frame_at(seq, 0.1 * seq), noisy(steps(seq, 19), seq),
                               (WIDTH, HEIGHT), None)  # fmt: skip
    assert sent.evidence is not None
    evidence = sent.evidence.array()

    def usual(top: int) -> list[int]:
        parts = (evidence[top : top + 30, 30 * at + 10 : 30 * at + 22] for at in range(10))
        return [int(np.median(part)) for part in parts]

    darker, lighter = usual(95), usual(25)
    assert min(darker[:5]) >= FOREGROUND, "0.3 to 0.68 of the light"
    assert darker[5:7] == [SHADOW, SHADOW], "0.74 and 0.82"
    assert darker[8:] == [NONE, NONE], "0.95 and 0.985"
    assert lighter[:2] == [NONE, NONE], "3 and 5 grey levels"
    assert min(lighter[5:]) >= FOREGROUND, "20 and more"
