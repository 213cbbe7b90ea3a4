"""What `heel status` knows of who is there, who should be, and who is in sight."""

from __future__ import annotations

from heel.schemas import DriveState, FollowState, Health, Target, Track, Tracks
from heel.services.commands.observed import Observed, sight
from heel.services.commands.robot import Where
from heel.services.commands.status import doing_lines, lines
from heel.services.runtime.chain import WITHHELD
from heel.services.runtime.process import software_version
from heel.services.runtime.settings import ZenohSettings

NOW_S = 100.0


def health(service: str, version: str) -> Health:
    return Health(
        service=service, instance="main", producer=f"{service}/main@0123abcd", state="ok",
        uptime_s=9.0, loop_age_s=0.0, software_version=version,
    )  # fmt: skip


def track(number: int, distance_m: float | None = None) -> Track:
    return Track(
        id=number, state="tracked", box_xyxy=(0.0, 0.0, 1.0, 1.0), velocity_pxps=(0.0, 0.0),
        area_px=1.0, span_px=1.0, identity_confidence=0.9, shown=True, distance_m=distance_m,
    )  # fmt: skip


def follow_state(estop: bool = False, distance_m: float | None = None) -> FollowState:
    return FollowState(
        seq=1, state="following", reason="x", estop=estop, linear_mps=0.0, angular_radps=0.0,
        target=Target(seq=1, mode="id", track_id=3), distance_m=distance_m,
    )  # fmt: skip


def drive_state(estop: bool) -> DriveState:
    return DriveState(
        seq=1, state="stopped" if estop else "driving", reason="so it was told", estop=estop,
        driver="log", linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip


def told(observed: Observed, where: Where) -> str:
    problems = observed.problems(where, NOW_S)
    return "\n".join(lines(observed, where, observed.watch.rows(NOW_S), problems, NOW_S))


def test_a_service_of_the_stack_that_is_not_heard_is_missing() -> None:
    observed = Observed()
    observed.watch.hear(health("tracker", software_version()), NOW_S)
    assert observed.problems(Where(ZenohSettings(), None), NOW_S) == []
    where = Where(ZenohSettings(), None, ("tracker", "drive"))
    words = "drive: not running, and the robot's stack has it"
    assert [one.words for one in observed.problems(where, NOW_S)] == [words]
    assert f"\n{words}" in told(observed, where)


def test_another_version_is_named() -> None:
    observed, where = Observed(), Where(ZenohSettings(), None)
    observed.watch.hear(health("tracker", software_version()), NOW_S)
    assert "versions" not in told(observed, where)
    observed.watch.hear(health("drive", "0.0.1\x1b"), NOW_S)
    assert "versions: drive/main 0.0.1\\x1b; here " in told(observed, where)


def test_in_sight_are_ids_with_distance_and_confidence() -> None:
    observed = Observed()
    assert sight(observed.people(NOW_S)) == "in sight: nobody"
    observed.tracks = Tracks(
        stream="front", epoch=1, seq=1, index=1, t_capture_ns=1, width=640, height=480,
        source_width=640, source_height=480, tracks=(track(3), track(4, 5.0), track(9)),
    )  # fmt: skip
    observed.take_state(follow_state(distance_m=2.25), NOW_S)
    assert sight(observed.people(NOW_S)) == (
        "in sight: 3 (2.2 m, 90% sure), 4 (5.0 m, 90% sure), 9 (90% sure)"
    )


def test_why_people_are_not_shown_is_said() -> None:
    observed = Observed()
    tracker = health("tracker", software_version())
    withheld = {WITHHELD: "2 not shown: has not moved enough yet"}
    observed.watch.hear(tracker.model_copy(update={"details": withheld}), NOW_S)
    assert "tracker/main: 2 not shown: has not moved enough yet" in told(
        observed, Where(ZenohSettings(), None)
    )


def stop_told(drive: bool | None, follower: bool | None) -> str:
    """The first of the lines about a stop, "" without one."""
    observed = Observed()
    if drive is not None:
        observed.drive, observed.drive_s = drive_state(drive), NOW_S
    if follower is not None:
        observed.take_state(follow_state(follower), NOW_S)
    found = [one for one in doing_lines(observed, NOW_S) if one.startswith("EMERGENCY STOP")]
    assert len(found) <= 1
    return "".join(found)


def test_a_stop_is_told_whoever_knows_of_it_and_who_does_not() -> None:
    assert stop_told(None, None) == stop_told(False, False) == stop_told(False, None) == ""
    assert "the drive holds it; no follower is heard" in stop_told(True, None)
    assert "the follower holds it; no drive is heard" in stop_told(None, True)
    assert "drive and follower hold it" in stop_told(True, True)
    assert "the drive holds it, the follower does not" in stop_told(True, False)
    assert "the follower holds it, the drive does not" in stop_told(False, True)


def test_what_a_follower_or_drive_said_before_it_fell_silent_is_not_told() -> None:
    observed = Observed()
    observed.take_state(follow_state(True), NOW_S - 5.0)
    observed.drive, observed.drive_s = drive_state(True), NOW_S - 5.0
    assert doing_lines(observed, NOW_S) == []
    assert observed.stops(NOW_S).as_json()["estop"] is None
