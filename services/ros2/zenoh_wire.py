"""What rmw_zenoh writes on Zenoh: key expressions, liveliness tokens, attachments.

After the design document of rmw_zenoh (`docs/design.md` there) and what its nodes of Jazzy and
later say. Pure: names in, names out.
"""

from __future__ import annotations

from dataclasses import dataclass

import zenoh.ext

from heel.services.ros2.node import End

_SPACE = "@ros2_lv"
NODE, PUBLISHER, SUBSCRIBER = "NN", "MP", "MS"
_PARTS = 13
"""Of the token of a publisher or subscriber."""
_BEST_EFFORT = "2"
"""Number of `rmw/types.h`; reliable and volatile are the defaults, which are left out."""


@dataclass(frozen=True, slots=True)
class Member:
    """A node as its tokens name it.

    Attributes:
        domain: number of the ROS domain.
        session: id of its Zenoh session.
        name: of the node, without a namespace.
    """

    domain: int
    session: str
    name: str


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher or subscriber of a token: its topic, whose it is, and what it is."""

    session: str
    topic: str
    end: End


def topic_key(domain: int, topic: str, kind: str, type_hash: str) -> str:
    """Key of a topic's messages.

    Args:
        domain: number of the ROS domain.
        topic: with or without the slash before it.
        kind: such as `geometry_msgs/msg/Twist`.
        type_hash: of its definition.
    """
    return f"{domain}/{topic.strip('/')}/{_dds_type(kind)}/{type_hash}"


def node_token(member: Member) -> str:
    """Token by which others see that the node is there."""
    return f"{_SPACE}/{member.domain}/{member.session}/0/0/{NODE}/%/%/{member.name}"


def end_token(
    member: Member, number: int, role: str, topic: str, end: End, depth: int, reliable: bool
) -> str:
    """Token by which others see one publisher or subscriber of the node.

    Args:
        member: the node.
        number: of the end, another one for each in the node.
        role: `PUBLISHER` or `SUBSCRIBER`.
        topic: with or without the slash before it.
        end: its type.
        depth: messages that it keeps.
        reliable: whether it asks for every message.
    """
    quality = f"{'' if reliable else _BEST_EFFORT}::,{depth}:,:,:,,"
    return (
        f"{_SPACE}/{member.domain}/{member.session}/0/{number}/{role}/%/%/{member.name}/"
        f"%{topic.strip('/').replace('/', '%')}/{_dds_type(end.kind)}/{end.type_hash}/{quality}"
    )


def ends_of(domain: int, role: str) -> str:
    """Expression for the tokens of all publishers, or of all subscribers, of a domain."""
    return f"{_SPACE}/{domain}/*/*/*/{role}/**"


def endpoint_of(token: str) -> Endpoint | None:
    """What a token says; None where it is none of a publisher or subscriber."""
    parts = token.split("/")
    if len(parts) != _PARTS or parts[0] != _SPACE or parts[5] not in (PUBLISHER, SUBSCRIBER):
        return None
    package, _, name = parts[10].removesuffix("_").partition("::msg::dds_::")
    # Of rmw_zenoh's subscribers those that want old messages hear new ones from everybody.
    end = End(f"{package}/msg/{name}", type_hash=parts[11])
    # Not everybody writes the slash before the name.
    return Endpoint(parts[2], f"/{parts[9].replace('%', '/').strip('/')}", end)


def attachment(sequence: int, now_ns: int, publisher: bytes) -> bytes:
    """What travels beside a message.

    Args:
        sequence: of the message, from 1.
        now_ns: when it is sent, wall clock.
        publisher: its id, 16 bytes.
    """
    numbers = zenoh.ext.Int64(sequence), zenoh.ext.Int64(now_ns), publisher
    return zenoh.ext.z_serialize(numbers).to_bytes()


def _dds_type(kind: str) -> str:
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"
