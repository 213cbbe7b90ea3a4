"""What the follower learns of people and ground, how long it looks for them, and when it calms."""

from __future__ import annotations

import math

import pytest

from heel.services.follower.box_scale import BoxScale
from heel.services.follower.learned_ground import LearnedGround
from heel.services.follower.learned_width import LearnedWidth
from heel.services.follower.own_motion import Pose
from heel.services.follower.pending import PendingPoint
from heel.services.follower.search import all_around, search_for
from heel.services.follower.swing import Swing
from tests.unit.follower.people import WIDTH, person, tracks

# --- A robot that swings to and fro


def _swinging(*ways_s: float, peak_radps: float = 0.6) -> Swing:
    """Turns to one side and the other, each way so long."""
    swing, now_s, side = Swing(), 10.0, 1.0
    swing.told(now_s, side * peak_radps)
    for way_s in ways_s:
        now_s, side = now_s + way_s, -side
        swing.told(now_s, side * peak_radps)
    return swing


def test_turning_to_and_fro_twice_is_swinging_and_turns_are_halved() -> None:
    assert not _swinging(1.0, 1.0, 1.0).swings, "a person may dodge once and back"
    swing = _swinging(1.0, 1.0, 1.0, 1.0)
    assert swing.swings
    assert swing.share == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("way_s", "swings"), [(0.3, False), (0.5, True), (2.2, True), (3.2, False)]
)
def test_a_delay_swings_in_periods_of_one_to_five_seconds(way_s: float, swings: bool) -> None:
    assert _swinging(*[way_s] * 6).swings is swings


@pytest.mark.parametrize(("peak_radps", "swings"), [(0.25, False), (0.35, True)])
def test_slow_turns_to_and_fro_follow_somebody(peak_radps: float, swings: bool) -> None:
    assert _swinging(*[1.0] * 6, peak_radps=peak_radps).swings is swings


@pytest.mark.parametrize(("longer", "swings"), [(1.5, True), (2.2, False)])
def test_a_swing_is_even_and_a_dodging_person_is_not(longer: float, swings: bool) -> None:
    assert _swinging(*[0.6, 0.6 * longer] * 3).swings is swings


def test_a_robot_that_swings_on_turns_ever_more_gently_but_still_turns() -> None:
    assert 0.15 < _swinging(*[1.0] * 40).share < 0.3


def test_within_a_minute_the_robot_turns_briskly_again() -> None:
    swing = _swinging(*[1.0] * 4)
    swing.told(14.0 + 60.0, 0.0)
    assert 0.77 < swing.share < 0.87


# --- The width of a person


def _taught(width_m: float, seconds: float, width: LearnedWidth, first_s: float = 0.0,
            feet: bool = True) -> LearnedWidth:  # fmt: skip
    for frame in range(round(seconds / 0.05)):
        width.learn(width_m, first_s + 0.05 * frame, feet)
    return width


def test_a_width_is_known_after_a_third_of_a_second() -> None:
    assert _taught(0.5, 0.2, LearnedWidth()).width_m is None
    assert _taught(0.5, 0.45, LearnedWidth()).width_m == pytest.approx(0.5)


@pytest.mark.parametrize(("feet", "seconds"), [(True, 4.0), (False, 10.0)])
def test_a_width_follows_over_some_strides_and_more_slowly_without_feet(
    feet: bool, seconds: float
) -> None:
    width = _taught(0.5, 20.0, LearnedWidth())
    _taught(0.8, seconds, width, 20.0, feet)
    assert width.width_m is not None
    assert 0.55 < (width.width_m - 0.5) / 0.3 < 0.72


def test_no_person_is_wider_than_a_metre() -> None:
    assert _taught(3.0, 5.0, LearnedWidth()).width_m == pytest.approx(1.0, abs=0.1)


# --- The ground before the camera


def _ground(slope: float, distance_m: float, frames: int) -> LearnedGround:
    ground = LearnedGround()
    for frame in range(frames):
        ground.learn(slope, distance_m, 0.02, 0.05 * frame)
    return ground


def test_the_ground_is_known_after_a_few_boxes() -> None:
    assert _ground(0.4, 2.0, 4).line is None
    assert _ground(0.4, 2.0, 7).line is not None


def test_before_people_stood_elsewhere_a_level_camera_at_the_usual_height_is_assumed() -> None:
    line = _ground(0.4, 2.0, 7).line
    assert line is not None
    assert line.fall_m == pytest.approx(0.8, abs=0.05)
    assert line.offset == pytest.approx(0.0, abs=0.03)


def test_feet_that_are_lower_than_expected_are_a_higher_camera_or_one_that_looks_up() -> None:
    line = _ground(0.6, 2.0, 7).line
    assert line is not None
    assert line.fall_m == pytest.approx(1.03, abs=0.06)
    assert line.offset == pytest.approx(0.08, abs=0.03)


def test_a_camera_is_never_believed_to_lie_on_the_floor() -> None:
    ground = LearnedGround()
    for frame in range(40):
        distance_m = (1.0, 2.0, 4.0)[frame % 3]
        ground.learn(0.03 / distance_m, distance_m, 0.02, 2.0 * frame)
    assert ground.line is not None
    assert 0.08 < ground.line.fall_m < 0.16


def _walked_about(camera_m: float = 0.6, seconds: float = 30.0) -> LearnedGround:
    """A person has walked about before a level camera, 1 to 4 m away."""
    ground = LearnedGround()
    for frame in range(round(seconds / 0.05)):
        distance_m = (1.0, 1.5, 2.0, 3.0, 4.0)[frame % 5]
        ground.learn(camera_m / distance_m, distance_m, 0.02, 0.05 * frame)
    return ground


@pytest.mark.parametrize(("off", "teaches"), [(0.325, True), (0.35, False)])
def test_a_box_a_third_off_is_of_a_person_that_does_not_stand_upright(
    off: float, teaches: bool
) -> None:
    """Half a minute has taught the ground well enough to tell; before that, more would pass."""
    ground = _walked_about()
    before = ground.line
    ground.learn((1.0 + off) * 0.6 / 2.0, 2.0, 0.02, 30.0)
    assert (ground.line != before) is teaches


def test_a_camera_that_was_moved_is_learned_anew_within_seconds() -> None:
    ground = _walked_about()
    for frame in range(60):
        distance_m = (1.0, 1.5, 2.0, 3.0, 4.0)[frame % 5]
        ground.learn(0.7 / distance_m, distance_m, 0.02, 30.0 + 0.05 * frame)
    assert ground.line is not None
    assert 0.66 < ground.line.fall_m < 0.7


def test_people_in_one_picture_are_as_many_boxes_of_one_frame() -> None:
    def after(dt_s: float) -> float:
        ground = LearnedGround()
        for box in range(6):
            ground.learn(0.6, 2.0, 0.02, dt_s * box)
        assert ground.line is not None
        return ground.line.fall_m

    assert after(0.0) == pytest.approx(after(0.05), abs=0.003)
    assert after(0.0) != pytest.approx(after(0.025), abs=1e-6)


# --- What ranges say of a box


def _scale(told_m: float, measured_m: float, seconds: float) -> BoxScale:
    scale = BoxScale()
    for frame in range(round(seconds / 0.05) + 1):
        scale.learn(told_m, measured_m, 0.05 * frame)
    return scale


def test_a_range_that_nearly_agrees_counts_at_once_and_another_once_it_lasts() -> None:
    """What crosses in front is gone within a second."""
    assert _scale(2.0, 1.75, 0.5).scale < 0.97
    assert _scale(2.0, 1.5, 0.8).scale == 1.0
    assert _scale(2.0, 1.5, 1.4).scale < 0.98


def test_a_scale_is_learned_within_a_second() -> None:
    assert 0.925 < _scale(2.0, 1.8, 1.0).scale < 0.95


@pytest.mark.parametrize(("told_m", "measured_m", "scale"), [(2.0, 0.3, 0.5), (1.0, 1.33, 1.25)])
def test_boxes_mislead_by_half_at_most_and_by_a_quarter_to_the_other_side(
    told_m: float, measured_m: float, scale: float
) -> None:
    assert _scale(told_m, measured_m, 12.0).scale == pytest.approx(scale, abs=0.02)


def test_a_distance_of_nothing_teaches_nothing() -> None:
    assert _scale(0.07, 0.03, 2.0).scale == 1.0
    assert _scale(0.15, 0.1, 2.0).scale < 0.9


def test_a_range_that_agreed_counts_for_a_second() -> None:
    scale = _scale(2.0, 1.9, 0.5)
    assert scale.measured(1.3)
    assert not scale.measured(1.8)


# --- Looking round, and a point that was pointed at


def test_a_heading_is_reached_within_five_degrees() -> None:
    def left_to_turn(heading_rad: float) -> float:
        search = search_for(Pose(), (5.0, 0.0), (5.0, 0.0), 1.0, 0.6)
        return search.bearing_rad(Pose(heading_rad=heading_rad))

    assert left_to_turn(-0.12) == pytest.approx(0.12)
    assert left_to_turn(-0.06) > 0.5, "it looks on to the side"


def test_looking_around_is_one_turn() -> None:
    search = all_around(Pose(heading_rad=1.0))
    assert search.bearing_rad(Pose(heading_rad=1.0)) == pytest.approx(2 * math.pi)
    search.bearing_rad(Pose(heading_rad=1.0 + 2 * math.pi))
    assert search.over


def _pending() -> PendingPoint:
    return PendingPoint(320.0, 300.0, tracks(seq=0), 0.0)


def _appears(heights_aside: float, t_s: float) -> bool:
    """Whether a person whose box begins so far beside the point is the one that was meant."""
    x = 320.0 + 200.0 / 5 + 200.0 * heights_aside
    return _pending().found(tracks(person(1, x, 200.0), seq=1), t_s) is not None


def test_a_person_may_have_walked_a_step_from_the_point_and_no_farther() -> None:
    assert not _appears(0.2, 0.0)
    assert _appears(0.2, 0.5)
    assert not _appears(0.45, 0.5)
    assert not _appears(0.45, 2.0), "a person that appears far from it later is another one"
    assert _appears(0.2, 2.0)


def test_a_point_is_watched_for_as_long_as_users_remember_it() -> None:
    assert 4.0 < _pending().for_s(0.0) < 7.0
    assert _pending().for_s(9.0) == 0.0


def test_a_point_that_leaves_the_picture_is_kept_near_enough_to_come_back() -> None:
    pending = _pending()
    for frame in range(8):
        pending.carry(tracks(seq=frame + 1), 0.5, 500.0)
    assert 2.2 * WIDTH < pending.place_px[0] < 4.5 * WIDTH
    assert math.isfinite(pending.place_px[1])
