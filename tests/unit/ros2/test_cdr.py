"""Bytes of ROS messages: of every type that is spoken, and of what is none."""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heel.schemas import MessageError
from heel.services.ros2.cdr import Messages
from tests.support.ros_kinds import KINDS

pytest.importorskip("rosbags", reason="no rosbags here: it comes with the extra ros2-zenoh")
MESSAGES = Messages()


def test_a_velocity_has_the_bytes_that_cdr_wants() -> None:
    message = MESSAGES.empty("geometry_msgs/msg/Twist")
    message.linear.x, message.angular.z = 0.25, -1.5
    wanted = b"\0\1\0\0" + struct.pack("<6d", 0.25, 0, 0, 0, 0, -1.5)
    assert MESSAGES.encoded(message) == wanted
    assert MESSAGES.decoded(wanted, "geometry_msgs/msg/Twist") == message


def test_one_byte_order_is_as_good_as_the_other() -> None:
    big = b"\0\0\0\0" + struct.pack(">6d", 0.25, 0, 0, 0, 0, -1.5)
    assert MESSAGES.decoded(big, "geometry_msgs/msg/Twist").angular.z == -1.5


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_message_of_every_type_is_read_back(kind: str) -> None:
    payload = MESSAGES.encoded(MESSAGES.empty(kind))
    assert MESSAGES.encoded(MESSAGES.decoded(payload, kind)) == payload
    assert len(MESSAGES.type_hash(kind)) == len("RIHS01_") + 64


def test_pixels_come_without_being_copied() -> None:
    image = MESSAGES.empty("sensor_msgs/msg/Image")
    image.data = np.arange(100, dtype=np.uint8)
    read = MESSAGES.decoded(MESSAGES.encoded(image), "sensor_msgs/msg/Image")
    assert (read.data == image.data).all()
    assert not read.data.flags.owndata


@given(kind=st.sampled_from(KINDS), payload=st.binary(max_size=300))
def test_bytes_that_are_no_message_are_one_clear_error(kind: str, payload: bytes) -> None:
    for told in (payload, b"\0\1\0\0" + payload):
        with suppress(MessageError):
            MESSAGES.decoded(told, kind)
    with pytest.raises(MessageError, match=kind):
        MESSAGES.decoded(payload[:3], kind)
