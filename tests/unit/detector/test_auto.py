"""Which background is believed when: a camera that stands, pans, shakes, or sees another light."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs, Tracks
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import Person, frame_id, tracks_of

WIDTH, HEIGHT = 320, 240
PERSON = (40, 110)
Picture = NDArray[np.uint8]
Place = tuple[float, float]


@cache
def wide_scene() -> Picture:
    """A textured wall, three times as wide as the picture."""
    noise = np.random.default_rng(5).integers(40, 200, (60, 120, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(noise, (3 * WIDTH, 2 * HEIGHT), interpolation=cv2.INTER_CUBIC))


@cache
def clothes() -> Picture:
    pattern = np.random.default_rng(9).choice(np.array([5, 20, 235, 250], np.uint8), (22, 8))
    return np.repeat(np.kron(pattern, np.ones((5, 5), np.uint8))[..., None], 3, axis=2)


def picture(camera: Place, person: float | None = None) -> Picture:
    """What a camera at `camera` sees, somebody standing at `person` on the wall's x axis."""
    scene = wide_scene()
    if person is not None:
        scene = scene.copy()
        left = round(person)
        scene[190:300, left : left + 40] = clothes()
    shift = np.array([[1, 0, -camera[0]], [0, 1, -camera[1]]])
    seen = cv2.warpAffine(scene, shift, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
    noise = np.random.default_rng(round(camera[0] * 7 + 1)).normal(0, 1.5, seen.shape)
    return np.clip(seen + noise, 0, 255).astype(np.uint8)


def play(pictures: Iterable[Picture], tracks: Iterable[Tracks | None] | None = None) -> list[Blobs]:
    detector = Detector(DetectorSettings(detector="auto"))
    known = iter(tracks) if tracks is not None else iter(())
    return [
        detector.detect(frame_id(seq), image, (WIDTH, HEIGHT), next(known, None))
        for seq, image in enumerate(pictures)
    ]


def foreground_share(message: Blobs) -> float:
    return 0.0 if message.evidence is None else float((message.evidence.array() >= 2).mean())


STANDING = [(200.0, 100.0)] * 30
PANNING = [(200.0 + 4.0 * step, 100.0 + step) for step in range(1, 31)]
STANDING_AGAIN = [PANNING[-1]] * 40


def test_a_camera_that_stands_uses_the_background_that_stands() -> None:
    assert {message.detector for message in play(map(picture, STANDING))} == {"mixture"}


@pytest.mark.parametrize("speed", [0.3, 1.0, 6.0])
def test_a_pan_is_noticed_within_its_first_pixels(speed: float) -> None:
    pan = [(200.0 + speed * step, 100.0) for step in range(1, 21)]
    seen = play(map(picture, STANDING + pan))
    first = next(seq for seq, message in enumerate(seen) if message.detector == "ego")
    assert speed * (first - len(STANDING)) < 3.0 + 2 * speed


def test_a_change_of_model_floods_nothing_with_foreground() -> None:
    seen = play(map(picture, STANDING + PANNING + STANDING_AGAIN))
    assert [seen[29].detector, seen[59].detector, seen[-1].detector] == [
        "mixture",
        "ego",
        "mixture",
    ]
    assert max(map(foreground_share, seen[10:])) < 0.02


def test_motion_of_the_camera_is_told_in_pixels_of_the_frame() -> None:
    motion = play(map(picture, STANDING + PANNING))[50].camera_motion
    assert motion is not None
    assert motion.affine == pytest.approx((1, 0, -4, 0, 1, -1), abs=0.15)
    assert motion.quality > 0.5


def test_somebody_who_walks_is_foreground_before_and_after_the_pan_begins() -> None:
    cameras = STANDING + PANNING
    places = [230.0 + 4.0 * step for step in range(len(cameras))]
    seen = play(picture(camera, place) for camera, place in zip(cameras, places, strict=True))
    for seq in (20, 28, 33, 45, 58):
        evidence = seen[seq].evidence
        assert evidence is not None
        left = round(places[seq] - cameras[seq][0])
        top = round(190 - cameras[seq][1])
        under = evidence.array()[top + 8 : top + 102, left + 6 : left + 34]
        assert (under >= 2).mean() > 0.8, f"frame {seq}"


def test_confirmed_people_are_not_learned_while_the_camera_moves() -> None:
    cameras = STANDING + PANNING + STANDING_AGAIN[:8]
    person = 360.0
    boxes: list[Person] = [
        (round(person - camera[0]), round(190 - camera[1]), *PERSON) for camera in cameras
    ]
    tracks = [None, None, *(tracks_of(seq, [box]) for seq, box in enumerate(boxes[:-2]))]
    empty = [picture(camera) for camera in cameras[:10]]
    seen = play(empty + [picture(camera, person) for camera in cameras[10:]], tracks)
    evidence = seen[-1].evidence
    assert evidence is not None
    left, top, width, height = boxes[-1]
    under = evidence.array()[top + 8 : top + height - 8, left + 6 : left + width - 6]
    assert (under >= 2).mean() > 0.8


def test_a_cover_on_the_lens_is_called_blind_and_not_people() -> None:
    dark = [np.zeros((HEIGHT, WIDTH, 3), np.uint8)] * 4
    seen = play([picture(camera) for camera in STANDING] + dark)[-1]
    assert (seen.background, seen.evidence, seen.blobs) == ("invalid", None, ())
    assert "of the picture differs" in seen.background_reason


def test_another_light_is_learned_within_a_second_or_so() -> None:
    bright = [np.clip(picture(camera) * 0.4 + 140, 0, 255).astype(np.uint8) for camera in STANDING]
    seen = play([picture(camera) for camera in STANDING] + bright)
    assert seen[31].background == "invalid"
    assert seen[-1].background == "valid"
    assert foreground_share(seen[-1]) < 0.02


def test_a_frame_in_which_nothing_can_be_found_again_is_passed_over() -> None:
    cameras = STANDING + PANNING
    pictures = [picture(camera) for camera in cameras]
    pictures[45] = np.asarray(cv2.blur(pictures[45], (61, 61)), np.uint8)
    seen = play(pictures)
    assert seen[45].background == "invalid"
    assert seen[45].background_reason == "the camera's motion cannot be told"
    assert max(map(foreground_share, seen[46:])) < 0.02
