from __future__ import annotations

import pytest

from heel.schemas import FollowState, Pose, SimPerson, SimTruth, Target, Track, Tracks
from heel.schemas.follow import FollowStateName
from heel.services.run.following import FollowingTally

FRAME_S = 0.1
TARGET_BOX, OTHER_BOX = (100.0, 100.0, 150.0, 250.0), (300.0, 100.0, 350.0, 250.0)


def truth(seq: int, x_m: float = 0.0, contact: int = 0) -> SimTruth:
    people = tuple(
        SimPerson(id=number, role=role, pose=Pose(x_m=at_m, y_m=0.0, heading_rad=0.0),
                  speed_mps=0.0, height_m=1.7, radius_m=0.25, box_xyxy=box, visible=1.0)
        for number, role, at_m, box in (
            (1, "target", 3.0, TARGET_BOX), (2, "other", 5.0, OTHER_BOX)
        )
    )  # fmt: skip
    return SimTruth(
        seq=seq, t_s=(seq + 1) * FRAME_S, robot=Pose(x_m=x_m, y_m=0.0, heading_rad=0.0),
        robot_radius_m=0.25, linear_mps=0.0, angular_radps=0.0, people=people, contact=contact,
    )  # fmt: skip


def tracks(seq: int, box: tuple[float, float, float, float]) -> Tracks:
    track = Track(
        id=7, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=1.0, span_px=1.0,
        identity_confidence=1.0, shown=True,
    )  # fmt: skip
    return Tracks(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=0, width=640, height=480,
        source_width=640, source_height=480, tracks=(track,),
    )  # fmt: skip


def state(name: FollowStateName, track_id: int | None = 7) -> FollowState:
    return FollowState(
        seq=0, state=name, reason="", estop=False, linear_mps=0.0, angular_radps=0.0,
        target=Target(seq=1, mode="id", track_id=track_id),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "box", "followed_s", "wrong_s"),
    [
        ("following", TARGET_BOX, 1.0, 0.0),
        ("occluded", TARGET_BOX, 1.0, 0.0),
        ("following", OTHER_BOX, 0.0, 1.0),
        ("following", (500.0, 0.0, 550.0, 100.0), 0.0, 0.0),
        ("unsure", OTHER_BOX, 0.0, 0.0),
        ("stopped", TARGET_BOX, 0.0, 0.0),
    ],
)
def test_whom_the_robot_acts_upon(
    name: FollowStateName, box: tuple[float, float, float, float], followed_s: float, wrong_s: float
) -> None:
    tally = FollowingTally()
    tally.episode()
    tally.state(state(name))
    for seq in range(10):
        tally.truth(truth(seq))
        tally.tracks(tracks(seq, box))
    assert tally.figures.followed_s == pytest.approx(followed_s)
    assert tally.figures.wrong_s == pytest.approx(wrong_s)


def test_way_distance_gap_and_contacts_over_two_episodes() -> None:
    tally = FollowingTally()
    for _ in range(2):
        tally.episode()
        for seq in range(11):
            tally.truth(truth(seq, x_m=seq * 0.1, contact=int(seq >= 5)))
    figures = tally.figures
    assert figures.episodes == 2
    assert figures.time_s == pytest.approx(2.0)
    assert figures.driven_m == pytest.approx(2.0)
    assert figures.contacts == 2
    assert figures.least_gap_m == pytest.approx(2.0 - 0.5)
    assert figures.mean_distance_m == pytest.approx(2.45)


def test_frames_that_are_not_known_count_for_nothing() -> None:
    tally = FollowingTally()
    tally.state(state("following"))
    tally.tracks(tracks(3, TARGET_BOX))
    for seq in range(1000):
        tally.truth(truth(seq))
    tally.tracks(tracks(3, TARGET_BOX))
    assert tally.figures.followed_s == 0.0
    assert tally.figures.mean_distance_m == pytest.approx(3.0)
