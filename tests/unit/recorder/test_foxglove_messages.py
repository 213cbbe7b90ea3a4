"""What Foxglove is given: pictures, the marks of films, poses and a log, in its own types."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from heel.schemas import (
    DriveState,
    FollowState,
    FrameId,
    Message,
    Odometry,
    Stamp,
    Target,
    Track,
    Tracks,
    encode,
    keys,
)
from heel.services.drawing import Trails, marks
from heel.services.foxglove_messages import LOG, POSE, TARGET, FoxgloveMessages, Shown
from heel.services.recorder.files import RecordingFile
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import SESSION, WALL_NS, image, jpeg

pytest.importorskip("foxglove")
STAMP = encode(Stamp(producer="tracker/main@00000001", t_sent_ns=1, age_ns=0))


def track(track_id: int, state: str = "tracked", **changed: object) -> Track:
    fields = {
        "id": track_id, "state": state, "box_xyxy": (8.0, 4.0, 20.0, 22.0), "span_px": 12.0,
        "velocity_pxps": (0.0, 0.0), "area_px": 216.0, "identity_confidence": 0.9, "shown": True,
        "missed_frames": 0 if state == "tracked" else 3,
    }  # fmt: skip
    return Track.model_validate(fields | changed)


def tracked(*people: Track, seq: int = 0) -> Tracks:
    frame = FrameId(stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=WALL_NS + seq)
    return Tracks(**frame.model_dump(), width=32, height=24, source_width=64, source_height=48,
                  tracks=people)  # fmt: skip


def state(name: str, reason: str, track_id: int | None = None, **more: object) -> FollowState:
    target = Target(seq=0, mode="id" if track_id else "none", track_id=track_id)
    fields = {"seq": 1, "state": name, "reason": reason, "estop": False, "linear_mps": 0.0,
              "angular_radps": 0.0, "target": target}  # fmt: skip
    return FollowState.model_validate(fields | more)


def of(made: FoxgloveMessages, key: str, said: Message, at_ns: int = WALL_NS) -> list[Shown]:
    return made.of(key, said.encoding(), encode(said), STAMP, at_ns)


def decoded(one: Shown) -> object:
    """By the schema that is given along, as any reader does."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    schema = one.kind.get_schema()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    return kind.FromString(one.data)


def test_a_picture_and_its_marks_have_the_time_of_their_frame() -> None:
    made = FoxgloveMessages()
    one = jpeg(3)
    (picture,) = made.of(one.key, one.encoding, one.payload, one.attachment, WALL_NS)
    read = decoded(picture)
    assert picture.topic == "/foxglove/cam/front/image"
    assert (read.data, read.format) == (one.payload, "jpeg")
    (drawn,) = of(made, keys.tracks("front"), tracked(track(7), seq=5))
    marks_read = decoded(drawn)
    assert marks_read.points[0].timestamp.seconds * 10**9 + marks_read.points[
        0
    ].timestamp.nanos == (WALL_NS + 5)


def test_a_raw_picture_is_a_jpeg_a_few_times_a_second() -> None:
    made = FoxgloveMessages()
    shown = []
    for seq in range(25):
        one = image(seq)
        shown += made.of(one.key, one.encoding, one.payload, one.attachment, one.logged_ns)
    assert len(shown) == 5
    read = cv2.imdecode(np.frombuffer(decoded(shown[0]).data, np.uint8), cv2.IMREAD_COLOR)
    assert read is not None
    assert read.shape == (24, 32, 3)


def test_the_marks_are_those_of_the_film() -> None:
    people = (track(7), track(8, "lost", identity_confidence=0.3), track(9, "new", shown=False))
    made = FoxgloveMessages()
    of(made, keys.FOLLOW_STATE, state("following", "in sight", 7))
    (drawn,) = of(made, keys.tracks("front"), tracked(*people))
    read = decoded(drawn)
    wanted = marks(tracked(*people), 7)
    assert [one.text for one in read.texts] == [one.label for one in wanted] == ["7", "8 lost ?"]
    loops = [one for one in read.points if one.type == 2]
    assert len(loops) == 2, "the box of id 7, and the target's around it"
    box = [(p.x, p.y) for p in loops[0].points]
    assert box == [(8, 4), (20, 4), (20, 22), (8, 22)]
    colour = loops[0].outline_color
    assert (colour.r, colour.g, colour.b) == pytest.approx(wanted[0].rgb)
    assert (loops[1].points[0].x, loops[1].points[0].y) == (4, 0)


def test_a_trail_grows_and_ends() -> None:
    trails = Trails()
    (mark,) = marks(tracked(track(7)), None)
    lengths = [len(trails.add(mark)) for _ in range(60)]
    assert lengths[:3] == [1, 2, 3]
    assert lengths[-1] == 40


def test_the_log_tells_changes_once() -> None:
    made = FoxgloveMessages()
    shown = []
    for name, why in [("idle", "no target")] * 3 + [("unsure", "two alike")] * 2:
        shown += of(made, keys.FOLLOW_STATE, state(name, why))
    drive = DriveState(seq=1, state="stopped", reason="no command", estop=False, driver="log",
                       linear_mps=0.0, angular_radps=0.0)  # fmt: skip
    shown += of(made, keys.ROBOT_DRIVE, drive) + of(made, keys.ROBOT_DRIVE, drive)
    told = [(one.topic, decoded(one).message) for one in shown]
    assert told == [
        (LOG, "idle: no target"), (LOG, "unsure: two alike"), (LOG, "stopped: no command"),
    ]  # fmt: skip


def test_the_robot_and_its_target_have_poses() -> None:
    made = FoxgloveMessages()
    odometry = Odometry(seq=1, x_m=1.0, y_m=-2.0, heading_rad=math.pi / 2, linear_mps=0.0,
                        angular_radps=0.0)  # fmt: skip
    (pose,) = of(made, keys.ROBOT_ODOMETRY, odometry)
    read = decoded(pose)
    assert pose.topic == POSE
    assert (read.pose.position.x, read.pose.position.y) == (1.0, -2.0)
    assert read.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    said = state("following", "in sight", 7, distance_m=2.0, bearing_rad=math.pi / 2)
    place = [one for one in of(made, keys.FOLLOW_STATE, said) if one.topic == TARGET]
    assert decoded(place[0]).pose.position.y == pytest.approx(2.0)


@pytest.mark.parametrize("cut", [0, 1, 7])
def test_what_cannot_be_decoded_is_nothing(cut: int) -> None:
    made = FoxgloveMessages()
    said = tracked(track(7))
    assert made.of("cam/front/tracks", said.encoding(), encode(said)[:cut], STAMP, 0) == []
    one = image(1)
    assert made.of(one.key, one.encoding, one.payload[:cut], one.attachment, 0) == []
    assert made.of(one.key, one.encoding, one.payload, b"", 0) == []
    assert made.of("x", "text/plain", b"go", None, 0) == []


def test_a_recording_holds_both_and_gives_the_wire_back_as_it_was(tmp_path: Path) -> None:
    messages = [one for seq in range(5) for one in (
        jpeg(seq), WireMessage(keys.tracks("front"), Tracks.encoding(),
                               encode(tracked(track(7), seq=seq)), STAMP, WALL_NS + seq),
    )]  # fmt: skip
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, SESSION, "heel test", FoxgloveMessages())
    for message in messages:
        file.add(message)
    file.close()
    assert list(wire_messages(Recording(path))) == messages
    with path.open("rb") as content:
        found = list(make_reader(content, validate_crcs=True).iter_messages())
    beside = [one for one in found if one[1].topic.startswith("/foxglove")]
    kinds = {schema.name: (schema.encoding, channel.message_encoding)
             for schema, channel, _ in beside if schema}  # fmt: skip
    assert kinds == dict.fromkeys(
        ("foxglove.CompressedImage", "foxglove.ImageAnnotations"), ("protobuf", "protobuf")
    )
    pictures = [m for s, _, m in found if s and s.name == "foxglove.CompressedImage"]
    assert len(pictures) == 5
