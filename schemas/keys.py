"""Key expressions of every topic. The robot's name is Zenoh's `namespace` setting, never in here.

Keys are built from checked chunks only: a `*` in a camera's name would otherwise turn a topic
into a wildcard.
"""

from __future__ import annotations

import re

from heel.schemas.errors import KeyNameError

_CHUNK = re.compile(r"[a-z0-9_-]{1,64}")

FOLLOW_COMMAND = "follow/command"
FOLLOW_STATE = "follow/state"
FOLLOW_TARGET = "follow/target"
FOLLOW_POINTED = "follow/pointed"
FOLLOW_MANUAL = "follow/manual"
FOLLOW_ESTOP = "follow/estop"
ROBOT_ODOMETRY = "robot/odometry"
ROBOT_RANGE = "robot/range"
ROBOT_DRIVE = "robot/drive"
SIM_TRUTH = "sim/truth"
SIM_WORLD = "sim/world"
ROUTER_VERSION = "svc/router/main/version"
"""Heel's routers answer here which software they are, and on which host."""
ALL_HEALTH = "svc/*/*/health"
ALL_CONFIG = "svc/*/*/config"
ALL_SAVE = "svc/recorder/*/save"
ALL_ALIVE = "alive/*/*"
ALL_TRACKS = "cam/*/tracks"
TOPICS = {
    "image": "cam/*/image",
    "jpeg": "cam/*/jpeg",
    "depth": "cam/*/depth",
    "taken": "cam/*/taken",
    "info": "cam/*/info",
    "blobs": "cam/*/blobs",
    "tracks": ALL_TRACKS,
    "events": "cam/*/events",
    "progress": "cam/*/progress/*",
    "command": FOLLOW_COMMAND,
    "state": FOLLOW_STATE,
    "target": FOLLOW_TARGET,
    "pointed": FOLLOW_POINTED,
    "manual": FOLLOW_MANUAL,
    "estop": FOLLOW_ESTOP,
    "odometry": ROBOT_ODOMETRY,
    "range": ROBOT_RANGE,
    "drive": ROBOT_DRIVE,
    "truth": SIM_TRUTH,
    "world": SIM_WORLD,
    "health": ALL_HEALTH,
}
"""The key expression of every topic, by its short name: the last word of its key."""


def chunk(name: str, what: str = "name") -> str:
    """Return `name` if it may stand as one chunk of a key.

    Raises:
        KeyNameError: `name` is not 1 to 64 characters of `a-z 0-9 _ -`.
    """
    if not _CHUNK.fullmatch(name):
        shown = name if len(name) <= 80 else name[:77] + "..."
        raise KeyNameError(
            f"{what} {shown!r} cannot stand in a key: use 1 to 64 characters of a-z 0-9 _ -"
        )
    return name


def image(camera: str) -> str:
    """Raw pixels as payload, `Header` as attachment."""
    return f"cam/{chunk(camera, 'camera')}/image"


def jpeg(camera: str) -> str:
    """The same frames as `image`, as JPEG, for other hosts: sent while somebody listens."""
    return f"cam/{chunk(camera, 'camera')}/jpeg"


def depth(camera: str) -> str:
    """Distances of what `image` shows, `image/raw;depth16`, of some or all of its frames."""
    return f"cam/{chunk(camera, 'camera')}/depth"


def info(camera: str) -> str:
    """`CameraInfo`, latched."""
    return f"cam/{chunk(camera, 'camera')}/info"


def taken(camera: str) -> str:
    """`Taken`, one per frame of a live run, as soon as the frame is there."""
    return f"cam/{chunk(camera, 'camera')}/taken"


def blobs(camera: str) -> str:
    """`Blobs`, one per frame, also when empty."""
    return f"cam/{chunk(camera, 'camera')}/blobs"


def tracks(camera: str) -> str:
    """`Tracks`, one per frame, also when empty."""
    return f"cam/{chunk(camera, 'camera')}/tracks"


def events(camera: str) -> str:
    """`TrackEvent`, whenever the tracker finds out something about an identity."""
    return f"cam/{chunk(camera, 'camera')}/events"


def progress(camera: str, consumer: str) -> str:
    """`Progress` of one lossless consumer: the credit that lets capture send further frames."""
    return f"cam/{chunk(camera, 'camera')}/progress/{chunk(consumer, 'consumer')}"


def all_progress(camera: str) -> str:
    """Selector for the progress of every consumer."""
    return f"cam/{chunk(camera, 'camera')}/progress/*"


def snapshot(camera: str, service: str) -> str:
    """Queryable that answers with the `Snapshot` of the process that works for a camera."""
    return f"cam/{chunk(camera, 'camera')}/snapshot/{chunk(service, 'service')}"


def handover(camera: str, service: str) -> str:
    """Queryable that takes a `Handover` to another process that stands by."""
    return f"cam/{chunk(camera, 'camera')}/handover/{chunk(service, 'service')}"


def health(service: str, instance: str) -> str:
    """`Health`, four times a second."""
    return f"svc/{chunk(service, 'service')}/{chunk(instance, 'instance')}/health"


def config(service: str, instance: str) -> str:
    """Queryable that answers with the settings in force, as JSON."""
    return f"svc/{chunk(service, 'service')}/{chunk(instance, 'instance')}/config"


def save(instance: str) -> str:
    """Queryable of a recorder: writes what it holds to a file, and answers with its name."""
    return f"svc/recorder/{chunk(instance, 'instance')}/save"


def alive(service: str, instance: str) -> str:
    """Liveliness token: presence, not health."""
    return f"alive/{chunk(service, 'service')}/{chunk(instance, 'instance')}"
