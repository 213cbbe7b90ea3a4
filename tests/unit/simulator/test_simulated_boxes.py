"""What the stand-in for a detector reports: where, how surely, and with which pixels."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs, decode, encode
from heel.services.simulator.boxes import DetectorErrors, SimulatedDetector
from heel.services.simulator.errors import SimulatorError
from heel.services.simulator.outfits import twin_of
from heel.services.simulator.state import Outfit, RobotState
from heel.services.simulator.world import World
from tests.unit.simulator.empty_worlds import (
    BLUE,
    MOUNT,
    RED,
    actor,
    box,
    frame,
    sight_of,
    world,
)

FAULTLESS = DetectorErrors(
    miss=0.0, burst_hz=0.0, jitter_px=0.0, jitter_share=0.0, false_hz=0.0
)  # fmt: skip


def detect(it: World, errors: DetectorErrors = FAULTLESS, seed: int = 0) -> Blobs:
    return SimulatedDetector(MOUNT, seed, errors).detect(it, frame())


def watch(
    it: World, frames: int, errors: DetectorErrors | None = None, seed: int = 0,
    linear_mps: float = 0.0, angular_radps: float = 0.0,
) -> list[Blobs]:  # fmt: skip
    """Frames at 20 a second with the robot under one command."""
    detector = SimulatedDetector(MOUNT, seed, errors)
    found = []
    for index in range(frames):
        found.append(detector.detect(it, frame(index)))
        it.step(0.05, linear_mps, angular_radps)
    return found


def upper_body(blobs: Blobs, index: int = 0) -> NDArray[np.float64]:
    """Mean colour of the middle of the upper body, BGR."""
    crop = blobs.blobs[index].patch.array()
    return crop[6:11, 4:8].mean((0, 1))


def test_a_faultless_detector_gives_the_box_that_the_lens_gives() -> None:
    it = world(actor(3.0, 0.5))
    found = detect(it)
    assert found.blobs[0].box_xyxy == pytest.approx(sight_of(it).box_xyxy[0])
    assert found.blobs[0].score is not None
    assert found.blobs[0].score > 0.7
    assert (found.kind, found.detector, found.evidence) == ("people", "simulated", None)
    assert decode(Blobs, encode(found), Blobs.encoding()) == found


def test_boxes_are_cut_at_the_border_of_the_picture() -> None:
    left, top, right, bottom = detect(world(actor(1.0, 0.9))).blobs[0].box_xyxy
    assert (left, top, bottom) == (0.0, 0.0, 480.0)
    assert right < 120


def test_nothing_is_reported_of_who_is_hidden_or_behind() -> None:
    people = actor(4.0, 0.0), actor(-3.0, 0.0, role="other")
    it = world(*people, obstacles=(box(2.0, 0.0, 0.2, 3.0),))
    often = DetectorErrors(burst_hz=2.0, false_hz=0.0)
    assert all(not blobs.blobs for blobs in watch(it, 200, often))


def test_the_box_shrinks_to_what_is_left_to_see() -> None:
    it = world(actor(4.0, 0.0), obstacles=(box(2.0, 0.0, 0.2, 3.0, 0.8),))
    true = sight_of(it).box_xyxy[0]
    bottoms = [b.blobs[0].box_xyxy[3] for b in watch(it, 200, FAULTLESS) if b.blobs]
    # The wall ends at the height of the lens, in the middle of the picture; now and then the
    # detector guesses that there is more.
    assert min(bottoms) == pytest.approx(240.0, abs=(true[3] - true[1]) / 9)
    assert 240.0 < np.mean(bottoms) < 0.5 * (240.0 + true[3])


def test_somebody_half_hidden_is_missed_more_often_and_scored_lower() -> None:
    errors = DetectorErrors(false_hz=0.0)
    free = watch(world(actor(4.0, 0.0)), 200, errors)
    wall = box(2.0, 1.46, 0.2, 3.0)
    hidden = watch(world(actor(4.0, 0.0), obstacles=(wall,)), 200, errors)
    counts = [sum(len(b.blobs) for b in frames) for frames in (free, hidden)]
    assert 175 <= counts[0] < 200
    assert 20 < counts[1] < 0.8 * counts[0]
    scores = [np.mean([x.score for b in frames for x in b.blobs]) for frames in (free, hidden)]
    assert scores[1] < scores[0] - 0.1


def test_misses_come_in_bursts_too() -> None:
    bursts = DetectorErrors(miss=0.0, burst_hz=0.5, burst_s=0.5, false_hz=0.0)
    missed = [not b.blobs for b in watch(world(actor(4.0, 0.0)), 1200, bursts)]
    both = np.mean([a and b for a, b in itertools.pairwise(missed)])
    assert both > 3 * np.mean(missed) ** 2 > 0


def test_edges_jitter_about_the_truth_and_more_so_for_far_people() -> None:
    relative = []
    for away in (2.5, 9.0):
        it = world(actor(away, 0.0))
        true = sight_of(it).box_xyxy[0]
        found = watch(it, 300, DetectorErrors(miss=0.0, burst_hz=0.0, false_hz=0.0))
        error = np.array([b.blobs[0].box_xyxy for b in found if b.blobs]) - true
        assert np.abs(error.mean(0)).max() < 0.5 * error.std(0).max()
        relative.append(float(error.std() / (true[3] - true[1])))
    assert 0.005 < relative[0] < 0.03
    assert relative[1] > 1.5 * relative[0]


def test_no_two_boxes_all_but_coincide() -> None:
    people = actor(3.0, 0.0), actor(3.3, 0.12, role="other", outfit=BLUE)
    found = watch(world(*people), 300, FAULTLESS)
    pairs = [[blob.box_xyxy for blob in blobs.blobs] for blobs in found if len(blobs.blobs) == 2]
    assert 0 < len(pairs) < 300
    for (left, _, right, _), (other_left, _, other_right, _) in pairs:
        shared = min(right, other_right) - max(left, other_left)
        assert shared < 0.85 * max(right - left, other_right - other_left)


def test_false_alarms_live_shortly_and_only_where_wanted() -> None:
    lone = actor(-30.0, 0.0)
    alarms = watch(world(lone), 1200, DetectorErrors(false_hz=0.5))
    busy = [len(blobs.blobs) for blobs in alarms]
    assert 0.02 < np.mean([count > 0 for count in busy]) < 0.3
    assert all(0.2 <= (b.score or 0) <= 0.65 for blobs in alarms for b in blobs.blobs)
    assert not any(blobs.blobs for blobs in watch(world(lone), 400, FAULTLESS))


def test_blobs_come_in_order_of_scores_so_that_the_order_names_nobody() -> None:
    people = [actor(2.0 + 1.5 * i, 0.9 * i - 2, role="other") for i in range(1, 5)]
    orders = set()
    for blobs in watch(world(actor(3.0, 1.0), *people), 60):
        scores = [blob.score or 0.0 for blob in blobs.blobs]
        assert scores == sorted(scores, reverse=True)
        orders.add(tuple(np.argsort([blob.box_xyxy[0] for blob in blobs.blobs]).tolist()))
    assert len(orders) > 5


@pytest.mark.parametrize(("outfit", "strongest"), [(RED, 2), (BLUE, 0)])
def test_crops_show_the_clothes(outfit: Outfit, strongest: int) -> None:
    colour = upper_body(detect(world(actor(3.0, 0.0, outfit=outfit))))
    assert int(colour.argmax()) == strongest
    assert colour[strongest] > 2.5 * np.delete(colour, strongest).max()


def test_crops_show_the_face_from_the_front_and_hair_from_behind() -> None:
    faces = [
        detect(world(actor(3.0, 0.0, heading_rad=heading))).blobs[0].patch.array()[2, 5:7].mean()
        for heading in (math.pi, 0.0)
    ]
    assert faces[0] > faces[1] + 80


def test_crops_of_twins_are_alike_and_those_of_others_are_not() -> None:
    rng = np.random.default_rng(0)
    crops = [
        watch(world(actor(3.0, 0.0, outfit=outfit)), 1, FAULTLESS)[0].blobs[0].patch.array()
        for outfit in (RED, twin_of(RED, rng), BLUE)
    ]
    same, other = (np.abs(crops[0].astype(float) - crop).mean() for crop in crops[1:])
    assert same < 8 < other


def test_crops_show_what_stands_before_somebody() -> None:
    near, far = actor(2.0, 0.22, role="other", outfit=BLUE), actor(4.0, 0.0, outfit=RED)
    found = watch(world(far, near), 200, FAULTLESS)
    far_box = sight_of(world(far, near)).box_xyxy[0]
    blue = 0.0
    for blob in (b for blobs in found for b in blobs.blobs):
        if abs(blob.box_xyxy[1] - far_box[1]) < 15:
            # The near person stands to the left in the picture.
            row = blob.patch.array()[8].astype(float)
            blue = max(blue, (row[:, 0] - row[:, 2]).max())
    assert blue > 60


def test_a_light_switch_darkens_the_picture_until_the_camera_has_adapted() -> None:
    it = world(actor(3.0, 0.0), lights=((2.0, 0.3),))
    found = watch(it, 120, FAULTLESS)
    bright = np.mean([upper_body(b)[2] for b in found[:40] if b.blobs])
    dark = np.mean([upper_body(b)[2] for b in found[40:44] if b.blobs] or [0.0])
    later = np.mean([upper_body(b)[2] for b in found[100:] if b.blobs])
    assert dark < 0.6 * bright
    assert later == pytest.approx(bright, rel=0.1)
    assert sum(not b.blobs for b in found[40:60]) > 3 > sum(not b.blobs for b in found[100:])


def test_a_camera_that_is_off_gives_no_frame_to_detect_in() -> None:
    it = world(actor(3.0, 0.0), dropouts=((0.1, 0.3),))
    detector = SimulatedDetector(MOUNT, 0)
    detector.detect(it, frame())
    it.step(0.1, 0.0, 0.0)
    assert not it.camera_on
    with pytest.raises(SimulatorError, match=r"0\.10 s"):
        detector.detect(it, frame(1))
    for _ in range(3):
        it.step(0.1, 0.0, 0.0)
    assert it.camera_on
    detector.detect(it, frame(1))


def test_the_motion_of_the_camera_is_that_of_the_robot() -> None:
    standing = watch(world(), 5)
    assert all(blobs.camera_motion is None for blobs in standing)
    turning = watch(world(), 40, angular_radps=0.5)[-1].camera_motion
    assert turning is not None
    # To the left by 0.025 rad a frame: what is in the middle moves right by 8 pixels.
    a, b, tx, *_ = turning.affine
    assert a * 320 + b * 240 + tx - 320 == pytest.approx(320 * math.tan(0.025), abs=2.0)
    assert 0.3 < turning.quality < 1.0
    driving = [b.camera_motion for b in watch(world(), 40, linear_mps=1.0)[20:]]
    assert np.mean([m.affine[0] for m in driving if m]) == pytest.approx(1.01, abs=0.005)


def test_a_turn_moves_far_people_as_the_motion_says() -> None:
    it = world(actor(9.0, 0.5), robot=RobotState(0.0, 0.0, 0.0, 0.0, 0.0))
    found = watch(it, 20, FAULTLESS, angular_radps=0.6)
    before, after = found[-2].blobs[0], found[-1].blobs[0]
    motion = found[-1].camera_motion
    assert motion is not None
    a, b, tx, c, d, ty = motion.affine
    x_px, y_px = before.centroid
    moved = a * x_px + b * y_px + tx, c * x_px + d * y_px + ty
    assert moved == pytest.approx(after.centroid, abs=2.0)
