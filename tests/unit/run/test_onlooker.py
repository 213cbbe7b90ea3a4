"""The onlooker clicks once, waits for what becomes of it, and outlives a follower that is gone."""

from __future__ import annotations

from typing import Any

import zenoh

from heel.schemas import Pose, SimPerson, SimTruth, Target, TargetRequest, decode, encode
from heel.services.run.onlooker import Onlooker

HERE = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)


class Answer:
    """A reply as zenoh gives it."""

    def __init__(self, target: Target | None) -> None:
        self.ok = None if target is None else self
        self.payload, self.encoding = self, Target.encoding()
        self._target = target

    def to_bytes(self) -> bytes:
        assert self._target is not None
        return encode(self._target)


class Follower:
    """Answers in the order given; an empty list is a follower that is gone."""

    def __init__(self, *answers: Target | None) -> None:
        self._answers = list(answers)
        self.asked: list[TargetRequest | None] = []

    def get(self, _key: str, _handler: Any, **query: Any) -> Any:
        payload = query["payload"]
        self.asked.append(None if payload is None else decode(TargetRequest, payload))
        return self

    def try_recv(self) -> Answer:
        if not self._answers:
            raise zenoh.ZError("channel is empty and closed")
        return Answer(self._answers.pop(0))


def look_for(seconds: float, follower: Follower) -> None:
    onlooker = Onlooker()
    onlooker.episode()
    person = SimPerson(
        id=1, role="target", pose=HERE, speed_mps=0.0, height_m=1.7, radius_m=0.2,
        box_xyxy=(100.0, 100.0, 200.0, 350.0), visible=1.0,
    )  # fmt: skip
    for seq in range(round(seconds * 10)):
        truth = SimTruth(
            seq=seq, t_s=seq / 10, robot=HERE, robot_radius_m=0.2, linear_mps=0.0,
            angular_radps=0.0, people=(person,),
        )  # fmt: skip
        onlooker.look(follower, truth)  # type: ignore[arg-type]


def target(mode: str, track_id: int | None = None) -> Target:
    return Target.model_validate({"seq": 1, "mode": mode, "track_id": track_id})


def test_one_click_is_a_choice() -> None:
    follower = Follower(target("point"), target("point"), target("point", 7))
    look_for(5.0, follower)
    click, *later = follower.asked
    assert click is not None
    assert (click.mode, click.x_px, click.y_px) == ("point", 150.0, 200.0)
    assert later == [None, None], "it only reads what became of the click"


def test_who_was_not_found_is_clicked_on_again() -> None:
    follower = Follower(target("point"), target("none"), None, target("point", 7))
    look_for(5.0, follower)
    assert [request is None for request in follower.asked] == [False, True, False, False]


def test_a_follower_that_is_gone_ends_nothing() -> None:
    follower = Follower()
    look_for(5.0, follower)
    assert len(follower.asked) > 3
