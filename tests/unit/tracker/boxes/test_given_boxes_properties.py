"""What holds of every crowd, on crowds made up from seeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from heel.services.tracker.boxes.frame import checked
from heel.services.tracker.boxes.score_scale import RunningMedian, ScoreScale
from heel.services.tracker.boxes.sequence import box_tracker
from heel.services.tracker.people.camera_motion import CameraMotion, common_shift
from heel.services.tracker.people.geometry import boxes_to_measurements, measurements_to_boxes
from heel.services.tracker.report import Report

Frame = tuple[NDArray[np.float64], NDArray[np.float64]]
SEEDS = st.integers(0, 10_000)


def crowd(seed: int, frames: int = 40) -> list[Frame]:
    """People who walk, with missed, jittered, doubled and false boxes."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    place, speed = rng.uniform(100, 500, (count, 2)), rng.normal(0, 4, (count, 2))
    made = []
    for _ in range(frames):
        place = place + speed
        seen = place[rng.random(count) < 0.85]
        false = rng.uniform(50, 550, (int(rng.poisson(0.5)), 2))
        foot = np.concatenate([seen, seen[rng.random(len(seen)) < 0.1], false])
        foot = foot + rng.normal(0, 2, foot.shape)
        half = np.array([18.0, 0.0])
        boxes = np.hstack([foot - half - np.array([0.0, 90.0]), foot + half])
        made.append((boxes, rng.uniform(0.3, 1.0, len(boxes))))
    return made


def track(frames: list[Frame]) -> list[list[Report]]:
    tracker = box_tracker(image_size=(640, 640))
    return [
        tracker.update(checked(boxes, scores), k / 7) for k, (boxes, scores) in enumerate(frames)
    ]


@settings(max_examples=25, deadline=None, derandomize=True)
@given(SEEDS)
def test_ids_are_unique_in_a_frame_and_never_reused_after_being_given_up(seed: int) -> None:
    highest = 0
    known: set[int] = set()
    for tracks in track(crowd(seed)):
        ids = [output.id for output in tracks if output.id]
        assert len(ids) == len(set(ids))
        fresh = set(ids) - known
        assert all(identity > highest for identity in fresh)
        known |= fresh
        highest = max(known, default=0)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(SEEDS)
def test_the_order_of_the_boxes_does_not_matter(seed: int) -> None:
    frames = crowd(seed)
    rng = np.random.default_rng(seed)
    mixed = []
    for boxes, scores in frames:
        order = rng.permutation(len(boxes))
        mixed.append((boxes[order], scores[order]))
    for one, other in zip(track(frames), track(mixed), strict=True):
        assert [output.id for output in one] == [output.id for output in other]
        for first, second in zip(one, other, strict=True):
            np.testing.assert_array_equal(first.box_xyxy, second.box_xyxy)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(SEEDS)
def test_confidence_is_a_probability_and_boxes_are_boxes(seed: int) -> None:
    for output in (output for tracks in track(crowd(seed)) for output in tracks):
        assert 0 <= output.identity_confidence <= 1
        assert np.isfinite(output.box_xyxy).all()
        left, top, right, bottom = output.box_xyxy
        assert left < right
        assert top < bottom
        assert output.id > 0 or not output.shown


@settings(max_examples=10, deadline=None, derandomize=True)
@given(SEEDS)
def test_what_was_said_does_not_depend_on_the_future(seed: int) -> None:
    frames = crowd(seed)
    whole, part = track(frames), track(frames[:20])
    for one, other in zip(whole, part, strict=False):
        assert [output.id for output in one] == [output.id for output in other]


@given(SEEDS)
def test_boxes_survive_the_way_to_measurements_and_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner = rng.uniform(-100, 500, (5, 2))
    boxes = np.hstack([corner, corner + rng.uniform(2, 300, (5, 2))])
    np.testing.assert_allclose(measurements_to_boxes(boxes_to_measurements(boxes)), boxes)


def test_scores_are_shares_of_what_continuing_tracks_have() -> None:
    scale = ScoreScale()
    scale.learn(np.array([20.0, 30.0, 40.0]))
    assert scale.normalised(np.array([-3.0, 15.0, 30.0, 60.0])).tolist() == [0.0, 0.5, 1.0, 1.0]


def test_scores_without_meaning_count_alike() -> None:
    scale = ScoreScale()
    assert scale.normalised(np.array([-1.0, -1.0])).tolist() == [1.0, 1.0]
    assert scale.normalised(np.zeros(0)).tolist() == []


def test_a_camera_moves_if_all_are_surprised_alike() -> None:
    rng = np.random.default_rng(2)
    for shake, stands in ((0.0, True), (0.05, False)):
        motion = CameraMotion()
        assert motion.stands()
        for _ in range(300):
            motion.learn(rng.normal(0, 0.03, (6, 2)) + rng.normal(0, shake, 2))
        assert motion.stands() == stands
        assert 0 <= motion.correlation() <= 1


def test_what_surprises_all_alike_is_the_cameras_shift() -> None:
    surprises = np.array([[10.0, -4.0], [12.0, -5.0], [8.0, -3.0], [300.0, -4.0]])
    shift = common_shift(surprises, np.array([[25.0, 25.0]] * 3 + [[2500.0, 25.0]]))
    assert shift == pytest.approx([10.5, -4.0], abs=0.5)


@given(SEEDS)
def test_the_running_median_is_that_of_the_newest_500_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 40, int(rng.integers(1, 1200))) / 7
    median = RunningMedian()
    assert median.value() is None
    for part in np.array_split(values, 9):
        median.add(part)
    assert median.value() == pytest.approx(np.median(values[-500:]))
