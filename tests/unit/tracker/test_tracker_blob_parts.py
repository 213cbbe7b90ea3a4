"""Kalman filter, assignment, occlusion test, features and identity, each alone."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes
from heel.services.tracker.paper.assignment import assign
from heel.services.tracker.paper.features import FAMILIES, extract
from heel.services.tracker.paper.identity import cost_matrix, retain
from heel.services.tracker.paper.kalman import BoxFilter
from heel.services.tracker.paper.occlusion import aspect_ratio, classify, is_occlusion
from heel.services.tracker.paper.settings import BlobSettings

SETTINGS = BlobSettings()
PERSON: BoxXyxy = (100.0, 100.0, 140.0, 220.0)
COUPLE: BoxXyxy = (100.0, 100.0, 180.0, 220.0)


@pytest.mark.parametrize("fps", [7.0, 25.0, 60.0])
def test_filter_learns_a_steady_walk_at_any_frame_rate(fps: float) -> None:
    walker = BoxFilter(PERSON, SETTINGS)
    frames = int(3 * fps)
    for frame in range(1, frames):
        walker.predict(1 / fps)
        walker.correct(boxes.moved(PERSON, 50 * frame / fps, -10 * frame / fps))
    assert walker.velocity_pxps == pytest.approx((50, -10), abs=2)
    assert walker.box == pytest.approx(
        boxes.moved(PERSON, 50 * (frames - 1) / fps, -10 * (frames - 1) / fps), abs=2
    )


def test_coasting_slows_down_and_holds_the_size() -> None:
    walker = BoxFilter(PERSON, SETTINGS)
    for frame in range(1, 20):
        walker.predict(0.1)
        walker.correct(boxes.moved(PERSON, 8.0 * frame, 0))
    area, speed = walker.area_px, walker.velocity_pxps[0]
    for _ in range(20):
        walker.predict(0.1)
        walker.coast(0.1)
    assert walker.area_px == pytest.approx(area, rel=0.05)
    assert 0 < walker.velocity_pxps[0] < 0.6 * speed


def test_filter_survives_boxes_without_size() -> None:
    walker = BoxFilter((5.0, 5.0, 5.0, 5.0), SETTINGS)
    for _ in range(50):
        walker.predict(5.0)
        walker.correct((5.0, 5.0, 5.0, 5.0))
    assert np.isfinite(walker.box).all()
    assert walker.span_px >= 1.0


def test_assignment_takes_the_greatest_total_and_not_the_greedy_best() -> None:
    predicted = [(0.0, 0.0, 10.0, 20.0), (4.0, 0.0, 14.0, 20.0)]
    seen = [(3.0, 0.0, 13.0, 20.0), (9.0, 0.0, 19.0, 20.0)]
    assert assign(predicted, seen) == {0: 0, 1: 1}


def test_boxes_that_do_not_overlap_are_never_paired() -> None:
    assert assign([PERSON], [boxes.moved(PERSON, 42, 0)]) == {}


@pytest.mark.parametrize("count", [0, 1])
def test_assignment_of_nothing_is_empty(count: int) -> None:
    assert assign([PERSON] * count, [PERSON] * (1 - count)) == {}


@pytest.mark.parametrize(
    ("box", "ratio"), [(PERSON, 1 / 3), (COUPLE, 2 / 3), ((0.0, 0.0, 0.0, 9.0), 0.0)]
)
def test_aspect_ratio_is_span_squared_over_area(box: BoxXyxy, ratio: float) -> None:
    assert aspect_ratio(box) == pytest.approx(ratio)


@pytest.mark.parametrize(
    ("before", "now", "occlusion"),
    [(PERSON, PERSON, False), (PERSON, COUPLE, True), (COUPLE, PERSON, True)],
)
def test_equation_4_holds_when_either_box_is_wide(
    before: BoxXyxy, now: BoxXyxy, occlusion: bool
) -> None:
    assert is_occlusion(before, now) is occlusion


@pytest.mark.parametrize(
    ("counts", "hidden", "blob", "expected"),
    [
        ((2, 1), [PERSON, PERSON], COUPLE, "inter_object"),
        ((2, 2), [PERSON, PERSON], COUPLE, "self"),
        ((2, 1), [PERSON, PERSON], PERSON, "none"),
        ((2, 1), [COUPLE, COUPLE], PERSON, "none"),
        ((1, 2), [PERSON, PERSON], COUPLE, "none"),
    ],
    ids=["count falls", "count equal", "not wide", "not larger", "count rises"],
)
def test_occlusion_is_classified_as_printed(
    counts: tuple[int, int], hidden: list[BoxXyxy], blob: BoxXyxy, expected: str
) -> None:
    assert classify(*counts, hidden, blob) == expected


def texture(seed: int, contrast: int = 60) -> NDArray[np.uint8]:
    coarse = np.random.default_rng(seed).integers(100, 100 + contrast, (16, 8, 3))
    return np.kron(coarse, np.ones((6, 6, 1))).astype(np.uint8)


def test_paper_features_are_its_seven_families() -> None:
    features = extract(texture(1))
    assert tuple(features) == FAMILIES
    assert len(FAMILIES) == 7
    assert all(np.isfinite(vector).all() for vector in features.values())


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_zero_on_a_flat_patch_and_grows_with_texture(family: str) -> None:
    flat, soft, hard = (
        extract(patch)[family]
        for patch in (np.full((60, 30, 3), 100, np.uint8), texture(1, 20), texture(1, 120))
    )
    assert np.abs(flat).max() < 1e-3
    assert 0 < soft.sum() < hard.sum()


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (700, 2), (90, 45)], ids=str)
def test_features_have_one_length_whatever_the_patch(shape: tuple[int, int]) -> None:
    expected = {name: len(vector) for name, vector in extract(texture(1)).items()}
    features = extract(np.full((*shape, 3), 50, np.uint8))
    assert {name: len(vector) for name, vector in features.items()} == expected


@pytest.mark.parametrize("people", [2, 3, 5])
def test_retention_finds_any_permutation_of_different_people(people: int) -> None:
    references = [extract(texture(seed)) for seed in range(people)]
    orders = list(itertools.permutations(range(people)))
    for order in orders[:: max(1, len(orders) // 6)]:
        noise = np.random.default_rng(9).integers(0, 8, (96, 48, 3))
        currents = [extract((texture(seed) + noise).astype(np.uint8)) for seed in order]
        decision = retain(cost_matrix(references, currents), 20.0)
        assert decision.slots == tuple(order.index(person) for person in range(people))
        assert min(decision.confidence) > 0.8


def test_retention_compares_s1_with_s2() -> None:
    """Two people: eq. 5 is the sum of the diagonal, eq. 6 of the other one."""
    keep, swap = np.array([[1.0, 2.0], [2.0, 1.5]]), np.array([[2.0, 1.0], [1.2, 2.0]])
    assert retain(keep, 20.0).slots == (0, 1)
    assert retain(swap, 20.0).slots == (1, 0)


@pytest.mark.parametrize("people", [2, 4])
def test_equal_costs_leave_an_even_chance_between_two_ways(people: int) -> None:
    decision = retain(np.ones((people, people)), 20.0)
    assert decision.confidence == pytest.approx([0.5] * people)
