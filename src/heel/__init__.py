"""Person following for robots: one camera, CPU only.

    import heel

    for frame in heel.open("walk.mp4"):
        for person in frame.people:
            print(frame.time_s, person.id, person.box_xyxy, person.identity_confidence)
        print(frame.command.linear_mps, frame.command.angular_radps)

Everything in `__all__` is loaded when it is first used, so that `import heel` itself takes no time:
NumPy, OpenCV and SciPy come with `heel.open`, Zenoh with none of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from heel.api import (
        DetectorSettings,
        Follower,
        FollowerSettings,
        Frame,
        Image,
        TargetChoice,
        Tracker,
        TrackerSettings,
        Video,
        open,
        track,
    )
    from heel.schemas import (
        MESSAGES,
        Blob,
        Blobs,
        CameraInfo,
        CameraMotion,
        DriveState,
        EndOfStream,
        EStop,
        Evidence,
        FollowState,
        FrameId,
        Handover,
        Header,
        Health,
        HeelError,
        KeyNameError,
        Manual,
        ManualGrant,
        ManualRequest,
        Message,
        MessageError,
        MotionCommand,
        Odometry,
        Patch,
        Pointed,
        Pose,
        Progress,
        Ranges,
        RangeSector,
        SettingsError,
        SimObstacle,
        SimPerson,
        SimTruth,
        SimWorld,
        Snapshot,
        SourceError,
        Stamp,
        Taken,
        Target,
        TargetRequest,
        Track,
        TrackEvent,
        Tracks,
        decode,
        encode,
    )

    __version__: str

_API_NAMES = frozenset({
    "DetectorSettings", "Follower", "FollowerSettings", "Frame", "Image", "TargetChoice", "Tracker",
    "TrackerSettings", "Video", "open", "track",
})  # fmt: skip
"""Names of `heel.api`; the others are those of `heel.schemas`."""
__all__ = [
    "MESSAGES", "Blob", "Blobs", "CameraInfo", "CameraMotion", "DetectorSettings", "DriveState",
    "EStop", "EndOfStream", "Evidence", "FollowState", "Follower", "FollowerSettings", "Frame",
    "FrameId", "Handover", "Header", "Health", "HeelError", "Image", "KeyNameError", "Manual",
    "ManualGrant", "ManualRequest", "Message", "MessageError", "MotionCommand", "Odometry",
    "Patch", "Pointed", "Pose", "Progress", "RangeSector", "Ranges", "SettingsError",
    "SimObstacle", "SimPerson", "SimTruth", "SimWorld", "Snapshot", "SourceError", "Stamp",
    "Taken", "Target", "TargetChoice", "TargetRequest", "Track", "TrackEvent", "Tracker",
    "TrackerSettings", "Tracks", "Video", "__version__", "decode", "encode", "open", "track",
]  # fmt: skip

if not TYPE_CHECKING:  # a checker would take every misspelt name for an attribute

    def __getattr__(name: str) -> object:
        """Load what is used (PEP 562)."""
        from importlib import import_module, metadata

        if name not in __all__:
            raise AttributeError(f"module 'heel' has no attribute {name!r}")
        if name == "__version__":
            found: object = metadata.version("heel-follow")
        else:
            home = import_module("heel.api" if name in _API_NAMES else "heel.schemas")
            found = getattr(home, name)
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
