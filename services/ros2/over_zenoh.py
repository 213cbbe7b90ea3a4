"""A node by rmw_zenoh's wire, without any ROS: the robot's own router of it passes messages on."""

from __future__ import annotations

import os
import secrets
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from typing import Any

import zenoh

from heel.schemas.errors import HeelError, MessageError
from heel.schemas.image import MAX_IMAGE_BYTES
from heel.services.ros2.cdr import Messages
from heel.services.ros2.node import End, Heard, RosNode, publications, subscriptions
from heel.services.ros2.settings import Ros2Settings
from heel.services.ros2.zenoh_wire import (
    PUBLISHER,
    SUBSCRIBER,
    Member,
    attachment,
    end_token,
    endpoint_of,
    ends_of,
    node_token,
    topic_key,
)
from heel.services.runtime.inbox import Inbox
from heel.services.runtime.qos import TopicQos
from heel.services.runtime.session import one_line, zenoh_config
from heel.services.runtime.settings import ZenohSettings

_HEARD = TopicQos(
    zenoh.Priority.DATA, zenoh.CongestionControl.DROP, True, 1, MAX_IMAGE_BYTES
)  # fmt: skip
"""Of what is listened to: the newest counts. Only ring and size matter to a receiver."""
_STOPS = TopicQos(zenoh.Priority.DATA, zenoh.CongestionControl.DROP, True, 8, 1 << 10)
"""Of emergency stops: none is to be pushed out by a `false` after it. Both numbers chosen by hand,
a message has five bytes."""
_ASK_S = 1.0
"""Longest wait for who is there [s]; a router answers in milliseconds. Chosen by hand."""


class ZenohNode(RosNode):
    """Subscriptions and publishers of a robot's topics on rmw_zenoh's keys.

    Raises:
        HeelError: no router of the robot's, or the library for messages is not there.
    """

    def __init__(self, settings: Ros2Settings) -> None:
        """Join the robot's ROS."""
        super().__init__(settings)
        self._messages = Messages()
        self._domain = _domain(settings)
        self._kept = ExitStack()
        self._session = self._kept.enter_context(_open(settings.ros_router))
        self._inbox = self._kept.enter_context(Inbox(self._session))
        member = Member(self._domain, str(self._session.info.zid()), settings.node)
        self._tokens = [self._token(node_token(member))]
        self._kinds = subscriptions(settings)
        for name, (topic, kind) in self._kinds.items():
            key = self._joined(member, SUBSCRIBER, topic, kind)
            quality = _STOPS if name == "stops" else _HEARD
            self._inbox.subscribe(name, key, quality, lambda _: self.arrived.set())
        self._publishers = {
            topic: _Publisher(self._session, self._joined(member, PUBLISHER, topic, kind))
            for topic, kind in publications(settings).items()
        }

    def _joined(self, member: Member, role: str, topic: str, kind: str) -> str:
        """Key of a topic that this node is known to send or hear from now on."""
        type_hash = self.type_hash(kind)
        sends = role == PUBLISHER
        token = end_token(
            member, len(self._tokens), role, topic, End(kind, type_hash=type_hash),
            depth=1 if sends else 5, reliable=sends,
        )  # fmt: skip
        self._tokens.append(self._token(token))
        return topic_key(self._domain, topic, kind, type_hash)

    def take(self) -> Heard:
        """As `RosNode.take`."""
        self.arrived.clear()
        heard = Heard()
        for name, (_, kind) in self._kinds.items():
            for arrival in self._inbox.all_of(0.0, name):
                try:
                    if arrival.size > MAX_IMAGE_BYTES:
                        raise MessageError(f"{arrival.size} bytes: {MAX_IMAGE_BYTES} are read")
                    message = self._messages.decoded(arrival.payload, kind)
                except MessageError as error:
                    heard.unread[name] = str(error)
                    continue
                if name == "stops":
                    heard.stops += int(bool(message.data))
                else:
                    setattr(heard, name, message)
                if name == "picture":
                    heard.picture_ns = round(arrival.arrived_s * 1e9)
        return heard

    def now_ns(self) -> int:
        """As `RosNode.now_ns`: the wall clock, which rmw_zenoh's nodes go by."""
        return time.time_ns()

    def message(self, kind: str) -> Any:
        """As `RosNode.message`."""
        return self._messages.empty(kind)

    def publish(self, topic: str, message: Any) -> None:
        """As `RosNode.publish`."""
        self._publishers[topic].send(self._messages.encoded(message))

    def full_name(self, topic: str) -> str:
        """As `RosNode.full_name`."""
        return f"/{topic.strip('/')}"

    def type_hash(self, kind: str) -> str:
        """As `RosNode.type_hash`."""
        return self._messages.type_hash(kind)

    def topics(self) -> dict[str, Sequence[str]]:
        """As `RosNode.topics`."""
        there: dict[str, Sequence[str]] = {}
        for role in (PUBLISHER, SUBSCRIBER):
            for name, end in self._ends(role):
                there[name] = sorted({*there.get(name, ()), end.kind})
        return there

    def publishers(self, name: str) -> list[End]:
        """As `RosNode.publishers`."""
        return [end for topic, end in self._ends(PUBLISHER) if topic == name]

    def subscribers(self, name: str) -> list[End]:
        """As `RosNode.subscribers`."""
        return [end for topic, end in self._ends(SUBSCRIBER) if topic == name]

    def leave(self) -> None:
        """As `RosNode.leave`."""
        for token in self._tokens:
            with suppress(zenoh.ZError):
                token.undeclare()  # type: ignore[no-untyped-call]
        with suppress(zenoh.ZError):
            self._kept.close()

    def _token(self, key: str) -> zenoh.LivelinessToken:
        return self._session.liveliness().declare_token(key)

    def _ends(self, role: str) -> list[tuple[str, End]]:
        """Topic and end of everybody else's."""
        replies = self._session.liveliness().get(ends_of(self._domain, role), timeout=_ASK_S)
        found = [endpoint_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None]
        own = str(self._session.info.zid())
        return [(one.topic, one.end) for one in found if one is not None and one.session != own]


class _Publisher:
    """A publisher with the attachment that rmw_zenoh's subscribers want.

    Messages that the link cannot take at once are dropped: an old velocity is worth nothing.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._publisher = session.declare_publisher(
            key, priority=zenoh.Priority.REAL_TIME, express=True,
            congestion_control=zenoh.CongestionControl.DROP,
        )  # fmt: skip
        self._id, self._sequence = secrets.token_bytes(16), 0

    def send(self, payload: bytes) -> None:
        self._sequence += 1
        self._publisher.put(
            payload, attachment=attachment(self._sequence, time.time_ns(), self._id)
        )


def _domain(settings: Ros2Settings) -> int:
    """The ROS domain, as every node of ROS finds its own.

    Raises:
        HeelError: the variable holds no number.
    """
    if settings.domain_id is not None:
        return settings.domain_id
    told = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not told.isdecimal():
        raise HeelError(f"ROS_DOMAIN_ID={told[:40]!r} is no number: unset it or give --domain-id")
    return int(told)


def _open(endpoint: str) -> zenoh.Session:
    config = zenoh_config(ZenohSettings(connect=(endpoint,)))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise HeelError(
            f"no router of the robot's ROS at {endpoint}: start it (`ros2 run rmw_zenoh_cpp "
            f"rmw_zenohd`), or name another with --ros-router ({one_line(error)})"
        ) from None
