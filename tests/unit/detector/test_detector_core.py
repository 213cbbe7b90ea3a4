"""The detector on drawn frames."""

from __future__ import annotations

import numpy as np
import pytest

from schemas import Blobs, encode
from schemas.blobs import FOREGROUND, MAX_BLOBS, MAX_WORK_PIXELS
from services.detector.core import Detector
from services.detector.geometry import WorkSize
from services.detector.protection import Protection
from services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import (
    HEIGHT,
    WIDTH,
    Person,
    background,
    frame_id,
    frame_image,
    tracks_of,
)

SIZE = (WIDTH, HEIGHT)
QUICK = DetectorSettings(learning_frames=5)


def learned(settings: DetectorSettings = QUICK, frames: int = 30) -> Detector:
    detector = Detector(settings)
    for seq in range(frames):
        detector.detect(frame_id(seq), frame_image(), SIZE, None)
    return detector


def see(people: list[Person], settings: DetectorSettings = QUICK) -> Blobs:
    return learned(settings).detect(frame_id(30), frame_image(people), SIZE, None)


@pytest.mark.parametrize(
    ("people", "count"),
    [
        ([], 0),
        ([(50, 60, 30, 80)], 1),
        ([(50, 60, 30, 80), (200, 100, 30, 90)], 2),
        ([(50, 60, 30, 80), (70, 60, 30, 80)], 1),
        ([(50, 60, 3, 4)], 0),
    ],
    ids=["nobody", "one", "two apart", "two that touch are one blob", "a speck is no blob"],
)
def test_counts_people_as_blobs(people: list[Person], count: int) -> None:
    assert len(see(people).blobs) == count


@pytest.mark.parametrize("work_width_px", [160, 320, 480])
def test_boxes_area_and_centroid_are_frame_pixels_at_any_working_size(work_width_px: int) -> None:
    settings = DetectorSettings(learning_frames=5, work_width_px=work_width_px, blur_px=3)
    (blob,) = see([(100, 60, 40, 120)], settings).blobs
    assert blob.box_xyxy == pytest.approx((100, 60, 140, 180), abs=6)
    assert blob.area_px == pytest.approx(40 * 120, rel=0.2)
    assert blob.centroid == pytest.approx((120, 120), abs=3)


def test_patch_holds_the_pixels_under_the_box() -> None:
    (blob,) = see([(100, 60, 40, 120)]).blobs
    left, top, right, bottom = (int(value) for value in blob.box_xyxy)
    expected = frame_image([(100, 60, 40, 120)])[top:bottom, left:right]
    np.testing.assert_array_equal(blob.patch.array(), expected)


def test_evidence_marks_the_person_as_foreground() -> None:
    message = see([(100, 60, 40, 120)])
    assert message.evidence is not None
    evidence = message.evidence.array()
    assert (evidence[70:170, 105:135] == FOREGROUND).mean() > 0.95
    assert (evidence[:, 200:] == FOREGROUND).sum() == 0


def test_first_frame_is_the_background_and_not_one_big_blob() -> None:
    message = Detector(QUICK).detect(frame_id(0), frame_image(), SIZE, None)
    assert message.blobs == ()
    assert (message.background, message.background_reason) == ("learning", "started")


def test_background_is_valid_after_the_learning_frames() -> None:
    message = see([])
    assert (message.background, message.background_reason) == ("valid", "")


@pytest.mark.parametrize(
    ("epoch", "shape", "reason"),
    [
        (2, (HEIGHT, WIDTH), "epoch 2"),
        (1, (HEIGHT // 2, WIDTH // 2), "size changed from 320x240 to 160x120"),
    ],
    ids=["epoch", "size"],
)
def test_starts_over_when_the_scene_changes(
    epoch: int, shape: tuple[int, int], reason: str
) -> None:
    detector = learned()
    image = np.zeros((*shape, 3), np.uint8)
    message = detector.detect(frame_id(30, epoch), image, SIZE, None)
    assert message.blobs == ()
    assert message.background == "learning"
    assert reason in message.background_reason
    assert (message.height, message.width) == shape


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (4320, 7680), (16384, 40)], ids=str)
def test_any_frame_size_gives_a_bounded_message(shape: tuple[int, int]) -> None:
    detector = Detector(QUICK)
    for seq, value in enumerate((0, 255)):
        image = np.full((*shape, 3), value, np.uint8)
        message = detector.detect(frame_id(seq), image, (shape[1], shape[0]), None)
        assert message.evidence is not None
        assert message.evidence.width * message.evidence.height <= MAX_WORK_PIXELS
        assert len(encode(message)) <= Blobs.max_bytes
        for blob in message.blobs:
            assert blob.box_xyxy[2] <= shape[1] + 1e-6
            assert blob.box_xyxy[3] <= shape[0] + 1e-6


def test_largest_blobs_are_kept_and_the_rest_is_counted() -> None:
    settings = DetectorSettings(
        min_box_area_fraction=0, min_height_fraction=0, blur_px=0, median_px=0, close_width_px=0
    )
    squares = [(x, y, 4, 4) for y in range(4, 230, 12) for x in range(4, 310, 12)]
    message = see([*squares[:-1], (squares[-1][0], squares[-1][1], 8, 8)], settings)
    assert len(message.blobs) == MAX_BLOBS
    assert message.blobs_left_out == len(squares) - MAX_BLOBS
    assert message.blobs[0].area_px == max(blob.area_px for blob in message.blobs) == 64


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_noise_everywhere_stays_under_the_message_cap(preset: str) -> None:
    settings = DetectorSettings.model_validate(
        {
            "preset": preset,
            "work_width_px": 1024,
            "blur_px": 0,
            "median_px": 0,
            "min_box_area_fraction": 0,
            "min_height_fraction": 0,
        }
    )
    detector = Detector(settings)
    noise = np.random.default_rng(7)
    for seq in range(3):
        image = noise.integers(0, 256, (900, 1024, 3), np.uint8)
        message = detector.detect(frame_id(seq), image, (1024, 900), None)
        assert len(encode(message)) <= Blobs.max_bytes


def test_same_frames_give_the_same_bytes() -> None:
    people = [(50, 60, 30, 80), (200, 100, 30, 90)]
    assert encode(see(people)) == encode(see(people))


def visible_after_standing(settings: DetectorSettings, frames: int, **track: object) -> bool:
    person: Person = (100, 60, 40, 120)
    detector = learned(settings)
    message = None
    for seq in range(30, 30 + frames):
        feedback = tracks_of(seq - 2, [person], **track)
        message = detector.detect(frame_id(seq), frame_image([person]), SIZE, feedback)
    assert message is not None
    return len(message.blobs) == 1


BRIEF = {"history_frames": 40, "learning_frames": 5}


@pytest.mark.parametrize(
    ("settings", "track", "seen"),
    [
        ({}, {}, True),
        ({}, {"state": "occluded"}, True),
        ({"protect": False}, {}, False),
        ({}, {"shown": False}, False),
        ({}, {"state": "new"}, False),
        ({}, {"state": "lost"}, False),
        ({"protect_still_s": 1.0}, {}, False),
        ({"preset": "paper"}, {}, False),
    ],
    ids=str,
)
def test_only_confirmed_people_who_move_are_kept_out_of_the_background(
    settings: dict[str, object], track: dict[str, object], seen: bool
) -> None:
    model = DetectorSettings.model_validate({**BRIEF, **settings})
    assert visible_after_standing(model, 60, **track) is seen


def test_protection_moves_ahead_with_the_person() -> None:
    protection = Protection(WorkSize.of_frame(WIDTH, HEIGHT, 480), 0.1, 10.0)
    feedback = tracks_of(28, [(20, 60, 40, 120)], velocity_pxps=(400.0, 0.0))
    mask = protection.mask(feedback, frame_id(30).t_capture_ns)
    assert mask[100, 120]
    assert not mask[100, 40]


@pytest.mark.parametrize("epoch", [1, 2])
def test_names_the_frame_it_was_protected_with_only_if_it_was(epoch: int) -> None:
    feedback = tracks_of(28, [(100, 60, 40, 120)]).model_copy(update={"epoch": epoch})
    message = learned().detect(frame_id(30), frame_image(), SIZE, feedback)
    assert message.protected_seq == (28 if epoch == 1 else None)


def test_read_only_images_are_accepted_and_left_as_they_are() -> None:
    image = background()
    image.setflags(write=False)
    Detector(QUICK).detect(frame_id(0), image, SIZE, None)
    np.testing.assert_array_equal(image, background())
