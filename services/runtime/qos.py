"""Quality of service of every topic, in one table.

Nothing that a live run sends may wait for a receiver that takes no part in it. A router passes a
message on to its receivers one after the other: with BLOCK, one viewer that is frozen or has left
the network held up all behind it for 5 s, the emergency stop included, and with BLOCK_FIRST
the frames (measured: no commands for 3 to 5 s). So everything is DROP, which gives up after 1 ms
and from then on at once, and what must arrive is said again: an e-stop until the drive confirms,
what is latched whenever it is asked for. What is sent seldom is never dropped for being behind
frames: every priority has a queue of its own.

Frames leave capture as BLOCK_FIRST, since DROP starves large ones on a slow first link; the router
passes them on as DROP (`ROUTER_RULES`). Receivers are ring channels: a full FIFO blocks the receive
thread of the whole link, e-stop included (measured: a stop message 2 to 4 s late behind a FIFO of 4
frames).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import zenoh

from heel.schemas import (
    Blobs,
    CameraInfo,
    DriveState,
    EStop,
    FollowState,
    Health,
    Manual,
    MotionCommand,
    Odometry,
    Pointed,
    Progress,
    Ranges,
    SimTruth,
    SimWorld,
    Taken,
    Target,
    TrackEvent,
    Tracks,
)
from heel.schemas.image import MAX_IMAGE_BYTES

Delivery = Literal["live", "lossless"]
LOSSLESS_WINDOW_FRAMES = 4
"""Frames in flight in a lossless run; credits keep the sender within it. The detector works at most
three frames ahead of the last tracks and the next frame waits for it: more are no faster."""
LOSSLESS_CAPACITY = 16 * LOSSLESS_WINDOW_FRAMES
"""Ring size of lossless receivers: never reached while senders respect the window."""


@dataclass(frozen=True, slots=True)
class TopicQos:
    """How one topic is sent and received."""

    priority: zenoh.Priority
    congestion: zenoh.CongestionControl
    express: bool
    capacity: int
    """Messages kept for a receiver that is behind; the oldest go first."""
    max_bytes: int
    best_effort: bool = False
    """Over UDP and QUIC a datagram, lost rather than late; over TCP like all else."""

    @property
    def reliability(self) -> zenoh.Reliability:
        """As Zenoh names it."""
        kinds = zenoh.Reliability
        return kinds.BEST_EFFORT if self.best_effort else kinds.RELIABLE

    def for_delivery(self, delivery: Delivery) -> TopicQos:
        """The same topic when nothing may be lost."""
        if delivery == "live":
            return self
        return TopicQos(
            self.priority, _BLOCK, self.express, LOSSLESS_CAPACITY, self.max_bytes
        )  # fmt: skip


_DROP = zenoh.CongestionControl.DROP
_BLOCK = zenoh.CongestionControl.BLOCK
_BLOCK_FIRST = zenoh.CongestionControl.BLOCK_FIRST
_P = zenoh.Priority

# Priority; what happens when the link is full; express; how many a receiver that is behind keeps,
# one where only the newest counts; largest message, bytes; best effort where the next message makes
# up for a lost one sooner than repeating it would.
IMAGE = TopicQos(_P.DATA_LOW, _BLOCK_FIRST, True, 1, MAX_IMAGE_BYTES)
JPEG = IMAGE  # the same frames for other hosts
DEPTH = TopicQos(_P.DATA_LOW, _BLOCK_FIRST, True, 4, MAX_IMAGE_BYTES)  # of several frames
TAKEN = TopicQos(_P.REAL_TIME, _DROP, True, 64, Taken.max_bytes)
BLOBS = TopicQos(_P.DATA_HIGH, _DROP, True, 2, Blobs.max_bytes)
TRACKS = TopicQos(_P.DATA_HIGH, _DROP, True, 2, Tracks.max_bytes)
COMMAND = TopicQos(_P.REAL_TIME, _DROP, True, 1, MotionCommand.max_bytes, True)
ESTOP = TopicQos(_P.REAL_TIME, _DROP, True, 64, EStop.max_bytes)
"""A deep ring: a flood of releases must not push a stop out of it."""
# Ahead of images, behind what drives; the columns are those above.
INFO = TopicQos(_P.INTERACTIVE_HIGH, _DROP, False, 8, CameraInfo.max_bytes)
STATE = TopicQos(_P.INTERACTIVE_HIGH, _DROP, False, 8, FollowState.max_bytes)
TARGET = TopicQos(_P.INTERACTIVE_HIGH, _DROP, False, 8, Target.max_bytes)
POINTED = TopicQos(_P.INTERACTIVE_HIGH, _DROP, False, 1, Pointed.max_bytes)
MANUAL = TopicQos(_P.REAL_TIME, _DROP, True, 1, Manual.max_bytes, True)
PROGRESS = TopicQos(_P.INTERACTIVE_HIGH, _BLOCK, True, LOSSLESS_CAPACITY, Progress.max_bytes)
# Of the robot and of a simulated world; the columns are those above.
ODOMETRY = TopicQos(_P.DATA_HIGH, _DROP, True, 1, Odometry.max_bytes, True)
RANGES = TopicQos(_P.DATA_HIGH, _DROP, True, 1, Ranges.max_bytes)
DRIVE = TopicQos(_P.REAL_TIME, _DROP, True, 1, DriveState.max_bytes, True)
SIM_TRUTH = TopicQos(_P.DATA, _DROP, False, 2, SimTruth.max_bytes)
SIM_WORLD = TopicQos(_P.INTERACTIVE_HIGH, _DROP, False, 2, SimWorld.max_bytes)
EVENTS = TopicQos(_P.DATA, _DROP, False, 16, TrackEvent.max_bytes)
HEALTH = TopicQos(_P.DATA, _DROP, False, 64, Health.max_bytes)
"""Ahead of images: a service must not look silent because its link is full of pictures."""
BY_TOPIC = {
    "image": IMAGE, "jpeg": JPEG, "depth": DEPTH, "taken": TAKEN, "info": INFO, "blobs": BLOBS,
    "tracks": TRACKS,
    "events": EVENTS, "progress": PROGRESS, "command": COMMAND, "state": STATE, "target": TARGET,
    "pointed": POINTED, "manual": MANUAL, "estop": ESTOP, "odometry": ODOMETRY, "range": RANGES,
    "drive": DRIVE, "truth": SIM_TRUTH, "world": SIM_WORLD, "health": HEALTH,
}  # fmt: skip
"""The same by the names of `keys.TOPICS`."""

_CONTROL_KEYS = ("**/follow/estop", "**/follow/state", "**/follow/target", "**/follow/pointed",
                 "**/follow/manual",
                 "**/cam/*/info", "**/cam/*/taken", "**/cam/*/events", "**/robot/*",
                 "**/sim/*", "**/svc/**")  # fmt: skip
ROUTER_RULES: list[dict[str, object]] = [
    {
        "id": "live frames",
        "messages": ["put"],
        "key_exprs": ["**"],
        "qos": {"congestion_control": "block_first"},
        "overwrite": {"congestion_control": "drop"},
        "flows": ["egress"],
    },
    {
        "id": "control",
        "messages": ["put", "delete"],
        "key_exprs": list(_CONTROL_KEYS),
        "overwrite": {"congestion_control": "drop"},
        "flows": ["egress"],
    },
    {
        "id": "questions",
        "messages": ["query"],
        "key_exprs": ["**"],
        "overwrite": {"congestion_control": "drop"},
        "flows": ["egress"],
    },
]
"""What a live robot's router makes of messages of any sender: other people's senders use
BLOCK, and Zenoh's own questions do (an answer goes as its question came). What only a lossless run
sends with BLOCK stays as it is."""
ROUTER_QUEUES = {"real_time": 16, "interactive_high": 8, "data_low": 16}
"""Batches of 64 kB towards a client, taken when needed; 16 are the most. Zenoh's two are full of
commands within 40 ms, and a stop that finds them so is dropped: on a busy machine a router does not
always get round to sending in that time (seen at a load of ten a core). Frames have room for those
on their way as JPEG (`jpeg_window`): one that finds too little is dropped when half of it is sent
(measured at 20 Mbit/s: a link full of halves)."""
ROUTER_WAIT_BEFORE_CLOSE_US = 1_000_000
"""What is left with BLOCK, declarations and ends of streams, holds others up so long at most;
Zenoh's own 5 s are more than a session's lease. Chosen by hand."""
