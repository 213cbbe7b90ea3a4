"""The figures of a simulated world that goes on and on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from heel.schemas import FollowState, Pose, SimPerson, SimTruth, Target
from heel.schemas.follow import FollowStateName
from heel.services.run.following import FollowingTally, write_figures

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


def state(name: FollowStateName, track_id: int | None = 7) -> FollowState:
    return FollowState(
        seq=0, state=name, reason="", estop=False, linear_mps=0.0, angular_radps=0.0,
        target=Target(seq=1, mode="id", track_id=track_id),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "people", "followed_s", "wrong_s"),
    [
        ("following", {7: 0}, 1.0, 0.0),
        ("occluded", {7: 0}, 1.0, 0.0),
        ("following", {7: 1, 8: 0}, 0.0, 1.0),
        ("following", {8: 0}, 0.0, 0.0),
        ("unsure", {7: 1}, 0.0, 0.0),
        ("stopped", {7: 0}, 0.0, 0.0),
    ],
)
def test_whom_the_robot_acts_upon(
    name: FollowStateName, people: dict[int, int], followed_s: float, wrong_s: float
) -> None:
    tally = FollowingTally()
    tally.episode()
    for seq in range(11):
        tally.record(truth(seq), state(name), people)
    assert tally.figures.followed_s == pytest.approx(followed_s)
    assert tally.figures.wrong_s == pytest.approx(wrong_s)


def test_way_distance_gap_and_contacts_over_two_episodes() -> None:
    tally = FollowingTally()
    for _ in range(2):
        tally.episode()
        for seq in range(11):
            tally.record(truth(seq, x_m=seq * 0.1, contact=int(seq >= 5)), None, {})
    figures = tally.figures
    assert figures.episodes == 2
    assert figures.time_s == pytest.approx(2.0)
    assert figures.driven_m == pytest.approx(2.0)
    assert figures.contacts == 2
    assert figures.least_gap_m == pytest.approx(2.0 - 0.5)
    assert figures.mean_distance_m == pytest.approx(2.45)
    assert figures.followed_s == figures.wrong_s == 0.0


def test_the_file_is_whole_or_not_there(tmp_path: Path) -> None:
    tally = FollowingTally()
    tally.episode()
    write_figures(tally.figures, "pixels", None, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["following.json"]
    written = json.loads((tmp_path / "following.json").read_text())
    assert (written["perception"], written["episodes"]) == ("pixels", 1)
    with pytest.raises(OSError, match="No such file"):
        write_figures(tally.figures, "pixels", None, tmp_path / "none")
