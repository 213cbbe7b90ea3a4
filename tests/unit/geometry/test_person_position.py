"""Where a person stands, by what is seen of the box."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heel.services.geometry.camera import GroundCamera, Pinhole
from heel.services.geometry.person import PersonModel, locate_person

LEVEL = Pinhole.from_fov(640, 480, math.pi / 2)
MOUNTED = LEVEL.mounted(0.8, 0.0)


def box_at(
    camera: GroundCamera, x: float, y: float = 0.0, height_m: float = 1.7
) -> tuple[float, ...]:
    """The box of a person, cut at the picture's borders as a detector's would be."""
    left, top, right, bottom = camera.person_boxes([x, y], height_m).tolist()
    return max(left, 0.0), max(top, 0.0), min(right, 640.0), min(bottom, 480.0)


@pytest.mark.parametrize(
    ("mounting", "x", "evidence"),
    [
        ((0.8, 0.0), 3.0, "feet and head"),
        ((0.8, 0.0), 1.15, "feet"),
        ((0.8, -0.3), 1.5, "head"),
        ((3.2, 0.35), 6.0, "feet and head"),
        ((0.8, 0.0), 15.0, "feet and head"),
    ],
)
def test_what_is_seen_of_a_person_of_assumed_height_tells_the_place(
    mounting: tuple[float, float], x: float, evidence: str
) -> None:
    camera = LEVEL.mounted(*mounting)
    seen = locate_person(box_at(camera, x, 0.2 * x), camera)
    assert seen is not None
    assert seen.evidence == evidence
    assert seen.distance_m == pytest.approx(math.hypot(x, 0.2 * x), rel=0.02)
    assert seen.bearing_rad == pytest.approx(math.atan(0.2), abs=0.01)


@pytest.mark.parametrize("x", [1.0, 0.7, 0.4])
@pytest.mark.parametrize("camera", [MOUNTED, LEVEL], ids=["mounted", "unknown mounting"])
def test_who_is_cut_off_at_both_ends_is_too_near(camera: Pinhole, x: float) -> None:
    seen = locate_person(box_at(MOUNTED, x), camera)
    assert seen is not None
    assert seen.evidence == "bound"
    assert seen.distance_m < 0.6
    assert x <= 2 * seen.distance_m * 1.1
    assert seen.distance_sigma_m > 0.2


@pytest.mark.parametrize(
    "box",
    [
        pytest.param((217.0, 0.0, 383.0, 310.0), id="head cut off: the lower edge is no feet"),
        pytest.param((217.0, 150.0, 383.0, 480.0), id="feet cut off: the upper edge is no head"),
    ],
)
def test_half_a_person_is_not_far_away(box: tuple[float, ...]) -> None:
    seen = locate_person(box, MOUNTED)
    assert seen is not None
    assert seen.evidence == "bound"
    assert 2 * seen.distance_m < 1.7


def test_tall_people_are_still_located_by_their_feet() -> None:
    seen = locate_person(box_at(MOUNTED, 1.55, height_m=1.99), MOUNTED)
    assert seen is not None
    assert seen.evidence == "feet"
    assert seen.distance_m == pytest.approx(1.55, abs=0.05)


def test_without_mounting_only_the_apparent_height_counts() -> None:
    seen = locate_person(box_at(MOUNTED, 4.0), LEVEL)
    assert seen is not None
    assert seen.evidence == "height"
    assert seen.distance_m == pytest.approx(4.0, rel=1e-6)
    cut = locate_person(box_at(MOUNTED, 1.15), LEVEL)
    assert cut is not None
    assert cut.evidence == "cut height"
    assert cut.distance_m <= 1.15
    assert cut.distance_sigma_m > 0.25 * cut.distance_m
    assert not cut.certain


def test_feet_on_the_ground_correct_a_wrong_height() -> None:
    child = box_at(MOUNTED, 2.0, height_m=1.3)
    by_height, by_both = locate_person(child, LEVEL), locate_person(child, MOUNTED)
    assert by_height is not None
    assert by_both is not None
    assert by_height.distance_m == pytest.approx(2.0 * 1.7 / 1.3, rel=1e-6)
    assert abs(by_both.distance_m - 2.0) < 0.5 * abs(by_height.distance_m - 2.0)


def test_height_corrects_a_robot_that_rocks() -> None:
    nodding = LEVEL.mounted(0.8, 0.03)
    seen = locate_person(box_at(nodding, 6.0), MOUNTED)
    feet_alone = float(np.hypot(*MOUNTED.ground(nodding.pixels([6.0, 0.0, 0.0]))))
    assert seen is not None
    assert abs(seen.distance_m - 6.0) < 0.6 * abs(feet_alone - 6.0)


def test_uncertainty_grows_with_distance_and_with_what_is_cut_off() -> None:
    sigmas = [locate_person(box_at(MOUNTED, x), MOUNTED) for x in (2.0, 4.0, 8.0)]
    values = [one.distance_sigma_m for one in sigmas if one is not None]
    assert values == sorted(values)
    whole = locate_person((300.0, 100.0, 340.0, 300.0), MOUNTED)
    cut_aside = locate_person((0.0, 100.0, 40.0, 300.0), MOUNTED)
    assert whole is not None
    assert cut_aside is not None
    assert cut_aside.bearing_sigma_rad > 2 * whole.bearing_sigma_rad


def test_stated_uncertainty_covers_people_and_boxes_as_assumed() -> None:
    """Heights, edges and pitch drawn as the model says: errors are as large as stated."""
    model, random = PersonModel(), np.random.default_rng(7)
    ratios = []
    for _ in range(400):
        x, nod = random.uniform(2, 8), random.normal(0, model.pitch_sigma_rad)
        box = np.array(box_at(LEVEL.mounted(0.8, nod), x, 0.0, random.normal(1.7, 0.1)))
        sigma_px = model.edge_sigma_px + model.edge_sigma_share * (box[3] - box[1])
        seen = locate_person(box + random.normal(0, sigma_px, 4), MOUNTED, model)
        assert seen is not None
        ratios.append((seen.distance_m - x) / seen.distance_sigma_m)
    assert 0.8 < float(np.std(ratios)) < 1.25
    assert abs(float(np.mean(ratios))) < 0.3


@pytest.mark.parametrize(
    "box",
    [
        (300.0, 100.0, 340.0, 100.0),
        (340.0, 100.0, 300.0, 300.0),
        (300.0, math.nan, 340.0, 300.0),
        (700.0, 100.0, 740.0, 300.0),
        (300.0, -300.0, 340.0, -100.0),
        (300.0, 10.0, 340.0, 60.0),
    ],
    ids=["flat", "inside out", "NaN", "beside", "above", "hovering over the horizon"],
)
def test_boxes_that_nobody_on_the_ground_can_have_give_no_place(box: tuple[float, ...]) -> None:
    assert locate_person(box, MOUNTED) is None


_EDGE = st.floats(-1e9, 1e9)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(box=st.tuples(_EDGE, _EDGE, _EDGE, _EDGE) | st.tuples(*[st.floats(-10, 650)] * 4),
       height=st.floats(0.05, 10), pitch=st.floats(-1.5, 1.5), known=st.booleans())  # fmt: skip
def test_any_box_gives_a_finite_place_or_none(
    box: tuple[float, ...], height: float, pitch: float, known: bool
) -> None:
    seen = locate_person(box, LEVEL.mounted(height, pitch) if known else LEVEL)
    if seen is not None:
        for value in (seen.distance_m, seen.distance_sigma_m, seen.bearing_sigma_rad):
            assert 0 <= value < math.inf
        assert abs(seen.bearing_rad) <= math.pi
