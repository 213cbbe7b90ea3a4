"""One fully filled example of every message; the golden files hold exactly these.

`python -m tests.unit.schemas.examples` writes the golden bytes of the messages anew, for a change
of the wire that is meant.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

from heel.schemas import (
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
    Manual,
    ManualGrant,
    ManualRequest,
    Message,
    MotionCommand,
    Odometry,
    Patch,
    Pointed,
    Pose,
    Progress,
    Ranges,
    RangeSector,
    SimObstacle,
    SimPerson,
    SimTruth,
    SimWorld,
    Snapshot,
    Stamp,
    Taken,
    Target,
    TargetRequest,
    Track,
    TrackEvent,
    Tracks,
    encode,
)
from heel.schemas.frame import LensModel

GOLDEN = Path(__file__).parent / "golden"
PRODUCER = "detector/main@0123abcd"
FRAME: dict[str, Any] = {
    "stream": "front",
    "epoch": 2**63 - 1,
    "seq": 41,
    "index": 42,
    "t_capture_ns": 1_700_000_000_123_456_789,
}
SIZE = {"width": 3, "height": 2, "source_width": 6, "source_height": 4}

# Written out as a stored block: how well zlib compresses differs between its versions.
_PLANES = bytes([0b10100000, 0b01000000])
_ZLIB = b"\x78\x01\x01\x02\x00\xfd\xff" + _PLANES + zlib.adler32(_PLANES).to_bytes(4, "big")
EVIDENCE = Evidence(width=3, height=2, data=_ZLIB)
EVIDENCE_ROWS = [[2, 1, 2], [0, 0, 0]]

RAW_PIXELS = bytes(range(18))

_TARGET = Target(seq=3, mode="id", track_id=7, tracker="tracker/main@00ff00ff", reason="chosen")

_POSE = Pose(x_m=1.0, y_m=-2.0, heading_rad=0.75)

EXAMPLES: tuple[Message, ...] = (
    Header(
        **FRAME, **SIZE, image_encoding="image/raw;bgr8", producer="capture/main@89abcdef",
        age_ns=1_500_000,
    ),
    Stamp(
        producer=PRODUCER, t_sent_ns=1_700_000_000_200_000_000, age_ns=12_345_678,
        line="tracker/first@00000001", turn=2, successor="tracker/next@00000002",
    ),
    Taken(
        stream="front", epoch=5, seq=41, clock="0123abcd-4026531834", monotonic_ns=123_456_789_012,
    ),
    CameraInfo(
        stream="front", epoch=5, **SIZE, fps=25.0, frame_count=795, source="walk.avi",
        horizontal_fov_rad=1.0471975511965976, mount_height_m=0.5, mount_pitch_rad=-0.25,
        lens=LensModel(
            model="equidistant", focal_px=(2.5, 2.75), centre_px=(1.5, 1.0),
            coefficients=(-0.25, 0.125),
        ),
        mount_yaw_rad=3.0,
        host="0a1b2c3d-0000-4000-8000-00000000beef-4026531834",
        depth=True,
    ),
    Blobs(
        **FRAME, **SIZE,
        blobs=(
            Blob(
                box_xyxy=(0.0, 0.5, 2.0, 2.0), area_px=2.5, centroid=(1.0, 1.25),
                patch=Patch(width=2, height=1, bgr=b"\x01\x02\x03\xfd\xfe\xff"),
                score=0.875, proven=False,
            ),
        ),
        kind="people", sought=3,
        blobs_left_out=1, evidence=EVIDENCE,
        camera_motion=CameraMotion(affine=(1.0, 0.0, -2.5, 0.0, 1.0, 0.75), quality=0.875),
        detector="mog2", background="learning", background_reason="started", protected_seq=39,
    ),
    Tracks(
        **FRAME, **SIZE,
        tracks=(
            Track(
                id=7, state="tracked", box_xyxy=(0.0, 0.0, 1.5, 2.0), velocity_pxps=(-3.5, 0.25),
                area_px=3.0, span_px=1.5, identity_confidence=0.75, runner_up_confidence=0.125,
                occluded_by=(8,), missed_frames=0, shown=True, distance_m=2.5,
                distance_sigma_m=0.25, bearing_rad=0.125, bearing_sigma_rad=0.0625,
            ),
            Track(
                id=8, state="lost", box_xyxy=(1.0, 0.0, 3.0, 2.0), velocity_pxps=(0.0, 0.0),
                area_px=4.0, span_px=2.0, identity_confidence=0.5, missed_frames=3, shown=False,
                proven=False,
            ),
        ),
        occlusion=True,
        camera_motion=CameraMotion(affine=(1.0, 0.0, 2.5, 0.0, 1.0, -0.5), quality=0.75),
    ),
    TrackEvent(
        frame=FrameId(**FRAME), kind="given up", ids=(7, 9), text="id 7 is given up (2.0 % left)"
    ),
    MotionCommand(
        seq=9, linear_mps=0.5, angular_radps=-0.25, ttl_s=0.5, state="following",
        reason="target in sight", frame=FrameId(**FRAME), manual=True,
    ),
    TargetRequest(mode="point", x_px=1.5, y_px=0.5, tracker="tracker/main@00ff00ff"),
    _TARGET,
    Pointed(frame=FrameId(**FRAME), width=640, height=480, x_px=320.5, y_px=200.25),
    Manual(grant="0123456789abcdef", seq=4, held=True, forward=0.5, left=-0.25, ttl_s=0.25),
    ManualRequest(take=True, source="web/main@00ff00ff 192.0.2.7"),
    ManualGrant(grant="0123456789abcdef", source="web/main@00ff00ff 192.0.2.7"),
    EStop(
        engaged=True, source="web", t_ns=1_700_000_000_000_000_000, id="0123456789abcdef",
    ),
    FollowState(
        seq=10, state="stopped", reason="emergency stop", estop=True, target=_TARGET,
        tracks_age_s=0.0625, linear_mps=0.0, angular_radps=0.0, distance_m=2.5, bearing_rad=-0.125,
        identity_confidence=0.75, runner_up_confidence=0.125, speed_reason="obstacle ahead",
        pending_point_px=(320.5, 200.25), pending_for_s=4.5, obstacle_watch=True,
        free_distance_m=1.25, nearest_person_m=1.75, driven_by="a page",
    ),
    Odometry(
        seq=5, x_m=1.5, y_m=-0.25, heading_rad=0.5, linear_mps=0.75, angular_radps=-0.125,
    ),
    Ranges(
        seq=6,
        sectors=(
            RangeSector(bearing_rad=-0.5, width_rad=0.25, distance_m=3.5),
            RangeSector(bearing_rad=0.5, width_rad=0.25, distance_m=0.75),
        ),
    ),
    DriveState(
        seq=7, state="stopped", reason="no command for 0.5 s", estop=False, driver="simulated",
        linear_mps=0.0, angular_radps=0.0, command_seq=9, command_age_s=0.5625,
    ),
    SimTruth(
        seq=41, t_s=2.75, robot=_POSE, robot_radius_m=0.25, linear_mps=0.5, angular_radps=-0.25,
        people=(
            SimPerson(
                id=1, role="target", pose=_POSE, speed_mps=1.25, height_m=1.75, radius_m=0.25,
                box_xyxy=(0.5, 0.0, 1.5, 2.0), visible=0.5,
            ),
        ),
        contact=1,
    ),
    SimWorld(
        scenario="pillar", seed=11, bounds_m=(-5.0, -4.0, 5.0, 4.0),
        obstacles=(
            SimObstacle(pose=_POSE, length_m=0.5, width_m=0.25, height_m=2.5, kind="pillar"),
        ),
    ),
    Health(
        service="detector", instance="main", producer=PRODUCER, state="degraded",
        reason="two producers", uptime_s=12.5, input_age_s=0.03125, loop_age_s=0.015625,
        rate_in_hz=25.0, rate_out_hz=24.5, received=300, sent=299, dropped=2, malformed=1,
        busy_ms_p50=8.0, busy_ms_p95=9.5, busy_ms_p99=11.0, age_ms_p50=12.0, age_ms_p95=14.0,
        age_ms_p99=20.0, shared_memory=True, cpu_s=3.5, rss_mb=120.5, peak_rss_mb=130.0,
        software_version="0.1.0", period_s=0.25, details={"background": "valid"},
    ),
    EndOfStream(stream="front", epoch=5, frames=795, reason="end of walk.avi"),
    Progress(stream="front", epoch=5, seq=794),
    Snapshot(
        service="tracker", producer=PRODUCER, line="tracker/first@00000001", turn=2,
        frame=FrameId(**FRAME), state=b"\x00\x01\xff",
    ),
    Handover(successor="tracker/next@00000002"),
)  # fmt: skip


def golden_bytes(name: str) -> bytes:
    """The bytes kept for a message, an image payload or a JPEG."""
    return bytes.fromhex((GOLDEN / f"{name}.hex").read_text())


if __name__ == "__main__":
    for example in EXAMPLES:
        text = encode(example).hex()
        lines = [text[start : start + 96] for start in range(0, len(text), 96)]
        (GOLDEN / f"{example.schema_name}.hex").write_text("\n".join([*lines, ""]))
