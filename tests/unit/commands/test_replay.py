"""What is sent again of a recording, when, and what never is."""

from __future__ import annotations

import pytest

from heel.schemas import CameraInfo, FrameId, encode, keys
from heel.schemas.errors import SettingsError
from heel.services.commands.recording.replay import (
    SEEN,
    Window,
    as_replayed,
    due,
    fits,
    for_lossless,
    selection,
)
from heel.services.recordings.wire import WireMessage
from heel.services.runtime.qos import BY_TOPIC
from tests.support.recordings import WALL_NS, image, info, tracks


def other(key: str) -> WireMessage:
    return WireMessage(key, "text/plain", b"", None, WALL_NS)


def test_messages_are_due_as_they_came_and_faster_by_a_factor() -> None:
    messages = [other("svc/a/main/health"), info(), image(1), tracks(1, at_ms=55), image(2)]
    found = list(due(messages, selection(None), 1.0))
    assert [message for _, _, message in found] == messages[1:]
    assert [topic for _, topic, _ in found] == ["info", "image", "tracks", "image"]
    assert [at_s for at_s, _, _ in found] == pytest.approx([0.0, 0.04, 0.055, 0.08])
    twice = list(due(messages, selection("image"), 2.0))
    assert [at_s for at_s, _, _ in twice] == pytest.approx([0.0, 0.02])


def test_nothing_that_moves_a_robot_is_sent_unless_it_is_named() -> None:
    moving = [other(key) for key in (keys.FOLLOW_COMMAND, keys.FOLLOW_ESTOP, keys.FOLLOW_TARGET,
                                     keys.ROBOT_DRIVE, keys.FOLLOW_STATE)]  # fmt: skip
    assert list(due(moving, selection(None), 1.0)) == []
    assert len(list(due(moving, selection("command, drive"), 1.0))) == 2
    with pytest.raises(SettingsError, match="'taken' is not sent again: it says when"):
        selection("image,taken")
    with pytest.raises(SettingsError, match="no topic is called 'pixels'; known: image"):
        selection("pixels")


def test_a_lossless_replay_leaves_out_what_is_made_anew() -> None:
    names = for_lossless(selection(None), named=False).names
    assert set(SEEN) - set(names) == {"blobs", "tracks", "events"}
    with pytest.raises(SettingsError, match="leave blobs, tracks out"):
        for_lossless(selection("image,tracks,blobs"), named=True)
    with pytest.raises(SettingsError, match="name image or jpeg"):
        for_lossless(selection("info"), named=True)


def test_frames_wait_for_the_tracks_of_those_before_them() -> None:
    def frame(seq: int, epoch: int = 1, stream: str = "front") -> FrameId:
        return FrameId(stream=stream, epoch=epoch, seq=seq, index=seq, t_capture_ns=0)

    window = Window(2)
    # A recording may begin anywhere and lack frames.
    window.send(frame(70))
    window.send(frame(75))
    assert not window.has_room("front")
    assert window.has_room("rear")
    for other in (frame(70, epoch=2), frame(71), frame(70, stream="rear")):
        window.done(other)
    assert not window.has_room("front")
    window.done(frame(75))
    assert window.on_the_way("front") == 0


def test_a_replayed_camera_names_the_frames_that_it_has() -> None:
    said = CameraInfo(stream="front", epoch=1, width=32, height=24, source_width=32,
                      source_height=24, fps=25.0, source="a camera", host="ab-1")  # fmt: skip
    deep = said.model_copy(update={"depth": True})
    told = WireMessage(keys.info("front"), said.encoding(), encode(deep), None, 0)
    assert as_replayed(told, raw=True) == said.model_copy(update={"host": ""})
    assert as_replayed(told, raw=False) == said.model_copy(update={"host": "0"})


def test_every_topic_has_its_quality_of_service() -> None:
    assert set(BY_TOPIC) == set(keys.TOPICS)
    assert set(SEEN) < set(keys.TOPICS)
    assert fits("cam/*/tracks", keys.tracks("front"))
    assert not fits("cam/*/tracks", "cam/front/tracks/attachment")
    assert not fits("cam/*/tracks", keys.blobs("front"))
