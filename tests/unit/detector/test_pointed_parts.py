"""What the parts of the search for one person promise: size and place, ends, colours, doubt."""

from __future__ import annotations

import copy
import math
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.services.detector.pointed.colours import Exposure, StripColours, colour_bins
from heel.services.detector.pointed.distance import Doubt, Stance
from heel.services.detector.pointed.fitting import (
    End,
    Found,
    best_fit,
    clearest,
    elsewhere,
    extent,
    likeness_at,
    share_inside,
)
from heel.services.detector.pointed.person import PointedPerson, Sighting
from heel.services.detector.pointed.silhouette import (
    ASPECT,
    PERSON_PX,
    STRIPS,
    FloatMap,
    Place,
    silhouette,
    view_around,
)
from tests.unit.detector.test_pointed import HEIGHT, overlap, person_box, seen

# --- Where a person of some size stands


@pytest.mark.parametrize(
    ("eyes_m", "share"), [(0.1, 0.25), (0.4, 0.25), (0.8, 0.5), (1.1, 0.62), (1.6, 0.62)]
)
def test_a_robots_camera_is_as_high_as_robots_are(eyes_m: float, share: float) -> None:
    """Of the person, the part below the horizon: between a quarter and two thirds, whatever box
    was given."""
    told = eyes_m / 1.7
    stance = Stance(400, top=200.0 - (1.0 - told) * 100.0, bottom=200.0 + told * 100.0)
    assert stance.height(None, 200.0 + 100.0 * share, before=100.0) == pytest.approx(
        100.0, rel=0.15
    )


def test_the_horizon_follows_where_clothes_lie_over_seconds() -> None:
    stance = Stance(400, top=120.0, bottom=270.0)
    offset_px = 10.0
    centre = stance.centre(150.0) + offset_px
    for _ in range(50):
        stance.correct(centre, 150.0)
    assert 0.5 < (stance.horizon - 200.0) / offset_px < 0.8, "two seconds at 25 frames a second"


def test_the_horizon_of_a_level_camera_stays_near_the_middle() -> None:
    stance = Stance(400, top=120.0, bottom=270.0)
    for _ in range(2000):
        stance.correct(stance.centre(150.0) + 200.0, 150.0)
    assert 0.08 < (stance.horizon - 200.0) / 400.0 < 0.18


# --- Whether another person has stepped in front


def _growing(per_s: float, first: float = 0.5, dt_s: float = 0.05) -> list[bool]:
    doubt = Doubt()
    return [doubt.raised(first * math.exp(per_s * dt_s * step), dt_s) for step in range(40)]


def test_a_person_that_comes_nearer_as_people_do_is_not_doubted() -> None:
    assert not any(_growing(0.25, 0.46)), "walks at 0.6 m/s towards a robot that stands 2.4 m away"
    assert any(_growing(0.5)), "nobody comes that much nearer within a second"


def test_only_what_is_near_enough_to_cross_in_front_is_doubted() -> None:
    def jump(before: float, after: float) -> bool:
        doubt = Doubt()
        for _ in range(20):
            doubt.raised(before, 0.05)
        return doubt.raised(after, 0.05)

    assert not jump(0.3, 0.42), "sizes of people far off are corrected as fast as that"
    assert jump(0.3, 0.6)
    assert not jump(0.6, 0.6)


def test_doubt_lasts_two_seconds_and_then_the_nearer_person_is_believed() -> None:
    doubt = Doubt()
    heights = [0.5] * 20 + [0.8] * 120
    doubted_s = 0.05 * sum([doubt.raised(height, 0.05) for height in heights])
    assert 1.5 < doubted_s < 2.6


def test_as_near_as_before_is_told_within_a_fifth() -> None:
    doubt = Doubt()
    for height in [0.5] * 20 + [0.8]:
        doubt.raised(height, 0.05)
    assert all(doubt.as_before(0.5 * factor) for factor in (0.86, 1.0, 1.16))
    assert not any(doubt.as_before(0.5 * factor) for factor in (0.72, 1.36))


# --- The silhouette


def _width(height: int, down: float) -> float:
    """Of the body at a part from head (0) to foot (1), heights."""
    shape = silhouette(height)
    row = shape.centre[1] + round((down - 0.5) * height)
    return float(shape.cover[row].sum()) / height


def test_the_silhouette_is_that_of_a_walking_person() -> None:
    """Heads are an eighth of the height wide, shoulders and arms a third, legs a quarter."""
    assert _width(200, 0.07) == pytest.approx(0.145, rel=0.2)
    assert _width(200, 0.35) == pytest.approx(0.335, rel=0.15)
    assert _width(200, 0.8) == pytest.approx(0.24, rel=0.15)
    assert _width(200, 0.07) < 0.6 * _width(200, 0.25)
    assert _width(200, -0.1) < 0.05, "nothing above the head"
    assert _width(200, 1.1) < 0.05, "nor below the feet"


def test_the_template_shows_enough_of_what_is_beside_and_no_more() -> None:
    """Half a box to either side and a head's height above and below: what stands out there is no
    part of the body, and what is farther off is somebody else's."""
    shape = silhouette(200)
    assert 1.3 < shape.shape[1] / (0.4 * 200) < 2.2
    assert 0.08 < (shape.centre[1] - 100) / 200 < 0.18
    assert shape.shape[1] / 2 == pytest.approx(shape.centre[0], abs=1)


def test_sides_are_soft_as_arms_and_steps_make_them() -> None:
    shape = silhouette(200)
    row = shape.cover[shape.centre[1] - 30]
    between = np.count_nonzero((row > 0.2) & (row < 0.8)) / 2
    assert 0.05 < between / (0.4 * 200) < 0.3


def test_strips_tell_head_from_shirt_and_shirt_from_trousers() -> None:
    shape = silhouette(200)
    ends = [
        (strip.first_row + strip.weights.shape[0] - shape.centre[1]) / 200 + 0.5
        for strip in shape.strips
    ]
    assert 0.1 < ends[0] < 0.25, "the first is the head"
    assert min(abs(end - 0.5) for end in ends) < 0.02, "one ends at the waist"


def test_views_show_every_person_at_one_size() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    image[100:300] = 255
    view = view_around(image, 320.0, 200.0, 200.0, (134, 112))
    white = np.count_nonzero(view.image[:, 67, 0] > 127)
    assert white == pytest.approx(56, abs=2), "half of the view: as much again is looked at"


# --- Where the silhouette fits

_ROWS, _COLUMNS = 200, 300
_HORIZON = 100.0


def _maps(*bodies: tuple[float, float, int, float]) -> list[FloatMap]:
    """Likeness maps with bodies: column and row of the middle, height, likeness."""
    layer = np.full((_ROWS, _COLUMNS), -0.5, np.float32)
    for column, row, height, likeness in bodies:
        shape = silhouette(height)
        place = Place(round(row) - shape.centre[1], round(column) - shape.centre[0], height)
        part = layer[place.span]
        part[shape.cover > 0.5] = likeness
    return [layer] * STRIPS


def _chosen(aside: float, down: float) -> tuple[float, float]:
    """Middle of the best fit: where the person is expected stands a body somewhat like it (column
    and row 100), so far aside and down one that is just like it."""
    here = (100.0, 100.0, PERSON_PX, 0.1)
    there = (100.0 + aside, 100.0 + down, PERSON_PX, 0.9)
    return best_fit(_maps(here, there), (100.0, 100.0, _HORIZON), 1.0, 1.0).place.middle


def test_evidence_moves_the_person_as_far_as_people_move_between_frames() -> None:
    """Three quarters of a body aside in a frame is a jump that colours can prove; more than one is
    another person."""
    assert _chosen(aside=42.0, down=0.0)[0] == pytest.approx(142.0, abs=3)
    assert _chosen(aside=60.0, down=0.0)[0] == pytest.approx(100.0, abs=3)


def test_a_person_stands_where_one_of_its_size_stands() -> None:
    column, row = _chosen(aside=28.0, down=10.0)
    assert column == pytest.approx(128.0, abs=3)
    assert 103.5 < row < 107.0, "half way between what is seen and what is known"
    assert _chosen(aside=28.0, down=22.0)[0] == pytest.approx(100.0, abs=3)


def test_after_a_time_unseen_the_person_may_have_gone_farther() -> None:
    maps = _maps((100.0, 100.0, PERSON_PX, 0.1), (180.0, 100.0, PERSON_PX, 0.9))
    near = best_fit(maps, (100.0, 100.0, _HORIZON), 1.0, 1.0).place.middle[0]
    far = best_fit(maps, (100.0, 100.0, _HORIZON), 3.0, 3.0).place.middle[0]
    assert (near, far) == (pytest.approx(100, abs=4), pytest.approx(180, abs=4))


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_the_size_follows_by_up_to_a_tenth_in_a_frame(factor: float) -> None:
    maps = _maps((100.0, 100.0, round(factor * PERSON_PX), 0.9))
    fit = best_fit(maps, (100.0, 100.0, _HORIZON), 1.0, 1.0)
    assert fit.place.height / PERSON_PX == pytest.approx(factor, abs=0.05)


def test_a_size_that_is_told_by_little_is_not_believed() -> None:
    maps = _maps((100.0, 100.0, round(1.1 * PERSON_PX), -0.35))
    fit = best_fit(maps, (100.0, 100.0, _HORIZON), 1.0, 1.0)
    assert fit.place.height / PERSON_PX == pytest.approx(1.0, abs=0.06)


def test_likeness_and_visible_share_are_those_of_the_body_alone() -> None:
    maps = _maps((100.0, 100.0, PERSON_PX, 0.9))
    shape = silhouette(PERSON_PX)
    place = Place(100 - shape.centre[1], 100 - shape.centre[0], PERSON_PX)
    assert likeness_at(maps, place) > 0.6
    inside = np.ones((_ROWS, _COLUMNS), np.float32)
    inside[100:] = 0.0
    assert share_inside(inside, place) == pytest.approx(0.5, abs=0.1)


# --- Where the body ends

_TALL = 100
_HIP, _MIDDLE = 120, 150


def _ends(
    body: NDArray[np.float32], first_visible: int = 0, last_visible: int = 300
) -> tuple[End | None, End | None]:
    shape = silhouette(_TALL)
    inside = np.zeros_like(body)
    inside[first_visible:last_visible] = 1.0
    place = Place(_HIP - shape.centre[1], _MIDDLE - shape.centre[0], _TALL)
    return extent([body * inside] * STRIPS, inside, place)


def _body(
    up: float = 0.5, down: float = 0.5, half_px: int = 14, likeness: float = 0.8
) -> NDArray[np.float32]:
    """A body that reaches so many heights up and down from the hip."""
    body = np.full((300, 300), -0.5, np.float32)
    rows = slice(round(_HIP - up * _TALL), round(_HIP + down * _TALL))
    body[rows, _MIDDLE - half_px : _MIDDLE + half_px + 1] = likeness
    return body


def test_head_and_feet_are_where_the_colours_end() -> None:
    for up, down in ((0.5, 0.5), (0.42, 0.6), (0.7, 0.42)):
        head, feet = _ends(_body(up, down))
        assert head is not None
        assert feet is not None
        assert (head.row, head.cut) == (pytest.approx(_HIP - up * _TALL, abs=1.5), False)
        assert (feet.row, feet.cut) == (pytest.approx(_HIP + down * _TALL, abs=1.5), False)


def test_lengths_that_no_body_has_tell_nothing() -> None:
    assert _ends(_body(0.26, 0.26)) == (None, None), "half a body is another thing"
    assert _ends(_body(1.1, 1.1)) == (None, None), "colours go on: a wall of the same"


def test_pixels_somewhat_like_the_person_are_its_body_and_hardly_like_it_are_not() -> None:
    assert None not in _ends(_body(likeness=0.3))
    assert _ends(_body(likeness=0.13)) == (None, None)


def test_a_row_belongs_to_the_body_if_a_tenth_of_the_box_is_filled() -> None:
    assert None not in _ends(_body(half_px=3)), "7 of 40 columns"
    assert _ends(_body(half_px=1)) == (None, None), "3 of 40 columns: noise"


def test_only_what_is_in_the_box_counts() -> None:
    beside = np.full((300, 300), -0.5, np.float32)
    beside[70:170, _MIDDLE + 22 : _MIDDLE + 32] = 0.8
    assert _ends(beside) == (None, None), "another person beside"
    legs = np.full((300, 300), -0.5, np.float32)
    legs[70:170, _MIDDLE + 10 : _MIDDLE + 16] = 0.8
    assert None not in _ends(legs), "a leg in mid-step"


def test_a_belt_is_no_end_but_a_gap_is() -> None:
    for gap_px, feet_at in ((3, _HIP + 0.5 * _TALL), (6, _HIP + 0.4 * _TALL)):
        body = _body(0.5, 0.5)
        body[_HIP + 40 : _HIP + 40 + gap_px] = -0.5
        _, feet = _ends(body)
        assert feet is not None
        assert feet.row == pytest.approx(feet_at, abs=1.5)


def test_a_body_that_the_border_cuts_off_is_told_as_cut() -> None:
    head, _ = _ends(_body(0.5, 0.5), first_visible=_HIP - 26)
    assert head is not None
    assert head.cut
    assert head.row == pytest.approx(_HIP - 26, abs=2)
    assert _ends(_body(0.5, 0.5), first_visible=_HIP - 14)[0] is None, "too little to tell"
    assert _ends(_body(0.1, 0.5), first_visible=_HIP - 40)[0] is None, "nothing reaches there"


def test_feet_stand_a_little_way_into_the_shadow_on_the_floor() -> None:
    body = _body(0.5, 0.75)
    body[_HIP + 44 :, _MIDDLE - 36 : _MIDDLE + 37] = 0.8
    _, feet = _ends(body)
    assert feet is not None
    assert feet.row == pytest.approx(_HIP + 44 + 6, abs=2)


def test_arms_and_bags_about_the_hips_are_no_shadow() -> None:
    body = _body(0.5, 0.5)
    body[_HIP + 18 : _HIP + 26, _MIDDLE - 36 : _MIDDLE + 37] = 0.8
    _, feet = _ends(body)
    assert feet is not None
    assert feet.row == pytest.approx(_HIP + 50, abs=2)


# --- Which place it is


def _found(score: float, x: float, likeness: float = 0.8) -> Found:
    return Found(score, likeness, x, 100.0)


def test_the_person_is_found_only_where_no_other_place_is_nearly_as_like() -> None:
    assert clearest([_found(1.0, 50.0), _found(0.8, 300.0)], 0.5) == _found(1.0, 50.0)
    assert clearest([_found(1.0, 50.0), _found(0.9, 300.0)], 0.5) is None
    assert clearest([_found(1.0, 50.0), _found(0.95, 90.0)], 0.5) == _found(1.0, 50.0), "one place"
    assert clearest([_found(1.0, 50.0, likeness=0.4)], 0.5) is None
    assert clearest([], 0.5) is None


def test_people_side_by_side_are_two_places() -> None:
    assert not elsewhere(_found(1.0, 45.0), 0.0, 100.0)
    assert elsewhere(_found(1.0, 80.0), 0.0, 100.0)


# --- Colours


def _painted(*colours: tuple[int, int, int]) -> NDArray[np.int32]:
    """Bins of a picture of 60 rows, in equal columns of these colours."""
    wide = np.repeat(np.array([colours], np.uint8), 40, axis=1)
    return colour_bins(np.repeat(wide, 60, axis=0))


_RED, _BLUE, _GREEN = (40, 40, 200), (200, 60, 40), (60, 180, 60)
_SPANS = [slice(10 * strip, 10 * strip + 10) for strip in range(STRIPS)]


def _cover(columns: int, body: slice) -> FloatMap:
    cover = np.zeros((60, columns), np.float32)
    cover[:, body] = 1.0
    return cover


def _likeness(colours: StripColours, bins: NDArray[np.int32], column: int) -> float:
    return float(np.mean([layer[:, column].mean() for layer in colours.likeness(bins)]))


def test_colours_of_the_person_are_told_from_those_beside_it() -> None:
    colours, bins = StripColours(), _painted(_RED, _GREEN)
    colours.learn(bins, _cover(80, slice(0, 40)), _SPANS, 1.0, 1.0)
    colours.keep()
    assert _likeness(colours, bins, 20) > 0.9
    assert _likeness(colours, bins, 60) < -0.9
    assert abs(_likeness(colours, _painted(_BLUE), 20)) < 0.2, "a colour that neither has"


def test_neighbouring_shades_are_alike_and_other_colours_are_not() -> None:
    """Cloth is never one shade: folds and noise move it by one bin, seldom by three."""
    colours, bins = StripColours(), _painted((100, 100, 130), _GREEN)
    colours.learn(bins, _cover(80, slice(0, 40)), _SPANS, 1.0, 1.0)
    colours.keep()
    alike = [(100, 100, 130), (104, 104, 134), (100, 104, 132)]
    assert min(_likeness(colours, _painted(one), 20) for one in alike) > 0.8
    others = [(100, 125, 130), (100, 100, 165), (180, 180, 205)]
    assert max(_likeness(colours, _painted(one), 20) for one in others) < 0.3


def test_what_is_learned_of_a_person_starts_from_how_it_looked_at_first() -> None:
    colours = StripColours()
    cover = _cover(80, slice(0, 40))
    colours.learn(_painted(_RED, _GREEN), cover, _SPANS, 1.0, 1.0)
    colours.keep()
    for _ in range(200):
        colours.learn(_painted(_BLUE, _GREEN), cover, _SPANS, 0.02, 0.2)
    assert _likeness(colours, _painted(_BLUE), 20) > 0.8
    assert _likeness(colours, _painted(_RED), 20) > 0.8, "the first look is kept for good"


def test_pixels_half_covered_are_neither_the_persons_nor_the_backgrounds() -> None:
    colours, bins = StripColours(), _painted(_RED, _BLUE, _GREEN)
    cover = _cover(120, slice(0, 40))
    cover[:, 40:80] = 0.45
    colours.learn(bins, cover, _SPANS, 1.0, 1.0)
    colours.keep()
    assert abs(_likeness(colours, bins, 60)) < 0.2


def test_edges_of_the_body_are_counted_by_how_much_of_them_is_covered() -> None:
    for share, known in ((0.75, True), (0.08, False), (0.15, None)):
        colours, bins = StripColours(), _painted(_RED, _BLUE, _GREEN)
        cover = _cover(120, slice(0, 40))
        cover[:, 40:80] = share
        colours.learn(bins, cover, _SPANS, 1.0, 1.0)
        colours.keep()
        likeness = _likeness(colours, bins, 60)
        told = True if likeness > 0.5 else False if likeness < -0.5 else None
        assert told is known


def test_a_few_pixels_teach_nothing() -> None:
    for pixels, known in ((6, True), (3, False)):
        colours, cover = StripColours(), _cover(80, slice(0, 40))
        colours.learn(_painted(_RED, _GREEN), cover, _SPANS, 1.0, 1.0)
        sliver = np.full((60, 80), np.nan, np.float32)
        for span in _SPANS:
            sliver[span.start : span.start + pixels, 0] = 1.0
        colours.learn(_painted(_BLUE, _GREEN), sliver, _SPANS, 1.0, 0.0)
        colours.keep()
        assert (_likeness(colours, _painted(_BLUE), 20) > 0.5) is known


def test_a_colour_of_one_in_fifty_pixels_is_half_believed() -> None:
    """A logo is no clothing: histograms of small parts are mostly chance."""
    bins = _painted(_RED, _GREEN)
    bins[:, :40].reshape(60, 40)[:, 7] = np.where(
        np.arange(60) % 5 < 4, _painted(_BLUE)[0, 0], bins[0, 0]
    )
    colours = StripColours()
    colours.learn(bins, _cover(80, slice(0, 40)), _SPANS, 1.0, 1.0)
    colours.keep()
    assert 0.52 < _likeness(colours, _painted(_BLUE), 20) < 0.7


def _lab(light: int, a: int, b: int) -> tuple[int, int, int]:
    """BGR of a Lab colour, all of 8 bits."""
    blue, green, red = cv2.cvtColor(np.array([[[light, a, b]]], np.uint8), cv2.COLOR_LAB2BGR)[0, 0]
    return int(blue), int(green), int(red)


def test_hues_a_few_units_apart_are_alike_and_ten_units_apart_are_not() -> None:
    colours, bins = StripColours(), _painted(_lab(110, 130, 128), _GREEN)
    colours.learn(bins, _cover(80, slice(0, 40)), _SPANS, 1.0, 1.0)
    colours.keep()
    assert _likeness(colours, _painted(_lab(110, 135, 128)), 20) > 0.5
    assert _likeness(colours, _painted(_lab(110, 141, 128)), 20) < 0.3


# --- Light


def _picture(level: float, changed: float = 0.0) -> NDArray[np.uint8]:
    """A picture of so many grey levels on average, a part of it replaced by something else."""
    rng = np.random.default_rng(5)
    image = rng.uniform(0.6, 1.4, (120, 160, 1)).repeat(3, axis=2)
    image[: round(120 * changed)] = 1.9 - image[: round(120 * changed)]
    return np.clip(level * image, 0, 255).astype(np.uint8)


def _levelled(*levels: float, dt_s: float = 0.05) -> float:
    exposure = Exposure()
    shown = [exposure.level(_picture(level), dt_s) for level in levels]
    return float(shown[-1].mean()) / float(_picture(levels[0]).mean())


def test_light_that_changes_at_once_is_taken_out_up_to_a_factor_of_three() -> None:
    assert _levelled(60.0, 150.0) == pytest.approx(1.0, abs=0.06)
    assert _levelled(150.0, 60.0) == pytest.approx(1.0, abs=0.06)
    assert _levelled(160.0, 32.0) == pytest.approx(3 * 32 / 160, abs=0.08), "too dark to bring back"


def test_a_small_change_of_light_is_not_worth_a_new_picture() -> None:
    exposure = Exposure()
    exposure.level(_picture(100.0), 0.05)
    image = _picture(101.2)
    assert exposure.level(image, 0.05) is image
    image = _picture(104.5)
    assert exposure.level(image, 0.05) is not image


def test_a_change_of_light_is_forgotten_over_tens_of_seconds() -> None:
    def after(seconds: float) -> float:
        exposure = Exposure()
        exposure.level(_picture(80.0), 0.0)
        exposure.level(_picture(160.0), 0.0)
        shown = exposure.level(_picture(160.0), seconds)
        return math.log(float(shown.mean()) / 80.0) / math.log(2.0)

    assert after(1.0) < 0.15
    assert 0.5 < after(10.0) < 0.75


def test_pictures_that_are_black_or_white_say_nothing_of_the_light() -> None:
    for before, after, told in ((6, 7, False), (253, 240, False), (12, 24, True), (240, 120, True)):
        exposure = Exposure()
        exposure.level(np.full((120, 160, 3), before, np.uint8), 0.05)
        image = np.full((120, 160, 3), after, np.uint8)
        assert (exposure.level(image, 0.05) is not image) is told


def test_a_quarter_of_the_picture_suffices_to_tell_the_light_and_a_tenth_does_not() -> None:
    for share, told in ((0.28, True), (0.14, False)):
        exposure = Exposure()
        rows = round(120 * share)
        before, after = np.zeros((120, 160, 3), np.uint8), np.zeros((120, 160, 3), np.uint8)
        before[:rows], after[:rows] = 80, 160
        exposure.level(before, 0.0)
        assert (exposure.level(after, 0.0) is not after) is told


def test_box_and_template_have_the_same_proportions() -> None:
    shoulders = _width(200, 0.35)
    assert 0.75 < shoulders / ASPECT < 0.95, "shoulders and arms fill the box"


# --- The person as a whole: found again, and where

_STILL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@cache
def _in_sight(height: float) -> PointedPerson:
    """A person in the middle that has been in sight for a second."""
    person = PointedPerson(person_box(240.0, height), HEIGHT)
    for _ in range(20):
        assert person.look(seen(240.0, height), _STILL, 0.05) is not None
    return person


@cache
def _lost(height: float) -> PointedPerson:
    person = copy.deepcopy(_in_sight(height))
    for _ in range(12):
        person.look(seen(None), _STILL, 0.05)
    assert person.missed_s > 0.5
    return person


def _known(height: float = 150.0) -> PointedPerson:
    """A person that was in sight for a second, and then out of it for more than half of one."""
    return copy.deepcopy(_lost(height))


@pytest.mark.parametrize(("x", "height"), [(130.0, 75.0), (350.0, 240.0), (20.0, 150.0)])
def test_after_a_time_out_of_sight_it_is_found_at_half_the_size_and_more_than_once_the_size(
    x: float, height: float
) -> None:
    sighting = _known().look(seen(x, height), _STILL, 0.05)
    assert sighting is not None
    assert overlap(sighting.box_xyxy, person_box(x, height)) > 0.6
    assert 0.85 < (sighting.box_xyxy[3] - sighting.box_xyxy[1]) / height < 1.15


def test_smaller_than_a_twelfth_of_the_picture_no_person_is_looked_for() -> None:
    person = _known(height=60.0)
    picture = seen(130.0, 24.0)
    assert not any(person.look(picture, _STILL, 0.05) for _ in range(3))


def test_a_person_half_out_of_the_picture_is_found_and_a_third_of_one_is_not() -> None:
    assert _known().look(seen(468.0), _STILL, 0.05) is not None
    assert _known().look(seen(495.0), _STILL, 0.05) is None


def test_a_pause_of_the_pictures_is_a_time_out_of_sight() -> None:
    def moved_after(pause_s: float) -> Sighting | None:
        return copy.deepcopy(_in_sight(150.0)).look(seen(60.0), _STILL, pause_s)

    assert moved_after(0.05) is None, "nobody jumps across the picture in a frame"
    assert moved_after(0.2) is None
    assert moved_after(0.5) is not None, "in the time without pictures people walk"
