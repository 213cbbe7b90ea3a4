"""Which role may send, hear, answer and ask what. Everything else is refused by the router."""

from __future__ import annotations

from dataclasses import dataclass

from heel.schemas import keys

_INFO, _WORLD = keys.TOPICS["info"], keys.SIM_WORLD
_IMAGES = (keys.TOPICS["image"], keys.TOPICS["jpeg"])
_DEPTH = keys.TOPICS["depth"]
_PICTURES = (*_IMAGES, _DEPTH, keys.TOPICS["taken"], _INFO)
_PROGRESS = keys.TOPICS["progress"]
_SEEN = tuple(keys.TOPICS.values())


@dataclass(frozen=True, slots=True)
class Access:
    """What one role may do, each as key expressions of Zenoh.

    Attributes:
        purpose: of the role, in a few words.
        sends: messages of these keys.
        hears: messages of these keys.
        answers: questions on these keys.
        asks: on these keys.
        service: whether it is a service: it has a token, health and a configuration of its own.
    """

    purpose: str
    sends: tuple[str, ...] = ()
    hears: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()
    asks: tuple[str, ...] = ()
    service: bool = True


def _succession(service: str) -> tuple[str, str]:
    """What a process that takes over from another one of its kind asks it."""
    return f"cam/*/snapshot/{service}", f"cam/*/handover/{service}"


_LOOKING = Access(
    "look at everything, and change nothing",
    hears=_SEEN,
    asks=(keys.FOLLOW_STATE, _INFO, _WORLD, keys.ALL_CONFIG, keys.ROUTER_VERSION),
    service=False,
)
ROLES: dict[str, Access] = {
    "capture": Access(
        "send the pictures of a camera",
        sends=_PICTURES, hears=(_PROGRESS,), answers=(_INFO,),
    ),
    "detector": Access(
        "find people in pictures",
        sends=(keys.TOPICS["blobs"], _PROGRESS),
        hears=(*_IMAGES, _INFO, keys.ALL_TRACKS, keys.FOLLOW_POINTED, keys.TOPICS["blobs"]),
        answers=_succession("detector"),
        asks=(_INFO, keys.ROUTER_VERSION, *_succession("detector")),
    ),
    "tracker": Access(
        "give people identities",
        sends=(keys.ALL_TRACKS, keys.TOPICS["events"]),
        hears=(keys.TOPICS["blobs"], keys.ALL_TRACKS, _DEPTH, _INFO),
        answers=_succession("tracker"),
        asks=(_INFO, keys.ROUTER_VERSION, *_succession("tracker")),
    ),
    "follower": Access(
        "command the robot",
        sends=(keys.FOLLOW_COMMAND, keys.FOLLOW_STATE, keys.FOLLOW_TARGET, keys.FOLLOW_POINTED,
               keys.FOLLOW_ESTOP),
        hears=(keys.ALL_TRACKS, _INFO, keys.TOPICS["taken"], keys.ROBOT_RANGE, keys.ROBOT_ODOMETRY,
               keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL, keys.FOLLOW_COMMAND, keys.FOLLOW_STATE),
        answers=(keys.FOLLOW_TARGET, keys.FOLLOW_STATE, keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL,
                 *_succession("follower")),
        asks=(_INFO, keys.FOLLOW_TARGET, keys.FOLLOW_STATE, keys.FOLLOW_ESTOP,
              *_succession("follower")),
    ),
    "drive": Access(
        "turn the wheels, and tell how far they went",
        sends=(keys.ROBOT_DRIVE, keys.ROBOT_ODOMETRY, keys.FOLLOW_ESTOP),
        hears=(keys.FOLLOW_COMMAND, keys.FOLLOW_ESTOP, keys.ROBOT_DRIVE),
        answers=(keys.FOLLOW_ESTOP,),
        asks=(keys.FOLLOW_ESTOP,),
    ),
    "sensor": Access(
        "a program of your own that measures free distances", sends=(keys.ROBOT_RANGE,),
    ),
    "simulator": Access(
        "be camera, wheels' odometry and range sensor of a world that is not there",
        sends=(*_PICTURES, keys.TOPICS["blobs"], keys.ROBOT_ODOMETRY, keys.ROBOT_RANGE,
               keys.SIM_TRUTH, _WORLD),
        hears=(keys.ROBOT_DRIVE, _PROGRESS),
        answers=(_INFO, _WORLD),
    ),
    "ros2": Access(
        "be camera, odometry, ranges and wheels of a robot that speaks ROS 2",
        sends=(*_PICTURES, keys.ROBOT_ODOMETRY, keys.ROBOT_RANGE, keys.FOLLOW_ESTOP),
        hears=(keys.ROBOT_DRIVE, keys.FOLLOW_STATE, keys.ALL_TRACKS, keys.ALL_HEALTH, _PROGRESS),
        answers=(_INFO, keys.FOLLOW_ESTOP),
        asks=(_INFO,),
    ),
    "web": Access(
        "serve the page: show everything, choose, drive, stop and release for its users",
        sends=(keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL, _PROGRESS),
        hears=_SEEN,
        answers=(keys.FOLLOW_ESTOP,),
        asks=(keys.FOLLOW_TARGET, keys.FOLLOW_STATE, keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL, _WORLD,
              _INFO,
              keys.ROUTER_VERSION),
    ),
    "recorder": Access(
        "keep everything on disk",
        hears=_SEEN,
        answers=(keys.ALL_SAVE,),
        asks=(*_LOOKING.asks, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP),
    ),
    "watch": _LOOKING,
    "operate": Access(
        "look at everything, choose, drive by hand, stop and release",
        sends=(keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL),
        hears=_SEEN,
        asks=(*_LOOKING.asks, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP, keys.FOLLOW_MANUAL,
              keys.ALL_SAVE,
              "cam/*/handover/*"),
        service=False,
    ),
}  # fmt: skip
"""Every role but the router's own."""
SERVICES = tuple(name for name, access in ROLES.items() if access.service and name != "sensor")
"""Roles that are Heel's own services, one certificate each."""
PEOPLE = tuple(name for name, access in ROLES.items() if not access.service)
"""Roles of people and of the commands that they type."""


def sent_by(role: str) -> tuple[str, ...]:
    """All that a role may send, what every service says of itself included."""
    access = ROLES[role]
    return (*access.sends, f"svc/{role}/*/health") if access.service else access.sends
