"""Everything that crosses the wire, and nothing else: messages, keys, codec.

A service in another language needs only `heel schema` (the JSON Schema of every message) and
docs/reference/wire.md.
"""

from __future__ import annotations

from heel.schemas.base import Message
from heel.schemas.blobs import Blob, Blobs, CameraMotion, Evidence, Patch
from heel.schemas.codec import decode, encode
from heel.schemas.errors import HeelError, KeyNameError, MessageError, SettingsError, SourceError
from heel.schemas.follow import EStop, FollowState, MotionCommand, Pointed, Target, TargetRequest
from heel.schemas.frame import CameraInfo, EndOfStream, FrameId, Header, Progress, Stamp, Taken
from heel.schemas.health import Health
from heel.schemas.manual import Manual, ManualGrant, ManualRequest
from heel.schemas.robot import DriveState, Odometry, Ranges, RangeSector
from heel.schemas.simulation import Pose, SimObstacle, SimPerson, SimTruth, SimWorld
from heel.schemas.succession import Handover, Snapshot
from heel.schemas.tracks import Track, TrackEvent, Tracks

MESSAGES: tuple[type[Message], ...] = (
    Header, Stamp, Taken, CameraInfo, Blobs, Tracks, TrackEvent, MotionCommand, TargetRequest,
    Target, Pointed, Manual, ManualRequest, ManualGrant, EStop, FollowState, Odometry, Ranges,
    DriveState, SimTruth, SimWorld, Health, EndOfStream, Progress, Snapshot, Handover,
)  # fmt: skip
"""Every message type, in the order of the documentation."""

__all__ = [
    "MESSAGES", "Blob", "Blobs", "CameraInfo", "CameraMotion", "DriveState", "EStop",
    "EndOfStream", "Evidence", "FollowState", "FrameId", "Handover", "Header", "Health",
    "HeelError", "KeyNameError", "Manual", "ManualGrant", "ManualRequest", "Message",
    "MessageError", "MotionCommand", "Odometry", "Patch", "Pointed", "Pose", "Progress",
    "RangeSector", "Ranges", "SettingsError", "SimObstacle", "SimPerson", "SimTruth", "SimWorld",
    "Snapshot", "SourceError", "Stamp", "Taken", "Target", "TargetRequest", "Track", "TrackEvent",
    "Tracks", "decode", "encode",
]  # fmt: skip
