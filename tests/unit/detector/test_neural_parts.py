"""Views, turns, budget, pixels in between: the parts of the detector that runs a network."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.services.detector.neural.between import Between, SeenPerson
from heel.services.detector.neural.views import (
    Attention,
    Expected,
    View,
    Views,
    look,
    together,
    usual_looks,
)
from heel.services.geometry.patch_flow import followed
from heel.services.networks.budget import Budget, Looks
from heel.services.networks.person_model import Detections

FRAME, INPUT = (960, 540), (416, 416)
STILL = np.eye(2, 3)


def person(x: float, y: float, height: float) -> tuple[float, float, float, float]:
    return (x - 0.2 * height, y - height / 2, x + 0.2 * height, y + height / 2)


# At 104 pixels of the input, but enlarged by no more than 1.5.
@pytest.mark.parametrize(("height", "side"), [(80, 320), (20, 277)])
@pytest.mark.parametrize("place", [(480, 270), (5, 5), (955, 535)])
def test_a_view_lies_in_the_frame_and_holds_the_person_it_is_for(
    place: tuple[int, int], height: float, side: int
) -> None:
    box = person(*place, height=height)
    view = Views(FRAME, INPUT).around(box)
    assert view is not None
    assert (view.width, view.height) == (side, side)
    assert 0 <= view.left <= FRAME[0] - view.width
    assert 0 <= view.top <= FRAME[1] - view.height
    assert view.left <= place[0] <= view.left + view.width


def test_large_people_need_no_closer_look() -> None:
    views = Views(FRAME, INPUT)
    assert views.around(person(480, 270, 250)) is None
    assert Views((320, 240), INPUT).tiles == ()


@pytest.mark.parametrize("side", [192, 416])
def test_a_person_who_fills_the_picture_is_looked_at_with_grey_around(side: int) -> None:
    rows, columns = 480, 640
    box = person(320, 250, 440)
    view = Views((columns, rows), (side, side)).around(box)
    assert view is not None
    assert view.holds((0, 0, columns, rows))
    assert view.width == view.height
    assert 440 * side / view.height == pytest.approx(min(104, side / 2), abs=1)
    shown: list[NDArray[np.uint8]] = []

    class Network:
        def detect(self, pixels: NDArray[np.uint8], least_score: float) -> Detections:
            shown.append(pixels)
            top, left = -view.top, -view.left  # one whom it takes to reach below the frame
            return found((left + 200, top + 30, left + 440, top + rows + 25, 0.8))

    image = np.full((rows, columns, 3), 7, np.uint8)
    seen = look(Network(), image, 0.3, view)  # type: ignore[arg-type]
    assert shown[0].shape == (view.height, view.width, 3)
    grey = (shown[0] == 114).all(axis=2)
    assert grey.sum() == view.width * view.height - rows * columns
    assert seen.boxes.tolist() == [[200, 30, 440, rows]]


def test_where_the_frame_shows_a_person_well_it_says_where_they_are() -> None:
    whole, wide = View(0, 0, 640, 480), View(-100, -180, 840, 840)
    both = together(found((202, 30, 436, 478, 0.7)), found((195, 20, 450, 480, 0.5)), whole)
    assert wide.reaches_beyond
    assert not whole.reaches_beyond
    np.testing.assert_allclose(both.boxes, [[195, 20, 450, 480]])
    np.testing.assert_allclose(both.scores, [0.7])


def test_tiles_cover_the_frame_and_overlap() -> None:
    covered = np.zeros(FRAME[::-1], int)
    for tile in Views(FRAME, INPUT).tiles:
        covered[tile.top : tile.top + tile.height, tile.left : tile.left + tile.width] += 1
    assert covered.min() == 1
    assert covered.max() > 1


def test_everybody_has_a_turn_and_the_frame_is_searched_besides() -> None:
    views = Views(FRAME, INPUT)
    attention = Attention(views, most=1)
    people = [Expected(person(x, 270, 80), x) for x in (100, 400, 700)]
    chosen = [view for _ in range(16) for view in attention.next_views(people)]
    assert len(chosen) == 16
    for one in people:
        assert sum(view.holds(one.box_xyxy) and view.width == 320 for view in chosen) >= 4
    assert 1 <= sum(view in views.tiles for view in chosen) <= 3


def test_two_who_stand_together_share_a_view() -> None:
    attention = Attention(Views((360, 240), INPUT), most=2)
    beside = [Expected(person(100, 100, 40), 1), Expected(person(125, 100, 40), 2)]
    assert len(attention.next_views(beside)) == 1
    apart = [Expected(person(60, 100, 40), 1), Expected(person(300, 100, 40), 2)]
    assert len(attention.next_views(apart)) == 2


def test_of_two_networks_the_smaller_looks_at_all_but_small_people() -> None:
    attention = Attention(Views(FRAME, INPUT), 2, (Views(FRAME, (192, 192), near=True), 8))
    small = [Expected(person(x, 100, 40), x) for x in (100, 400, 700)]
    middling = [Expected(person(x, 400, 70), x) for x in (101, 401, 701)]
    for _ in range(7):
        views = attention.next_views([*small, *middling])
        assert sum(not view.near for view in views) == 2
        for one in middling:
            assert any(view.near and view.holds(one.box_xyxy) for view in views)


def test_nobody_expected_in_a_large_frame_is_searched_for_tile_by_tile() -> None:
    views = Views(FRAME, INPUT)
    attention = Attention(views, most=2)
    seen = {view for _ in views.tiles for view in attention.next_views([])}
    assert seen == set(views.tiles)


def test_with_people_known_the_frame_is_searched_now_and_then_even_if_there_is_time() -> None:
    views = Views(FRAME, INPUT)
    attention = Attention(views, most=2)
    large = [Expected(person(400, 300, 200), 1)]
    chosen = [attention.next_views(large) for _ in range(32)]
    assert sum(map(len, chosen)) == 4


@pytest.mark.parametrize(("side", "looks"), [(640, 1), (416, 2), (320, 3), (192, 8), (64, 8)])
def test_a_small_network_looks_closer_more_often(side: int, looks: int) -> None:
    assert usual_looks((side, side)) == looks
    assert usual_looks((side, side), beside_another=True) == min(looks, 3)


def found(*boxes: tuple[float, float, float, float, float]) -> Detections:
    table = np.array(boxes, np.float32).reshape(-1, 5)
    return Detections(table[:, :4], table[:, 4])


PART = View(100, 100, 100, 100)


@pytest.mark.parametrize(
    ("whole", "close", "kept"),
    [
        # Upper half in the whole frame, all of them in the closer look: the latter, best score.
        ([(140, 120, 160, 148, 0.8)], [(140, 120, 160, 170, 0.6)], [(140, 120, 160, 170, 0.8)]),
        # A piece of somebody who reaches beyond the part is nobody else.
        ([(90, 90, 210, 300, 0.8)], [(120, 120, 150, 180, 0.9)], [(90, 90, 210, 300, 0.8)]),
        # Missed in either look: the other counts.
        ([(300, 0, 320, 50, 0.5)], [(140, 120, 160, 170, 0.6)],
         [(140, 120, 160, 170, 0.6), (300, 0, 320, 50, 0.5)]),
        ([], [], []),
    ],
)  # fmt: skip
def test_two_looks_give_everybody_once(whole: Any, close: Any, kept: Any) -> None:
    both = together(found(*whole), found(*close), PART)
    rows = [
        (*box, pytest.approx(score)) for box, score in zip(both.boxes, both.scores, strict=True)
    ]
    assert [tuple(row) for row in rows] == [tuple(row) for row in kept]


def played(budget_ms: float, whole_ms: float, part_ms: float, frames: int = 400) -> list[Looks]:
    budget = Budget(budget_ms)
    looks = []
    for _ in range(frames):
        chosen = budget.choose(parts_wanted=1)
        budget.spent(whole_ms if chosen.whole else None, [part_ms] * chosen.parts)
        looks.append(chosen)
    return looks


@pytest.mark.parametrize("budget_ms", [3.0, 8.0, 20.0, 30.0, 60.0])
@pytest.mark.parametrize("part_ms", [7.0, 25.0])
def test_the_mean_time_stays_within_the_budget(budget_ms: float, part_ms: float) -> None:
    looks = played(budget_ms, 25.0, part_ms)
    spent = sum(25.0 * look.whole + part_ms * look.parts for look in looks)
    # The first whole frame is taken before anything is known of its cost.
    assert spent <= budget_ms * len(looks) + 25.0
    assert spent >= 0.6 * min(budget_ms, 25.0 + part_ms) * len(looks)


def test_whole_frames_come_first_then_parts() -> None:
    assert all(look == Looks(True, 1) for look in played(60.0, 25.0, 25.0)[1:])
    assert all(look.whole for look in played(30.0, 25.0, 25.0))
    scarce = played(12.0, 25.0, 7.0)
    gaps = np.diff(np.flatnonzero([look.whole for look in scarce]))
    assert gaps.max() <= 12
    assert sum(look.parts for look in scarce) > 0.5 * len(scarce)


def test_a_whole_frame_that_is_not_due_leaves_its_time_to_the_parts() -> None:
    budget = Budget(30.0)
    budget.spent(25.0, [])
    assert budget.choose(2, whole_due=False) == Looks(False, 0)
    for _ in range(3):
        budget.spent(None, [2.0] * budget.choose(2, whole_due=False).parts)
    assert budget.choose(2, whole_due=False) == Looks(False, 2)
    assert budget.choose(2).whole
    assert Budget(0.0).choose(2, whole_due=False) == Looks(False, 2)


def test_without_a_bound_everything_is_looked_at_whatever_it_takes() -> None:
    budget = Budget(0.0)
    for _ in range(5):
        assert budget.choose(2) == Looks(True, 2)
        budget.spent(1e6, [1e6, 1e6])


def scene(shift: float = 0.0, at: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """A textured wall that has moved to the left, and somebody before it."""
    coarse = np.random.default_rng(3).integers(60, 120, (40, 80)).astype(np.uint8)
    wall = cv2.resize(coarse, (640, 320), interpolation=cv2.INTER_CUBIC)
    seen = cv2.warpAffine(wall, np.array([[1, 0, -shift], [0, 1, 0.0]]), (320, 240))
    if at is not None:
        clothes = np.random.default_rng(4).integers(0, 2, (16, 6)).astype(np.uint8) * 200 + 40
        left, top = at
        seen[top : top + 80, left : left + 30] = cv2.resize(
            clothes, (30, 80), interpolation=cv2.INTER_CUBIC
        )
    return np.asarray(seen, np.uint8)


def box(left: float, top: float) -> tuple[float, float, float, float]:
    return (left, top, left + 30.0, top + 80.0)


@pytest.mark.parametrize("step", [(0, 0), (5, 2), (-8, 3)])
def test_a_box_goes_where_its_pixels_go(step: tuple[int, int]) -> None:
    new = followed(
        scene(at=(100, 60)), scene(at=(100 + step[0], 60 + step[1])), box(100, 60), STILL
    )
    assert new == pytest.approx(box(100 + step[0], 60 + step[1]), abs=1.5)


def test_a_jerk_of_the_camera_is_where_the_search_begins() -> None:
    jerk = np.array([[1.0, 0.0, -60.0], [0.0, 1.0, 0.0]])
    new = followed(scene(at=(150, 60)), scene(60.0, at=(90, 60)), box(150, 60), jerk)
    assert new == pytest.approx(box(90, 60), abs=1.5)


def carry(pictures: list[NDArray[np.uint8]], confirmed: bool = True) -> list[list[SeenPerson]]:
    """Who is carried in each frame after the first, in which somebody is seen at (100, 60)."""
    between = Between(longest_s=0.5)
    between.update(pictures[0], 0, [SeenPerson(box(100, 60), 0.8)], [], STILL)
    expected = [box(100, 60)] if confirmed else []
    return [
        between.update(image, seq * 10**8, [], expected, STILL)
        for seq, image in enumerate(pictures[1:], 1)
    ]


def test_who_is_missed_is_carried_for_a_bounded_time_with_falling_score() -> None:
    carried = carry([scene(at=(100 + seq, 60)) for seq in range(8)])
    scores = [people[0].score for people in carried if people]
    assert len(scores) == 4
    assert scores == pytest.approx([0.64, 0.48, 0.32, 0.16], abs=0.01)
    assert carried[3][0].box_xyxy == pytest.approx(box(104, 60), abs=2.5)


def filling(seconds: int, at: tuple[int, int] | None, longest_s: float = 0.5) -> list[SeenPerson]:
    """Who is carried after so long, of somebody higher than the picture; `at`: where they are then.

    Once a second they are missed again.
    """
    before, now = scene(at=(100, 60))[62:138], scene(at=at)[62:138]
    whole = (100.0, -2.0, 130.0, 78.0)
    between = Between(longest_s)
    between.update(before, 0, [SeenPerson(whole, 0.8)], [], STILL)
    for second in range(1, seconds):
        between.update(before, second * 10**9, [], [whole], STILL)
    return between.update(now, seconds * 10**9, [], [whole], STILL)


def test_who_fills_the_picture_is_carried_for_longer() -> None:
    [carried] = filling(10, at=(100, 60))
    assert carried.box_xyxy == pytest.approx((100, -2, 130, 78), abs=2.5)
    assert carried.score == pytest.approx(0.8 * 20 / 30, abs=0.01)
    assert filling(30, at=(100, 60)) == [], "not for ever"
    assert filling(10, at=(100, 60), longest_s=0.0) == [], "not if pixels carry nobody at all"


def test_who_filled_the_picture_is_carried_no_more_once_gone() -> None:
    assert filling(10, at=None) == []


def test_nobody_is_carried_without_an_identity() -> None:
    assert not any(carry([scene(at=(100, 60))] * 4, confirmed=False))


def test_nobody_is_carried_who_is_not_to_be_seen_any_more() -> None:
    assert not any(carry([scene(at=(100, 60)), *[scene()] * 4]))


def test_who_is_seen_is_not_carried_besides() -> None:
    between = Between(longest_s=0.5)
    between.update(scene(at=(100, 60)), 0, [SeenPerson(box(100, 60), 0.8)], [], STILL)
    again = [SeenPerson(box(103, 60), 0.7)]
    now = scene(at=(103, 60))
    assert between.update(now, 10**8, again, [box(103, 60)], STILL) == []
    assert list(between.people) == again
