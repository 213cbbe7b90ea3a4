"""Whom a user means: one click is a choice, and what cannot be chosen from is said to be so."""

from __future__ import annotations

import logging
import math
import os
import time
from pathlib import Path
from typing import Any

import pytest

from heel.schemas import CameraMotion, Odometry, TargetRequest, Track, Tracks
from heel.schemas.follow import TargetMode
from heel.services.follower.core import Follower
from heel.services.follower.kept import KeptTarget, TargetFile
from heel.services.follower.pending import PENDING_S
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.target import TargetError
from tests.unit.follower.people import HEIGHT, OTHER_TRACKER, TRACKER, WIDTH, person, tracks

CLICK = TargetRequest(mode="point", x_px=100.0, y_px=300.0)
FRAME_S = 0.04


class Watching:
    """A follower that gets a frame every 40 ms."""

    def __init__(self, *people: Track) -> None:
        self.follower = Follower(FollowerSettings())
        self.seq = 0
        self.now_s = 10.0
        self.see(*people)

    def see(self, *people: Track, frames: int = 1, age_s: float = 0.02,
            motion: CameraMotion | None = None) -> None:  # fmt: skip
        for _ in range(frames):
            self.seq += 1
            self.now_s += FRAME_S
            seen = tracks(*people, seq=self.seq).model_copy(update={"camera_motion": motion})
            self.follower.observe(seen, TRACKER)
            self.follower.step(self.now_s, age_s)

    def wait(self, seconds: float) -> None:
        """Go on without a new frame."""
        self.now_s += seconds
        self.follower.step(self.now_s, seconds)

    @property
    def chosen(self) -> tuple[TargetMode, int | None]:
        return self.follower.target.mode, self.follower.target.track_id


def test_a_point_at_which_nobody_is_tracked_waits_for_who_comes_to_be_tracked_there() -> None:
    watching = Watching(person(1))
    target = watching.follower.choose(CLICK)
    assert (target.mode, target.track_id) == ("point", None)
    assert target.reason == "looking for somebody there"
    watching.see(person(1), frames=12)
    state = watching.follower.state
    assert (state.state, state.linear_mps, state.angular_radps) == ("acquiring", 0.0, 0.0)
    assert state.pending_point_px == (100.0, 300.0)
    assert state.pending_for_s == pytest.approx(PENDING_S - 12 * FRAME_S)
    watching.see(person(1), person(2, x=100), frames=8)
    assert watching.chosen == ("point", 2)
    assert watching.follower.state.state == "following"
    assert watching.follower.state.pending_point_px is None


def test_the_detector_is_told_of_the_point() -> None:
    watching = Watching(person(1))
    assert watching.follower.pointed is None
    watching.follower.choose(CLICK)
    pointed = watching.follower.pointed
    assert pointed is not None
    assert (pointed.x_px, pointed.y_px, pointed.frame.seq) == (100.0, 300.0, watching.seq)
    assert (pointed.width, pointed.height) == (WIDTH, HEIGHT)


def test_nobody_found_there_is_said_in_the_end() -> None:
    watching = Watching(person(1))
    watching.follower.choose(CLICK)
    watching.see(person(1), frames=round(PENDING_S / FRAME_S) + 2)
    assert watching.chosen == ("none", None)
    assert watching.follower.state.reason.startswith("nobody found there")
    watching.see(person(1), person(2, x=100), frames=8)
    assert watching.chosen == ("none", None)


def test_who_was_tracked_elsewhere_and_walks_there_is_not_who_was_pointed_at() -> None:
    watching = Watching(person(1))
    watching.follower.choose(CLICK)
    watching.see(person(1, x=100), frames=10)
    assert watching.chosen == ("point", None)


def test_who_was_not_shown_yet_is_chosen_once_they_are() -> None:
    watching = Watching(person(1, x=100, shown=False, state="new"))
    watching.follower.choose(CLICK)
    watching.see(person(1, x=100), frames=2)
    assert watching.chosen == ("point", 1)


def test_who_was_found_a_step_further_on_is_chosen_if_alone() -> None:
    watching = Watching()
    watching.follower.choose(CLICK)
    watching.see(frames=12)
    watching.see(person(2, x=170))
    assert watching.chosen == ("point", 2)
    watching = Watching()
    watching.follower.choose(CLICK)
    watching.see(frames=12)
    watching.see(person(2, x=170), person(3, x=30))
    assert watching.chosen == ("point", None), "either may be meant"


def test_the_point_goes_along_with_the_picture() -> None:
    watching = Watching()
    watching.follower.choose(CLICK)
    moved = CameraMotion(affine=(1.0, 0.0, 20.0, 0.0, 1.0, -1.0), quality=0.9)
    watching.see(frames=10, motion=moved)
    assert watching.follower.state.pending_point_px == pytest.approx((300.0, 290.0))
    watching.see(person(1, x=100), person(2, x=320), motion=moved)
    assert watching.chosen == ("point", 2)


def test_without_word_of_the_camera_the_point_turns_with_the_robot() -> None:
    watching = Watching()
    watching.follower.choose(TargetRequest(mode="point", x_px=320.0, y_px=300.0))
    for _ in range(10):
        odometry = Odometry(
            seq=watching.seq, x_m=0, y_m=0, heading_rad=0, linear_mps=0, angular_radps=0.5
        )
        watching.follower.observe_odometry(odometry, watching.now_s)
        watching.see()
    place = watching.follower.state.pending_point_px
    assert place is not None
    # Turned to the left by up to 0.2 rad: what was ahead is to the right by so much.
    focal_px = 320 / math.tan(math.radians(30))
    assert 320 + 0.15 * focal_px < place[0] < 320 + 0.21 * focal_px


@pytest.mark.parametrize("quality", [0.0, 1.0])
def test_whatever_is_told_of_the_camera_ends_nothing(quality: float) -> None:
    watching = Watching()
    watching.follower.choose(CLICK)
    wild = CameraMotion(affine=(1e9, -1e9, 1e9, 1e9, 1e9, 1e9), quality=quality)
    watching.see(frames=100, motion=wild)
    place = watching.follower.state.pending_point_px
    assert place is not None
    assert all(math.isfinite(value) for value in place)


def test_a_second_click_replaces_the_first_and_none_clears_it() -> None:
    watching = Watching()
    watching.follower.choose(CLICK)
    watching.follower.choose(TargetRequest(mode="point", x_px=500.0, y_px=300.0))
    watching.see(person(1, x=100), person(2, x=500), frames=2)
    assert watching.chosen == ("point", 2)
    watching.follower.choose(TargetRequest(mode="point", x_px=300.0, y_px=300.0))
    watching.follower.choose(TargetRequest(mode="none"))
    watching.see(person(5, x=300), frames=2)
    assert watching.chosen == ("none", None)


def test_before_the_first_picture_no_point_can_be_chosen() -> None:
    with pytest.raises(TargetError, match="no picture yet"):
        Follower(FollowerSettings()).choose(CLICK)


@pytest.mark.parametrize(
    "request_",
    [
        TargetRequest(mode="nearest"),
        TargetRequest(mode="imprint"),
        TargetRequest(mode="id", track_id=1),
        TargetRequest(mode="point", x_px=320, y_px=300),
        CLICK,
    ],
    ids=["nearest", "imprint", "id", "point", "nobody"],
)
def test_nobody_is_chosen_from_stale_tracks(request_: TargetRequest) -> None:
    watching = Watching(person(1))
    watching.wait(8.0)
    with pytest.raises(TargetError, match=r"tracks are 8\.0 s old"):
        watching.follower.choose(request_)
    assert watching.chosen == ("none", None)
    assert watching.follower.choose(TargetRequest(mode="none")).reason == "cleared"


def test_an_unknown_id_is_said_to_be_so_even_then() -> None:
    watching = Watching(person(1))
    watching.wait(8.0)
    with pytest.raises(TargetError, match="nobody has id 9"):
        watching.follower.choose(TargetRequest(mode="id", track_id=9))


BEHIND = person(2, x=330, state="occluded", occluded_by=(1,))


@pytest.mark.parametrize(
    ("people", "request_", "chosen"),
    [
        ((person(1), BEHIND), TargetRequest(mode="id", track_id=2), 2),
        ((person(1), BEHIND), TargetRequest(mode="point", x_px=331, y_px=300), 2),
        ((person(1), person(2, x=340)), TargetRequest(mode="point", x_px=310, y_px=300), 1),
    ],
    ids=["hidden", "hidden in a group", "overlap"],
)
def test_a_choice_on_a_box_of_two_people_waits_and_says_so(
    people: tuple[Track, ...], request_: TargetRequest, chosen: int
) -> None:
    watching = Watching(*people)
    target = watching.follower.choose(request_)
    other = 3 - chosen
    words = f"not sure which of two, {chosen} and {other}: waiting until they part"
    assert (target.track_id, target.reason) == (chosen, words)
    assert watching.follower.kept is None, "the next follower could not tell, either"
    watching.see(*people, frames=100)
    state = watching.follower.state
    assert (state.state, state.reason) == ("unsure", words)
    assert (state.linear_mps, state.angular_radps) == (0.0, 0.0)


TOGETHER = (person(1), person(2, x=340))
CLICK_ON_ONE = TargetRequest(mode="point", x_px=300.0, y_px=300.0)


@pytest.mark.parametrize(
    ("apart", "meant"),
    [
        ((person(1, x=310), person(2, x=400)), 1),
        ((person(2, x=310), person(1, x=400)), 2),
        ((person(1, x=310),), 1),
        ((person(2, x=310),), 2),
    ],
    ids=["stayed", "ids exchanged", "the other is gone", "the id is gone"],
)
def test_what_was_pointed_at_decides_once_they_have_parted(
    apart: tuple[Track, ...], meant: int
) -> None:
    watching = Watching(*TOGETHER)
    watching.follower.choose(CLICK_ON_ONE)
    watching.see(*TOGETHER, frames=20)
    watching.see(*apart, frames=20)
    assert watching.chosen == ("point", meant)
    assert "the one pointed at" in watching.follower.target.reason
    assert watching.follower.state.state == "following"


def test_the_point_goes_along_with_the_box() -> None:
    watching = Watching(*TOGETHER)
    watching.follower.choose(CLICK_ON_ONE)
    for step in range(1, 41):
        watching.see(person(1, x=320 - 5 * step), person(2, x=340 - 5 * step))
    watching.see(person(1, x=115), person(2, x=230), frames=20)
    assert watching.chosen == ("point", 1)


def test_of_whom_the_point_tells_nothing_it_is_asked_again() -> None:
    watching = Watching(*TOGETHER)
    watching.follower.choose(CLICK_ON_ONE)
    watching.see(person(1, x=150), person(2, x=500), frames=20)
    state = watching.follower.state
    assert watching.chosen == ("none", None)
    assert state.reason == "not clear which of 1 and 2 was meant: choose again"
    assert state.state == "idle"


def test_two_who_do_not_part_are_asked_about_in_the_end() -> None:
    watching = Watching(*TOGETHER)
    watching.follower.choose(CLICK_ON_ONE)
    watching.see(*TOGETHER, frames=260)
    assert watching.chosen == ("none", None)


def test_a_flicker_of_a_second_box_decides_nothing() -> None:
    watching = Watching(*TOGETHER)
    watching.follower.choose(CLICK_ON_ONE)
    for _ in range(5):
        watching.see(person(1, x=310), person(2, x=400), frames=4)
        watching.see(*TOGETHER, frames=4)
    assert watching.follower.target.reason.startswith("not sure which of two")


def test_after_a_newcomer_has_come_forth_the_place_pointed_at_counts_not_the_id() -> None:
    watching = Watching(person(1))
    watching.see(person(1), frames=50)
    watching.see(person(1), person(2, x=390), frames=2)
    target = watching.follower.choose(TargetRequest(mode="id", track_id=1, x_px=320, y_px=300))
    assert target.reason.startswith("not sure which of two, 1 and 2")
    watching.see(person(1), person(2, x=390), frames=10)
    watching.see(person(2), person(1, x=390), frames=30)
    assert watching.chosen == ("id", 2), "the tracker has found that the id was the other's"


def test_long_after_a_newcomer_came_forth_a_choice_is_one() -> None:
    watching = Watching(person(1))
    watching.see(person(1), person(2, x=390), frames=50)
    assert watching.follower.choose(TargetRequest(mode="id", track_id=1)).reason == "chosen"


def wide(x: float) -> Track:
    """One box on two people, who stand 35 px to its left and right."""
    return person(1, box_xyxy=(x - 75.0, 200.0, x + 75.0, 400.0))


@pytest.mark.parametrize(("x_px", "meant"), [(305.0, 1), (375.0, 2)])
def test_somebody_who_comes_forth_soon_after_a_click_may_be_the_one_meant(
    x_px: float, meant: int
) -> None:
    of_both, one, other = wide(340.0), person(1, x=310), person(2, x=380)
    watching = Watching(of_both)
    click = TargetRequest(mode="point", x_px=x_px, y_px=300.0)
    assert watching.follower.choose(click).reason == "chosen"
    watching.see(of_both, frames=20)
    assert watching.follower.state.state == "following"
    watching.see(one, other.model_copy(update={"state": "new", "shown": False}), frames=3)
    watching.see(one, other, frames=5)
    state = watching.follower.state
    assert (state.state, state.linear_mps, state.angular_radps) == ("unsure", 0.0, 0.0)
    assert state.reason == "not sure which of two, 1 and 2: waiting until they part"
    watching.see(one, other, frames=40)
    assert watching.chosen == ("point", meant)
    assert watching.follower.state.state == "following"


def test_the_point_goes_along_with_a_robot_that_turns_until_somebody_comes_forth() -> None:
    watching = Watching(wide(340.0))
    watching.follower.choose(TargetRequest(mode="point", x_px=375.0, y_px=300.0))
    turning = CameraMotion(affine=(1.0, 0.0, -10.0, 0.0, 1.0, 0.0), quality=1.0)
    for step in range(1, 11):
        watching.see(wide(340.0 - 10 * step), motion=turning)
    for step in range(11, 14):
        new = person(2, x=380 - 10 * step).model_copy(update={"state": "new", "shown": False})
        watching.see(person(1, x=310 - 10 * step), new, motion=turning)
    watching.see(person(1, x=180), person(2, x=250), frames=40)
    assert watching.chosen == ("point", 2)


@pytest.mark.parametrize(
    ("request_", "frames"),
    [
        (TargetRequest(mode="point", x_px=305.0, y_px=300.0), 80),
        (TargetRequest(mode="nearest"), 10),
    ],
    ids=["long after the click", "nobody was pointed at"],
)
def test_otherwise_a_choice_is_one_whoever_comes_forth(
    request_: TargetRequest, frames: int
) -> None:
    watching = Watching(person(1))
    watching.follower.choose(request_)
    watching.see(person(1), frames=frames)
    watching.see(person(1), person(2, x=390), frames=2)
    assert watching.follower.decided


def test_a_choice_of_a_track_that_is_unsure_says_so() -> None:
    watching = Watching(person(1, identity_confidence=0.42))
    target = watching.follower.choose(TargetRequest(mode="id", track_id=1))
    assert target.reason.startswith("chosen while only 42 % sure who it is")
    watching.see(person(1, identity_confidence=0.42), frames=20)
    assert watching.follower.state.state == "unsure"


def test_the_nearest_is_waited_for_while_its_box_stands_on_two() -> None:
    watching = Watching(person(1), person(2, x=340, height=190.0))
    target = watching.follower.choose(TargetRequest(mode="nearest"))
    assert (target.track_id, target.reason) == (
        None, "the nearest box covers two people, 1 and 2: waiting until they part",
    )  # fmt: skip
    watching.see(person(1), person(2, x=420, height=190.0), frames=10)
    assert watching.chosen == ("nearest", 1)


def test_people_beside_each_other_are_just_chosen() -> None:
    watching = Watching(person(1), person(2, x=380))
    target = watching.follower.choose(TargetRequest(mode="point", x_px=310, y_px=300))
    assert (target.track_id, target.reason) == (1, "chosen")


FAR_BEHIND = person(2, x=340, height=100.0)


@pytest.mark.parametrize("age_frames", [3, 50], ids=["just come forth", "known for long"])
@pytest.mark.parametrize("mode", ["point", "nearest"])
def test_somebody_seen_far_behind_leaves_the_nearer_one_clear(
    mode: TargetMode, age_frames: int
) -> None:
    watching = Watching(person(1))
    watching.see(person(1), frames=20)
    watching.see(person(1), FAR_BEHIND, frames=age_frames)
    at = {"x_px": 310.0, "y_px": 300.0} if mode == "point" else {}
    watching.follower.choose(TargetRequest(mode=mode, **at))
    missed = {"state": "occluded", "occluded_by": (1,), "missed_frames": 1}
    for at in range(6):
        watching.see(person(1), FAR_BEHIND, frames=4)
        watching.see(person(1), FAR_BEHIND.model_copy(update={**missed, "shown": at % 2 == 0}))
    assert watching.chosen == (mode, 1)
    assert watching.follower.decided


def test_whoever_is_seen_far_behind_is_not_clear_themselves() -> None:
    watching = Watching(person(1), FAR_BEHIND)
    target = watching.follower.choose(TargetRequest(mode="id", track_id=2, x_px=340, y_px=340))
    assert target.reason.startswith("not sure which of two, 2 and 1")
    watching.see(person(1), FAR_BEHIND, frames=40)
    assert watching.follower.state.state == "unsure", "the nearer box holds the point, too"
    for shown in (True, False):
        hidden = {"state": "occluded", "occluded_by": (1,), "missed_frames": 1, "shown": shown}
        watching.see(person(1), FAR_BEHIND.model_copy(update=hidden), frames=10)
        assert watching.chosen == ("id", 2)
    watching.see(person(1, x=250), FAR_BEHIND, frames=40)
    assert watching.chosen == ("id", 2)


def restarted(**changes: int) -> Tracks:
    return tracks(person(1), person(2, x=500)).model_copy(update=changes)


@pytest.mark.parametrize(
    ("seen", "tracker", "words"),
    [
        (restarted(epoch=2), TRACKER, "the camera was restarted: choose again"),
        (restarted(width=1280, height=960), TRACKER, "the picture has another size: choose again"),
        (restarted(), OTHER_TRACKER, "the tracker was replaced: choose again"),
    ],
    ids=["camera", "size", "tracker"],
)
@pytest.mark.parametrize("pending", [False, True], ids=["chosen", "pending"])
def test_whose_id_means_nobody_any_more_has_to_be_chosen_again(
    seen: Tracks, tracker: str, words: str, pending: bool
) -> None:
    watching = Watching(person(1))
    watching.follower.choose(CLICK if pending else TargetRequest(mode="id", track_id=1))
    watching.see(person(1), frames=10)
    watching.follower.observe(seen, tracker)
    command = watching.follower.step(watching.now_s + 0.02, 0.02)
    assert (command.state, command.reason) == ("idle", words)
    assert (command.linear_mps, command.angular_radps) == (0.0, 0.0)


def interrupted(for_s: float, returns: str = TRACKER, **changes: int) -> Follower:
    """A follower of person 1 that heard another tracker for a while."""
    made = Follower(FollowerSettings())
    made.observe(tracks(person(1)), TRACKER)
    made.choose(TargetRequest(mode="id", track_id=1))
    made.observe(restarted(), OTHER_TRACKER)
    assert made.target.reason == "the tracker was replaced: choose again"
    assert made.kept is None, "a restarted follower does not choose for them"
    later_ns = restarted().t_capture_ns + round(for_s * 1e9)
    made.observe(restarted(t_capture_ns=later_ns, **changes), returns)
    return made


def test_the_person_is_kept_when_the_tracker_that_knows_them_is_heard_again() -> None:
    made = interrupted(1.0)
    assert (made.target.mode, made.target.track_id) == ("id", 1)
    assert made.step(0.0, 0.0).state == "acquiring", "and makes sure before it moves"


@pytest.mark.parametrize(
    "made",
    [interrupted(60.0), interrupted(1.0, epoch=2), interrupted(1.0, "tracker/third@00000001")],
    ids=["too late", "another camera", "a third tracker"],
)
def test_the_person_is_not_kept_where_the_id_may_be_somebody_else(made: Follower) -> None:
    assert made.target.track_id is None


def test_who_waits_for_the_nearest_goes_on_waiting_after_a_restart() -> None:
    made = Follower(FollowerSettings(target="nearest"))
    made.observe(tracks(), TRACKER)
    made.step(10.0, 0.0)
    made.observe(restarted(epoch=2), TRACKER)
    made.step(10.1, 0.0)
    assert made.target.mode == "nearest"
    assert made.target.track_id is not None


def restarted_follower(seen: Tracks, tracker: str = TRACKER, **settings: Any) -> Follower:
    """A follower that comes after one that followed person 1."""
    before = Watching(person(1))
    before.follower.choose(TargetRequest(mode="point", x_px=320, y_px=300))
    kept = before.follower.kept
    assert kept is not None
    made = Follower(FollowerSettings(**settings))
    made.restore(KeptTarget.model_validate_json(kept.model_dump_json()))
    assert made.kept == kept, "a third one has to know as well"
    made.observe(seen, tracker)
    return made


@pytest.mark.parametrize("start", ["none", "nearest"])
def test_a_follower_that_restarts_goes_on_with_whom_the_one_before_followed(start: str) -> None:
    made = restarted_follower(tracks(person(1, height=60), person(2, x=500)), target=start)
    assert (made.target.mode, made.target.track_id) == ("point", 1)
    assert made.target.reason == "kept over a restart of the follower"
    assert made.step(0.0, 0.0).state == "acquiring", "and makes sure before it moves"


@pytest.mark.parametrize(
    ("seen", "tracker"), [(restarted(), OTHER_TRACKER), (restarted(epoch=2), TRACKER)]
)
def test_it_does_not_if_the_ids_are_of_another_tracker_or_camera(
    seen: Tracks, tracker: str
) -> None:
    made = restarted_follower(seen, tracker)
    assert made.target.track_id is None
    assert made.target.reason.endswith("restarted: choose again")
    assert made.kept is None


def test_whoever_chooses_before_the_first_tracks_wins() -> None:
    made = Follower(FollowerSettings())
    before = Watching(person(1))
    before.follower.choose(TargetRequest(mode="id", track_id=1))
    assert before.follower.kept is not None
    made.restore(before.follower.kept)
    made.choose(TargetRequest(mode="none"))
    made.observe(tracks(person(1)), TRACKER)
    assert made.target.reason == "cleared"


def test_the_note_is_read_by_whoever_comes_soon(tmp_path: Path) -> None:
    note, log = tmp_path / "target", logging.getLogger("test")
    before = Watching(person(1))
    before.follower.choose(TargetRequest(mode="id", track_id=1))
    kept = before.follower.kept
    assert TargetFile(note, log).load() is None
    file = TargetFile(note, log)
    file.save(kept)
    assert TargetFile(note, log).load() == kept
    os.utime(note, (time.time() - 60, time.time() - 60))
    assert TargetFile(note, log).load() is None, "by now nobody expects the robot to set off"
    file.renew(1e6)
    assert TargetFile(note, log).load() == kept
    note.write_text('{"target": 7}')
    assert TargetFile(note, log).load() is None
    file.save(None)
    assert not note.exists()
