"""Who may send what, as the issue of the rules states it, and that no topic is left without one."""

from __future__ import annotations

import json

import pytest
import zenoh

from heel.schemas import keys
from heel.services.security.roles import PEOPLE, ROLES, sent_by
from heel.services.security.rules import access_control, size_limits

SENDERS = {
    "image": {"capture", "ros2", "simulator"},
    "jpeg": {"capture", "ros2", "simulator"},
    "depth": {"capture", "ros2", "simulator"},
    "taken": {"capture", "ros2", "simulator"},
    "info": {"capture", "ros2", "simulator"},
    "blobs": {"detector", "simulator"},
    "tracks": {"tracker"},
    "events": {"tracker"},
    "progress": {"detector", "web"},
    "command": {"follower"},
    "state": {"follower"},
    "target": {"follower"},
    "pointed": {"follower"},
    "manual": {"web", "operate"},
    "estop": {"follower", "drive", "ros2", "web", "operate"},
    "odometry": {"drive", "ros2", "simulator"},
    "range": {"ros2", "sensor", "simulator"},
    "drive": {"drive"},
    "truth": {"simulator"},
    "world": {"simulator"},
    "health": {
        "capture",
        "detector",
        "tracker",
        "follower",
        "drive",
        "sensor",
        "simulator",
        "web",
        "recorder",
        "ros2",
    },
}
"""Of every topic."""


def covers(allowed: str, key: str) -> bool:
    return bool(zenoh.KeyExpr(allowed).includes(zenoh.KeyExpr(key)))


def key_of(topic: str, role: str) -> str:
    return (
        keys.TOPICS[topic]
        .replace("cam/*", "cam/front")
        .replace("progress/*", "progress/x")
        .replace("svc/*/*", f"svc/{role}/main")
    )


def test_every_topic_has_the_senders_that_it_is_meant_to_have_and_no_others() -> None:
    found = {
        topic: {
            role for role in ROLES
            if any(covers(allowed, key_of(topic, role)) for allowed in sent_by(role))
        }
        for topic in keys.TOPICS
    }  # fmt: skip
    assert found == SENDERS


def test_who_only_watches_changes_nothing() -> None:
    assert sent_by("watch") == ()
    assert keys.FOLLOW_TARGET not in ROLES["watch"].asks
    assert set(PEOPLE) == {"watch", "operate"}


def test_a_service_speaks_for_itself_alone() -> None:
    assert sent_by("tracker")[-1] == "svc/tracker/*/health"
    table = access_control({"tracker": "tracker"}, "usernames")
    tokens = [one for one in table["rules"] if "liveliness_token" in one["messages"]]
    assert [one["key_exprs"] for one in tokens if one["flows"] == ["ingress"]] == [
        ["alive/tracker/*"]
    ]


@pytest.mark.parametrize("namespace", ["", "robots/r1"])
def test_every_rule_is_one_of_the_robots_own_keys_and_zenoh_takes_the_tables(
    namespace: str,
) -> None:
    members = {f"{role}-1": role for role in ROLES}
    table = access_control(members, "cert_common_names", namespace, ("front", "back"))
    limits = size_limits(namespace)
    for rule in (*table["rules"], *limits):
        for key in rule["key_exprs"]:
            assert "**" not in key
            assert key.startswith(namespace)
    config = zenoh.Config()
    config.insert_json5("access_control", json.dumps(table))
    config.insert_json5("low_pass_filter", json.dumps(limits))
    assert table["default_permission"] == "deny"


def test_a_camera_that_is_named_lets_no_wildcard_in() -> None:
    table = access_control({"eye": "capture"}, "usernames", "", ("front",))
    sends = next(one for one in table["rules"] if one["id"] == "capture sends ingress")
    assert "cam/front/image" in sends["key_exprs"]
    assert not any(covers(allowed, "cam/*/image") for allowed in sends["key_exprs"])


def test_what_stops_the_robot_when_it_is_too_large_has_no_limit_at_the_router() -> None:
    limited = {key for one in size_limits() for key in one["key_exprs"]}
    assert not limited & {keys.FOLLOW_ESTOP, keys.ROBOT_RANGE, keys.ROBOT_ODOMETRY}
    assert keys.FOLLOW_COMMAND in limited
