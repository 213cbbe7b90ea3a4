"""The last seconds stay within their bounds, and what happens to the robot asks for them."""

from __future__ import annotations

from heel.schemas import (
    DriveState,
    EStop,
    FollowState,
    FrameId,
    Message,
    Target,
    TrackEvent,
    encode,
    keys,
)
from heel.schemas.follow import FollowStateName
from heel.services.recorder.events import EventWatch
from heel.services.recorder.ring import Ring
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import image, info, tracks


def said(key: str, message: Message) -> WireMessage:
    return WireMessage(key, message.encoding(), encode(message), None, 0)


def state(name: FollowStateName, estop: bool = False, target: int | None = 3) -> WireMessage:
    return said(keys.FOLLOW_STATE, FollowState(
        seq=1, state=name, reason="", estop=estop, target=Target(seq=1, mode="id", track_id=target),
        linear_mps=0.0, angular_radps=0.0,
    ))  # fmt: skip


def drive(estop: bool) -> WireMessage:
    return said(keys.ROBOT_DRIVE, DriveState(
        seq=1, state="stopped", reason="", estop=estop, driver="log", linear_mps=0.0,
        angular_radps=0.0,
    ))  # fmt: skip


def contact(*ids: int) -> WireMessage:
    frame = FrameId(stream="front", epoch=1, seq=1, index=1, t_capture_ns=1)
    event = TrackEvent(frame=frame, kind="contact", ids=ids, text="come into contact")
    return said(keys.events("front"), event)


def test_a_ring_holds_the_last_seconds_and_what_was_latched_before() -> None:
    ring = Ring(2.0, 10**9)
    ring.add(info())
    for seq in range(250):
        ring.add(tracks(seq))
    assert ring.seconds == 2.0
    assert not ring.crowded
    found = ring.take_all()
    assert found[0] == info()
    assert found[1:] == [tracks(seq) for seq in range(199, 250)]
    assert ring.take_all() == [info()], "two files do not overlap"


def test_a_ring_never_holds_more_bytes_than_it_may() -> None:
    ring = Ring(60.0, 50_000)
    for seq in range(100):
        ring.add(image(seq))
        assert ring.bytes <= 50_000
    assert ring.crowded
    found = ring.take_all()
    assert len(found) > 10
    assert found == [image(seq) for seq in range(100 - len(found), 100)]


def test_an_emergency_stop_is_an_event_once() -> None:
    watch = EventWatch()
    pressed = EStop(engaged=True, source="page", id="ab")
    assert watch.take(said(keys.FOLLOW_ESTOP, pressed)) == "estop"
    assert watch.take(said(keys.FOLLOW_ESTOP, pressed)) is None
    release = pressed.model_copy(update={"engaged": False})
    assert watch.take(said(keys.FOLLOW_ESTOP, release)) is None
    assert watch.take(said(keys.FOLLOW_ESTOP, pressed)) == "estop"
    assert [watch.take(drive(one)) for one in (False, True, True, False, True)] == [
        None, "estop", None, None, "estop",
    ]  # fmt: skip


def test_doubt_is_an_event_when_it_begins() -> None:
    watch = EventWatch()
    names: list[FollowStateName] = ["following", "unsure", "unsure", "following", "unsure"]
    assert [watch.take(state(one)) for one in names] == [None, "unsure", None, None, "unsure"]


def test_only_contacts_of_the_person_that_is_followed_are_events() -> None:
    watch = EventWatch()
    assert watch.take(contact(3, 4)) is None, "nobody is followed"
    watch.take(state("following", target=3))
    assert watch.take(contact(1, 2)) is None
    assert watch.take(contact(2, 3)) == "contact"


def test_bytes_that_are_no_message_are_no_event() -> None:
    broken = WireMessage(keys.FOLLOW_STATE, FollowState.encoding(), b"\xc1", None, 0)
    assert EventWatch().take(broken) is None
