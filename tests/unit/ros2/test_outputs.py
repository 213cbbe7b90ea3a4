"""What ROS is told: places of people, boxes, health; and what is said without its packages."""

from __future__ import annotations

import math
import sys
from types import ModuleType, SimpleNamespace

import pytest

from heel.schemas import CameraInfo, Health, HeelError, Track, Tracks
from heel.services.ros2 import outputs
from heel.services.ros2.check import judged_told
from heel.services.ros2.convert import (
    ERROR,
    OK,
    STALE,
    WARN,
    PersonThere,
    people_of,
    status_of,
)
from heel.services.ros2.joining import joined
from heel.services.ros2.node import End
from heel.services.ros2.settings import Ros2Settings

INFO = CameraInfo(
    stream="front", epoch=1, width=640, height=480, source_width=640, source_height=480, fps=20.0,
    source="test", horizontal_fov_rad=math.pi / 2, mount_height_m=0.8, mount_pitch_rad=0.0,
)  # fmt: skip


def track(track_id: int, box: tuple[float, float, float, float], **changes: object) -> Track:
    values: dict[str, object] = {
        "id": track_id, "state": "tracked", "box_xyxy": box, "velocity_pxps": (0.0, 0.0),
        "area_px": 1.0, "span_px": 1.0, "identity_confidence": 0.9, "shown": True,
    }  # fmt: skip
    return Track.model_validate(values | changes)


def tracks(*people: Track) -> Tracks:
    return Tracks(
        stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=640, height=480,
        source_width=640, source_height=480, tracks=people,
    )  # fmt: skip


AT_2_M = (288.0, 96.0, 352.0, 368.0)
"""Box of an adult of 1.7 m who stands 2 m ahead of the camera, whose focal length is 320 pixels."""


def test_people_stand_where_their_boxes_say() -> None:
    (person,) = people_of(tracks(track(3, AT_2_M)), INFO, 3)
    assert (person.x_m, person.y_m) == (pytest.approx(2.0, abs=0.05), pytest.approx(0.0, abs=0.01))
    assert person.chosen


def test_a_measured_place_counts_before_the_box_and_the_camera_may_look_aside() -> None:
    told = track(3, AT_2_M, distance_m=3.0, bearing_rad=0.5)
    (person,) = people_of(tracks(told), INFO, None)
    assert (person.x_m, person.y_m) == (
        pytest.approx(3 * math.cos(0.5)), pytest.approx(3 * math.sin(0.5)),
    )  # fmt: skip
    assert not person.chosen
    (aside,) = people_of(tracks(told), INFO.model_copy(update={"mount_yaw_rad": 1.0}), None)
    assert math.atan2(aside.y_m or 0, aside.x_m or 0) == pytest.approx(1.5)
    (bare,) = people_of(tracks(told), None, None)
    assert bare.x_m == person.x_m


def test_without_a_camera_there_is_a_box_and_no_place_and_who_is_not_shown_is_left_out() -> None:
    people = people_of(tracks(track(3, AT_2_M), track(4, AT_2_M, shown=False)), None, None)
    assert [(person.id, person.x_m, person.box_xyxy) for person in people] == [(3, None, AT_2_M)]


def health(**changes: object) -> Health:
    values: dict[str, object] = {
        "service": "tracker", "instance": "main", "producer": "tracker/main@00000001",
        "state": "ok", "uptime_s": 5.0, "loop_age_s": 0.0, "software_version": "1", "dropped": 7,
        "period_s": 0.25, "details": {"ages": "from acquisition"},
    }  # fmt: skip
    return Health.model_validate(values | changes)


@pytest.mark.parametrize(
    ("state", "reason", "silent_s", "level", "words"),
    [
        ("ok", "", 0.1, OK, "ok"),
        ("starting", "", 0.1, WARN, "starting"),
        ("degraded", "two producers", 0.1, WARN, "two producers"),
        ("error", "no camera", 0.1, ERROR, "no camera"),
        ("ended", "", 9.0, STALE, "ended"),
        ("ok", "", 0.74, OK, "ok"),
        ("ok", "", 0.76, STALE, "silent for 0.8 s"),
        ("error", "no camera", 2.0, STALE, "silent for 2.0 s"),
    ],
)
def test_health_becomes_a_status(
    state: str, reason: str, silent_s: float, level: int, words: str
) -> None:
    status = status_of(health(state=state, reason=reason), silent_s)
    assert (status.level, status.message) == (level, words)
    assert status.name == "heel: tracker/main"
    assert status.values["dropped"] == "7"
    assert status.values["ages"] == "from acquisition"


def record(name: str, **defaults: object) -> type:
    """A class of ROS: its fields and no others, new ones in each object."""

    def fresh(value: object) -> object:
        return value() if isinstance(value, type) else list(value) if value == [] else value  # type: ignore[call-overload]

    def made(self: object) -> None:
        for field, value in defaults.items():
            setattr(self, field, fresh(value))

    return type(name, (), {"__slots__": tuple(defaults), "__init__": made})


def vision_messages() -> dict[str, type]:
    """vision_msgs 4.1 as its definitions read."""
    point = record("Point2D", x=0.0, y=0.0)
    pose = record("Pose2D", position=point, theta=0.0)
    box = record("BoundingBox2D", center=pose, size_x=0.0, size_y=0.0)
    guess = record("ObjectHypothesis", class_id="", score=0.0)
    return {
        "Detection2DArray": record("Detection2DArray", header=None, detections=[]),
        "Detection2D": record("Detection2D", header=None, results=[], bbox=box, id=""),
        "ObjectHypothesisWithPose": record("ObjectHypothesisWithPose", hypothesis=guess, pose=None),
    }


def test_boxes_become_detections() -> None:
    kinds = vision_messages()
    header = SimpleNamespace(frame_id="camera", stamp=SimpleNamespace(sec=1, nanosec=2))
    people = [PersonThere(5, None, None, (10.0, 20.0, 30.0, 60.0), 0.75, True)]
    made = outputs.detections(
        lambda kind: kinds[kind.removeprefix("vision_msgs/msg/")](), people, header
    )
    (found,) = made.detections
    assert made.header is found.header is header
    assert (found.bbox.center.position.x, found.bbox.center.position.y) == (20.0, 40.0)
    assert (found.bbox.size_x, found.bbox.size_y, found.id) == (20.0, 40.0, "5")
    assert (found.results[0].hypothesis.class_id, found.results[0].hypothesis.score) == (
        "target", 0.75,
    )  # fmt: skip


def test_a_package_that_is_missing_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for package in ("geometry_msgs", "sensor_msgs", "nav_msgs", "std_msgs"):
        there = ModuleType(f"{package}.msg")
        there.__getattr__ = lambda name: object  # type: ignore[method-assign]
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", there)
    with pytest.raises(HeelError, match=r"vision_msgs is not there .*apt install ros-\S*-vision"):
        joined(Ros2Settings(detections_topic="people_boxes"))


def test_without_any_ros_there_is_one_clear_error() -> None:
    with pytest.raises(HeelError, match="--rmw zenoh"):
        joined(Ros2Settings())


def test_only_named_topics_are_told_on() -> None:
    assert outputs.outputs_of(Ros2Settings()) == {}
    named = Ros2Settings(
        people_topic="people", diagnostics_topic="diagnostics", target_topic="goal_update"
    )
    assert {name: topic for name, (topic, _) in outputs.outputs_of(named).items()} == {
        "target": "goal_update", "people": "people", "diagnostics": "diagnostics",
    }  # fmt: skip


def test_the_check_minds_a_wrong_type_and_no_lack_of_listeners() -> None:
    kind = End("visualization_msgs/msg/MarkerArray")
    assert judged_told("/people", kind, []).remedy == ""
    assert "1 listener" in judged_told("/people", kind, [kind]).words
    wrong = judged_told("/people", kind, [End("visualization_msgs/msg/Marker")])
    assert wrong.remedy
    assert "visualization_msgs/msg/Marker, not" in wrong.words
