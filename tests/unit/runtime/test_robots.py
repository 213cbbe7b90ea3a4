"""Many robots on one router: who each message is of, and what a person in charge is told."""

from __future__ import annotations

import pytest

from heel.schemas import FollowState, Health, MessageError, Target, encode, keys
from heel.services.runtime.chain import STANDBY
from heel.services.runtime.robots import ROBOTS_PAGE, RobotRow, Robots
from heel.services.runtime.stops import STOP_DETAIL

T_S = 100.0
STACK = ("capture", "detector", "tracker", "follower", "drive")


def health(service: str, instance: str = "main", **more: object) -> Health:
    fields = {"state": "ok", "uptime_s": 9.0, "loop_age_s": 0.0, "software_version": "1",
              "period_s": 0.25, "rate_out_hz": 25.0}  # fmt: skip
    return Health.model_validate(
        fields | {"service": service, "instance": instance,
                  "producer": f"{service}/{instance}@0123abcd"} | more
    )  # fmt: skip


def say(robots: Robots, robot: str, message: Health, at_s: float = T_S) -> None:
    key = "/".join(filter(None, (robot, keys.health(message.service, message.instance))))
    robots.hear("health", key, encode(message), message.encoding(), at_s)


def follow(robots: Robots, robot: str, at_s: float = T_S, estop: bool = False) -> None:
    state = FollowState(
        seq=1, state="following", reason="in sight", estop=estop, linear_mps=0.4, distance_m=2.0,
        angular_radps=0.0, tracks_age_s=0.05, identity_confidence=0.9,
        target=Target(seq=1, mode="nearest", track_id=7),
    )  # fmt: skip
    key = "/".join(filter(None, (robot, keys.FOLLOW_STATE)))
    robots.hear("state", key, encode(state), state.encoding(), at_s)


def whole(robots: Robots, robot: str, at_s: float = T_S) -> None:
    for service in STACK:
        say(robots, robot, health(service), at_s)
    follow(robots, robot, at_s)


def rows(robots: Robots, now_s: float = T_S) -> dict[str, RobotRow]:
    return {row.name: row for row in robots.rows(now_s)}


def test_robots_are_told_apart_by_the_name_before_their_keys() -> None:
    robots = Robots()
    for name in ("", "r1", "house/hall/r1"):
        whole(robots, name)
    follow(robots, "r1", estop=True)
    found = rows(robots)
    assert list(found) == ["", "house/hall/r1", "r1"]
    assert not any(row.problems for row in found.values())
    assert [row.state is not None and row.state.estop for row in found.values()] == [
        False, False, True,
    ]  # fmt: skip
    told = found["r1"].as_json()
    assert (told["target"], told["frames_per_s"], told["tracks_age_s"]) == ("7", 25.0, 0.05)


def test_what_one_robot_lacks_is_not_the_others() -> None:
    robots = Robots()
    whole(robots, "r1")
    for service in ("capture", "tracker", "follower", "drive"):
        say(robots, "r2", health(service))
    found = rows(robots)
    assert found["r1"].problems == ()
    assert [problem.part for problem in found["r2"].problems] == ["detector"]


def test_a_robot_that_falls_silent_says_so_in_one_line_and_its_state_is_not_shown() -> None:
    robots = Robots(begun_s=T_S)
    whole(robots, "r1", T_S)
    say(robots, "r1", health("web", details={"url": "http://127.0.0.1:8470/"}))
    assert rows(robots, T_S)["r1"].page == "http://127.0.0.1:8470/"
    row = rows(robots, T_S + 9.0)["r1"]
    assert [problem.words for problem in row.problems] == ["nothing is heard of it for 9 s"]
    assert (row.state, row.page, row.frames_per_s, row.heard_age_s) == (None, None, None, 9.0)


def test_a_robot_that_is_expected_is_missing_once_it_had_time_to_speak() -> None:
    robots = Robots(expected=("r1", "r2"), begun_s=T_S)
    whole(robots, "r1", T_S + 3.0)
    assert rows(robots, T_S + 0.5)["r2"].problems == ()
    found = rows(robots, T_S + 3.0)
    assert found["r1"].problems == ()
    assert [problem.words for problem in found["r2"].problems] == ["nothing is heard of it"]


def test_the_stack_of_the_settings_is_what_each_robot_has_to_have() -> None:
    robots = Robots(stack=("tracker", "recorder"))
    whole(robots, "r1")
    assert [problem.part for problem in rows(robots)["r1"].problems] == ["recorder"]


def test_a_service_that_fails_is_something_that_the_robot_lacks() -> None:
    robots = Robots()
    whole(robots, "r1")
    say(robots, "r1", health("tracker", state="error", reason="it is full"))
    assert [problem.words for problem in rows(robots)["r1"].problems] == ["tracker: it is full"]


def test_a_page_that_lists_robots_is_none_itself() -> None:
    robots = Robots()
    page = health("web", ROBOTS_PAGE, details={ROBOTS_PAGE: "http://127.0.0.1:8470/"})
    say(robots, "", page)
    robots.token(keys.alive("web", ROBOTS_PAGE), True, T_S)
    robots.token(keys.alive("recorder", "main"), True, T_S)
    assert robots.rows(T_S) == []


def test_a_token_alone_tells_of_a_robot_whose_services_hang() -> None:
    robots = Robots(begun_s=T_S)
    robots.token(f"r1/{keys.alive('follower', 'main')}", True, T_S)
    assert rows(robots, T_S)["r1"].problems == ()
    assert rows(robots, T_S + 5.0)["r1"].problems


def test_names_are_bounded_in_number_and_length_and_malformed_messages_are_refused() -> None:
    robots = Robots()
    say(robots, "x" * 200, health("tracker"))
    for number in range(400):
        say(robots, f"r{number}", health("tracker"))
    assert len(robots.rows(T_S)) == 256
    assert robots.unlisted == 1 + 400 - 256
    with pytest.raises(MessageError):
        robots.hear("health", "r1/svc/a/b/health", b"\xc1", Health.encoding(), T_S)


def test_a_certificate_that_ends_soon_is_told_and_no_problem() -> None:
    robots = Robots()
    whole(robots, "r1")
    say(robots, "r1", health("drive", details={"certificate": "ends in 9 days"}))
    row = rows(robots)["r1"]
    assert (row.problems, row.notes) == ((), ("drive: ends in 9 days",))


def stop_of(robots: Robots, robot: str = "r1") -> tuple[str, object]:
    row = rows(robots)[robot]
    return row.stops.short, row.as_json()["estop"]


def test_a_stop_that_the_drive_alone_knows_of_is_told() -> None:
    robots = Robots()
    for service in ("capture", "detector", "tracker"):
        say(robots, "r1", health(service))
    assert stop_of(robots) == ("-", None)
    say(robots, "r1", health("drive", details={STOP_DETAIL: "no"}))
    assert stop_of(robots) == ("no", False)
    say(robots, "r1", health("drive", details={STOP_DETAIL: "yes"}))
    assert rows(robots)["r1"].state is None
    assert stop_of(robots) == ("STOP", True)
    follow(robots, "r1", estop=False)
    assert stop_of(robots) == ("drive only", True)
    follow(robots, "r1", estop=True)
    assert stop_of(robots) == ("STOP", True)
    say(robots, "r1", health("drive", details={STOP_DETAIL: "no"}))
    assert stop_of(robots) == ("follower only", True)


def test_one_of_two_drives_that_goes_on_is_no_stop_and_one_that_stands_by_says_nothing() -> None:
    robots = Robots()
    whole(robots, "r1")
    say(robots, "r1", health("drive", details={STOP_DETAIL: "yes"}))
    say(robots, "r1", health("drive", "other", details={STOP_DETAIL: "no"}))
    follow(robots, "r1", estop=True)
    assert stop_of(robots) == ("follower only", True)
    say(robots, "r1", health("drive", "other", details={STOP_DETAIL: "no", STANDBY: "ready"}))
    assert stop_of(robots) == ("STOP", True)
