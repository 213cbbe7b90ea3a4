"""The detector on drawn frames: what holds whichever the background model."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import Blobs, encode
from heel.schemas.blobs import FOREGROUND, MAX_BLOBS, MAX_WORK_PIXELS
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
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
MIXTURE, MOG2 = DetectorSettings(detector="mixture"), DetectorSettings(detector="mog2")
BOTH = pytest.mark.parametrize("settings", [MIXTURE, MOG2], ids=["mixture", "mog2"])


def learned(settings: DetectorSettings, frames: int = 45) -> Detector:
    detector = Detector(settings)
    for seq in range(frames):
        detector.detect(frame_id(seq), frame_image(), SIZE, None)
    return detector


def see(people: list[Person], settings: DetectorSettings) -> Blobs:
    return learned(settings).detect(frame_id(45), frame_image(people), SIZE, None)


@BOTH
@pytest.mark.parametrize(
    ("people", "count"),
    [
        ([], 0),
        ([(50, 60, 30, 80)], 1),
        ([(50, 60, 30, 80), (200, 100, 30, 90)], 2),
        ([(50, 60, 30, 80), (70, 60, 30, 80)], 1),
        ([(50, 60, 1, 3)], 0),
    ],
    ids=["nobody", "one", "two apart", "two that touch are one blob", "a speck is no blob"],
)
def test_counts_people_as_blobs(
    people: list[Person], count: int, settings: DetectorSettings
) -> None:
    assert len(see(people, settings).blobs) == count


@pytest.mark.parametrize("background_model", ["mixture", "mog2"])
@pytest.mark.parametrize("work_width_px", [160, 320, 480])
def test_boxes_area_and_centroid_are_frame_pixels_at_any_working_size(
    work_width_px: int, background_model: str
) -> None:
    settings = DetectorSettings.model_validate(
        {"work_width_px": work_width_px, "blur_px": 3, "detector": background_model}
    )
    (blob,) = see([(100, 60, 40, 120)], settings).blobs
    assert blob.box_xyxy == pytest.approx((100, 60, 140, 180), abs=6)
    assert blob.area_px == pytest.approx(40 * 120, rel=0.2)
    assert blob.centroid == pytest.approx((120, 120), abs=3)


@BOTH
def test_patch_holds_the_pixels_under_the_box(settings: DetectorSettings) -> None:
    (blob,) = see([(100, 60, 40, 120)], settings).blobs
    left, top, right, bottom = (int(value) for value in blob.box_xyxy)
    expected = frame_image([(100, 60, 40, 120)])[top:bottom, left:right]
    np.testing.assert_array_equal(blob.patch.array(), expected)


@BOTH
def test_evidence_marks_the_person_as_foreground(settings: DetectorSettings) -> None:
    message = see([(100, 60, 40, 120)], settings)
    assert message.evidence is not None
    evidence = message.evidence.array()
    assert (evidence[70:170, 105:135] >= FOREGROUND).mean() > 0.95
    assert (evidence[:, 200:] >= FOREGROUND).sum() == 0


@BOTH
def test_first_frame_is_the_background_and_not_one_big_blob(settings: DetectorSettings) -> None:
    message = Detector(settings).detect(frame_id(0), frame_image(), SIZE, None)
    assert message.blobs == ()
    assert (message.background, message.background_reason) == ("learning", "started")


@BOTH
def test_background_is_valid_after_the_start(settings: DetectorSettings) -> None:
    message = see([], settings)
    assert (message.background, message.background_reason) == ("valid", "")


@pytest.mark.parametrize("name", ["mixture", "mog2"])
def test_names_the_background_model(name: str) -> None:
    settings = DetectorSettings.model_validate({"detector": name})
    assert Detector(settings).detect(frame_id(0), frame_image(), SIZE, None).detector == name


@BOTH
@pytest.mark.parametrize(
    ("epoch", "shape", "reason"),
    [
        (2, (HEIGHT, WIDTH), "epoch 2"),
        (1, (HEIGHT // 2, WIDTH // 2), "size changed from 320x240 to 160x120"),
    ],
    ids=["epoch", "size"],
)
def test_starts_over_when_the_scene_changes(
    epoch: int, shape: tuple[int, int], reason: str, settings: DetectorSettings
) -> None:
    image = np.zeros((*shape, 3), np.uint8)
    message = learned(settings).detect(frame_id(45, epoch), image, SIZE, None)
    assert message.blobs == ()
    assert message.background == "learning"
    assert reason in message.background_reason
    assert (message.height, message.width) == shape


@BOTH
@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 4), (1, 500), (500, 1), (4320, 7680), (16384, 40)], ids=str
)
def test_any_frame_size_gives_a_bounded_message(
    shape: tuple[int, int], settings: DetectorSettings
) -> None:
    detector = Detector(settings)
    for seq, value in enumerate((0, 255, 0, 255)):
        image = np.full((*shape, 3), value, np.uint8)
        message = detector.detect(frame_id(seq), image, (shape[1], shape[0]), None)
        assert message.evidence is not None
        assert message.evidence.width * message.evidence.height <= MAX_WORK_PIXELS
        assert len(encode(message)) <= Blobs.max_bytes
        for blob in message.blobs:
            assert blob.box_xyxy[2] <= shape[1] + 1e-6
            assert blob.box_xyxy[3] <= shape[0] + 1e-6


def test_largest_blobs_are_kept_and_the_rest_is_counted() -> None:
    squares = [(x, y, 6, 6) for y in range(4, 230, 18) for x in range(4, 310, 14)]
    people = [*squares[:-1], (squares[-1][0], squares[-1][1], 10, 10)]
    message = see(people, DetectorSettings(blur_px=0))
    assert len(message.blobs) == MAX_BLOBS
    assert message.blobs_left_out == len(squares) - MAX_BLOBS
    areas = [blob.area_px for blob in message.blobs]
    assert areas == sorted(areas, reverse=True)
    assert areas[0] > areas[1]


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_noise_everywhere_stays_under_the_message_cap(preset: str) -> None:
    settings = DetectorSettings.model_validate(
        {"preset": preset, "work_width_px": 1024, "blur_px": 0}
    )
    detector = Detector(settings)
    noise = np.random.default_rng(7)
    for seq in range(4):
        image = noise.integers(0, 256, (900, 1024, 3), np.uint8)
        message = detector.detect(frame_id(seq), image, (1024, 900), None)
        assert len(encode(message)) <= Blobs.max_bytes


@BOTH
def test_same_frames_give_the_same_bytes(settings: DetectorSettings) -> None:
    people = [(50, 60, 30, 80), (200, 100, 30, 90)]
    assert encode(see(people, settings)) == encode(see(people, settings))


@BOTH
@pytest.mark.parametrize("change", [{}, {"epoch": 2}, {"width": WIDTH + 1}], ids=str)
def test_names_the_frame_it_was_protected_with_only_if_it_was(
    change: dict[str, int], settings: DetectorSettings
) -> None:
    feedback = tracks_of(43, [(100, 60, 40, 120)]).model_copy(update=change)
    message = learned(settings).detect(frame_id(45), frame_image(), SIZE, feedback)
    # The paper's detector learns each frame at once, people and all.
    protected = not change and settings.method != "mog2"
    assert message.protected_seq == (43 if protected else None)


@BOTH
def test_read_only_images_are_accepted_and_left_as_they_are(settings: DetectorSettings) -> None:
    image = background()
    image.setflags(write=False)
    for seq in range(2):
        Detector(settings).detect(frame_id(seq), image, SIZE, None)
    np.testing.assert_array_equal(image, background())
