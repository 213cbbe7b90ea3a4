"""Appearance: descriptors with a mask, and a metric that a scene's own tracks teach."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.learned_metric.gallery import Gallery, nearest_views
from benchmarks.learned_metric.metric import Metric, learned
from benchmarks.learned_metric.model import AppearanceModel
from heel.services.tracker.people.appearance import (
    DESCRIPTOR_LENGTH,
    FloatArray,
    cut_out,
    describe,
    distances,
)
from tests.unit.tracker.drawn_detections import BLUE, GREEN, RED, TALL, WIDE, Colours, patch


def on_wall(colours: Colours, seed: int, wall: tuple[int, int, int]) -> NDArray[np.uint8]:
    """A drawn person before a wall of another colour than grey."""
    drawn = patch(colours, seed)
    drawn[~person_mask()] = wall
    return drawn


def person_mask() -> NDArray[np.bool_]:
    mask = np.zeros((TALL, WIDE), bool)
    mask[10:40, 28:52] = mask[40:110, 16:64] = mask[110:195, 22:58] = True
    return mask


def test_descriptors_have_unit_length_and_do_not_depend_on_other_people() -> None:
    patches = [patch(colours, 1) for colours in (RED, GREEN, BLUE)]
    masks = [person_mask()] * 3
    for shown in (None, masks):
        together = describe(patches, shown)
        assert np.linalg.norm(together, axis=1) == pytest.approx(np.ones(3))
        for k, look in enumerate(together):
            alone = describe(patches[k : k + 1], shown and shown[k : k + 1])
            np.testing.assert_allclose(alone[0], look)


@pytest.mark.parametrize("small", [1, 4], ids=["same size", "a quarter of the size"])
def test_a_mask_takes_the_background_off(small: int) -> None:
    walls = [on_wall(RED, 1, wall) for wall in ((20, 200, 20), (200, 20, 200))]
    mask = person_mask()[::small, ::small].astype(np.uint8)
    whole, masked = (describe(walls, shown) for shown in (None, [mask, mask]))
    apart = [distances(looks[:1], looks[1:])[0, 0] for looks in (whole, masked)]
    assert apart[1] < 0.85 * apart[0], apart


@pytest.mark.parametrize("mask", [np.zeros((9, 9), np.uint8), np.zeros((0, 4), np.uint8)])
def test_a_mask_that_shows_nobody_counts_as_none(mask: NDArray[np.uint8]) -> None:
    one = [patch(RED, 1)]
    assert distances(describe(one), describe(one, [mask]))[0, 0] < 0.15


def test_nobody_and_tiny_patches_have_a_descriptor_without_colour() -> None:
    assert describe([]).shape == describe([], []).shape == (0, DESCRIPTOR_LENGTH)
    tiny = describe([np.zeros((5, 2, 3), np.uint8), np.full((4, 90, 3), 255, np.uint8)])
    assert len(np.unique(tiny)) == 1


def test_a_box_over_the_edge_is_cut_to_the_picture_and_the_mask_alike() -> None:
    boxes = np.array([[-9, 50, 20, 120.0], [90, 0, 99, 9]])
    for image in (np.zeros((100, 80, 3), np.uint8), np.zeros((100, 80), np.float32)):
        assert [one.shape[:2] for one in cut_out(image, boxes)] == [(50, 20), (9, 0)]


def test_a_gallery_is_bounded_and_its_copy_stays() -> None:
    gallery = Gallery()
    for seed in range(40):
        look = np.random.default_rng(seed).random(DESCRIPTOR_LENGTH) ** 8
        gallery.add(look / np.linalg.norm(look))
    copy, views = gallery.copy(), gallery.views.copy()
    gallery.add(describe([patch(RED, 1)])[0])
    assert (len(copy.views), copy.looks, gallery.looks) == (5, 40, 41)
    np.testing.assert_array_equal(copy.views, views)


def test_a_gallery_is_mapped_again_when_it_or_the_metric_changes() -> None:
    gallery, metric = Gallery(), Metric()
    for colours in (RED, GREEN):
        gallery.add(describe([patch(colours, 1)])[0])
        np.testing.assert_allclose(gallery.mapped(metric), metric.mapped(gallery.views))
    other = Metric(1.0, np.eye(DESCRIPTOR_LENGTH)[:, :7], np.ones(DESCRIPTOR_LENGTH + 7))
    assert gallery.mapped(other).shape == (2, DESCRIPTOR_LENGTH + 7)


def test_without_descriptors_nothing_is_said() -> None:
    look = describe([patch(RED, 1)])
    distance, _ = nearest_views([Gallery(), Gallery()], look, Metric())
    assert distance.tolist() == [[1.0], [1.0]]
    model = AppearanceModel()
    model.learn([], np.zeros((0, DESCRIPTOR_LENGTH)), 0.0)
    model.settle(9.0)
    assert model.compare([Gallery()], look).tolist() == [[0.0]]


def looks_of(person: int, count: int, rng: np.random.Generator) -> FloatArray:
    """Descriptors that differ a little between people, and much by something all people share."""
    look = np.full((count, DESCRIPTOR_LENGTH), 0.05)
    look[:, 10 * person : 10 * person + 5] += 0.05
    look[:, 300:340] += 0.4 * rng.random((count, 4)).repeat(10, axis=1)
    look += 0.01 * rng.random(look.shape)
    return np.asarray(look / np.linalg.norm(look, axis=1, keepdims=True))


def test_a_metric_does_without_what_varies_in_one_person() -> None:
    rng = np.random.default_rng(0)
    people = [looks_of(k, 80, rng) for k in range(4)]
    same = np.concatenate([each[1:] - each[:-1] for each in people]).astype(np.float32)
    other = np.concatenate([a - b for a, b in pairwise(people)])
    taught, inside, between = learned(Metric(), same, other.astype(np.float32))
    assert learned(Metric(), same[:30], other.astype(np.float32)).metric.parts is None

    def right(metric: Metric) -> float:
        """Share of looks whose nearest other look is of the same person."""
        points = metric.mapped(np.concatenate([looks_of(k, 40, rng) for k in range(4)]))
        distance = metric.distances(points, points)
        np.fill_diagonal(distance, np.inf)
        owner = np.arange(160) // 40
        return float((owner[distance.argmin(axis=1)] == owner).mean())

    assert right(taught) > 0.95 > 0.8 > right(Metric())
    assert inside.mean() == pytest.approx(Metric().lengths(same.astype(np.float64)).mean())
    assert np.median(inside) < 0.8 * np.median(between)


def taught(seconds: float) -> tuple[AppearanceModel, list[Gallery]]:
    """A model that has seen four people alone ten times a second."""
    rng = np.random.default_rng(1)
    model, galleries = AppearanceModel(), [Gallery() for _ in range(4)]
    for frame in range(round(10 * seconds)):
        looks = np.concatenate([looks_of(k, 1, rng) for k in range(4)])
        if frame:
            model.learn(galleries, looks, frame / 10)
        for gallery, look in zip(galleries, looks, strict=True):
            gallery.add(look)
        model.settle(frame / 10)
    return model, galleries


def test_a_model_learns_from_people_seen_alone_and_what_it_says_is_bounded() -> None:
    rng = np.random.default_rng(2)
    asked = np.concatenate([looks_of(k, 20, rng) for k in range(4)])
    owner = np.arange(80) // 20
    for seconds, least in ((1.0, 0.0), (12.0, 0.95)):
        model, galleries = taught(seconds)
        odds = model.compare(galleries, asked)
        assert (odds.argmax(axis=0) == owner).mean() >= least
        assert odds.min() >= -12
        assert odds.max() <= 6
    assert np.median(odds[owner, np.arange(80)]) > 1


def test_a_metric_is_learned_after_the_frame_and_every_few_seconds_alone() -> None:
    model, galleries = taught(9.0)
    look, before = galleries[0].views, model.metric
    for frame in range(20):
        model.learn(
            galleries, np.concatenate([each.views[:1] for each in galleries]), 9 + frame / 10
        )
    assert model.metric is before
    model.settle(60.0)
    assert model.metric is not before
    latest = model.metric
    model.settle(60.1)
    assert model.metric is latest
    assert look.shape[1] == DESCRIPTOR_LENGTH
