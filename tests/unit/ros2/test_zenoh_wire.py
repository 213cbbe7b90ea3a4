"""rmw_zenoh's names, against those that its design document and its nodes show."""

from __future__ import annotations

import struct

import pytest

from heel.services.ros2.node import End
from heel.services.ros2.zenoh_wire import (
    PUBLISHER,
    SUBSCRIBER,
    Member,
    attachment,
    end_token,
    endpoint_of,
    node_token,
    topic_key,
)

TWIST = End(
    "geometry_msgs/msg/Twist",
    type_hash="RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
)
TALKER = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    "std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18/::,7:,:,:,,"
)
"""Of rmw_zenoh's design document, as is `LISTENER`."""
LISTENER = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"


@pytest.mark.parametrize("topic", ["robot/cmd_vel", "/robot/cmd_vel", "/robot/cmd_vel/"])
def test_a_topic_is_one_key_however_it_is_written(topic: str) -> None:
    assert topic_key(7, topic, TWIST.kind, TWIST.type_hash) == (
        f"7/robot/cmd_vel/geometry_msgs::msg::dds_::Twist_/{TWIST.type_hash}"
    )


def test_tokens_are_those_of_the_design_document() -> None:
    assert node_token(Member(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")) == LISTENER
    chatter = End("std_msgs/msg/String", type_hash=TALKER.split("/")[-2])
    talker = Member(2, "8b20917502ee955ac4476e0266340d5c", "talker")
    assert end_token(talker, 10, PUBLISHER, "chatter", chatter, 7, reliable=True) == TALKER
    heard = end_token(talker, 3, SUBSCRIBER, "/a/b", chatter, 5, reliable=False)
    assert "/3/MS/%/%/talker/%a%b/" in heard
    assert heard.endswith("/2::,5:,:,:,,")


def test_a_token_says_topic_type_and_whose_it_is() -> None:
    read = endpoint_of(TALKER)
    assert read is not None
    assert (read.session, read.topic) == ("8b20917502ee955ac4476e0266340d5c", "/chatter")
    assert read.end == End("std_msgs/msg/String", type_hash=TALKER.split("/")[-2])
    assert endpoint_of(TALKER.replace("%chatter", "chatter")) == read


@pytest.mark.parametrize("token", ["", LISTENER, TALKER.replace("MP", "SS"), f"{TALKER}/more",
                                   TALKER.replace("@ros2_lv", "elsewhere")])  # fmt: skip
def test_what_is_no_token_of_an_end_is_left_alone(token: str) -> None:
    assert endpoint_of(token) is None


def test_an_attachment_is_two_numbers_and_the_publishers_id() -> None:
    told = attachment(3, 1_700_000_000_000_000_005, bytes(range(16)))
    assert told == struct.pack("<qqB", 3, 1_700_000_000_000_000_005, 16) + bytes(range(16))
