"""Roles as access rules of a Zenoh router, which refuses what no rule allows.

A rule covers a key expression that lies wholly within one of its own: `follow/**` is refused where
`follow/state` is allowed. Each right needs both directions: a message comes in from its sender, and
goes out to those that may hear it; and a declaration has to reach the other side, or Zenoh's
publishers take it that nobody listens.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from heel.schemas import keys
from heel.services.runtime import qos
from heel.services.security.roles import ROLES, Access, sent_by

Identity = Literal["cert_common_names", "usernames"]
"""By what the router knows a client, as Zenoh's access rules name it."""

_ANY_CAMERA = "cam/*/"
_ROOM_BYTES = 4096
"""Beside the payload: attachments are maps of less than 600 bytes."""


def access_control(
    members: Mapping[str, str],
    identity: Identity,
    namespace: str = "",
    cameras: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The table `access_control` of a router's configuration: what is not allowed is refused.

    Args:
        members: the role of each name that a certificate or user may have.
        identity: whether names are those of certificates or of users.
        namespace: of the robot: the router sees its keys with it in front.
        cameras: names of the robot's cameras; none: any name, a wildcard too, may be sent.
    """
    rules, policies, subjects = [], [], []
    for role in ROLES:
        names = sorted(name for name, other in members.items() if other == role)
        if not names:
            continue
        own = list(_rules(role, namespace, cameras))
        rules += own
        subjects.append({"id": role, identity: names})
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [role]})
    return {
        "enabled": True, "default_permission": "deny",
        "rules": rules, "subjects": subjects, "policies": policies,
    }  # fmt: skip


def size_limits(namespace: str = "") -> list[dict[str, Any]]:
    """The table `low_pass_filter`: what is larger than its topic allows is dropped at the router.

    A message on the emergency stop that is too large stops the robot, as one of a sensor does:
    they have to arrive.
    """
    largest = {
        "image": qos.IMAGE, "jpeg": qos.JPEG, "depth": qos.DEPTH, "taken": qos.TAKEN,
        "info": qos.INFO, "blobs": qos.BLOBS, "tracks": qos.TRACKS, "events": qos.EVENTS,
        "command": qos.COMMAND,
        "state": qos.STATE, "target": qos.TARGET, "pointed": qos.POINTED, "health": qos.HEALTH,
    }  # fmt: skip
    return [
        {
            "id": f"size of {topic}", "messages": ["put"], "flows": ["ingress"],
            "key_exprs": _in(namespace, (keys.TOPICS[topic],)),
            "size_limit": how.max_bytes + _ROOM_BYTES,
        }
        for topic, how in largest.items()
    ]  # fmt: skip


def _rules(role: str, namespace: str, cameras: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    access: Access = ROLES[role]
    own_config: tuple[str, ...] = ()
    all_health, all_config, tokens = own_config, own_config, own_config
    if access.service:
        own_config, tokens = (f"svc/{role}/*/config",), (f"alive/{role}/*",)
        # What listeners declare and ask is of all services at once.
        all_health, all_config = (keys.ALL_HEALTH,), (keys.ALL_CONFIG,)
    rights: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...] = (
        ("sends", "ingress", ("put",), _named(cameras, sent_by(role))),
        ("sends", "egress", ("declare_subscriber",), (*access.sends, *all_health)),
        ("hears", "ingress", ("declare_subscriber",), access.hears),
        ("hears", "egress", ("put",), access.hears),
        ("answers", "ingress", ("declare_queryable", "reply"),
         (*_named(cameras, access.answers), *own_config)),
        ("answers", "egress", ("query",), (*access.answers, *all_config)),
        ("asks", "ingress", ("query",), access.asks),
        ("asks", "egress", ("declare_queryable", "reply"), access.asks),
        ("is there", "ingress", ("liveliness_token",), tokens),
        ("sees", "ingress", ("declare_liveliness_subscriber", "liveliness_query"),
         (keys.ALL_ALIVE,)),
        ("sees", "egress", ("liveliness_token",), (keys.ALL_ALIVE,)),
    )  # fmt: skip
    for right, flow, messages, wanted in rights:
        if wanted:
            yield {
                "id": f"{role} {right} {flow}", "permission": "allow", "flows": [flow],
                "messages": list(messages), "key_exprs": _in(namespace, wanted),
            }  # fmt: skip


def _named(cameras: tuple[str, ...], wanted: tuple[str, ...]) -> tuple[str, ...]:
    """Key expressions of any camera as those of the robot's own."""
    if not cameras:
        return wanted
    found = []
    for key in wanted:
        head, any_camera, tail = key.partition(_ANY_CAMERA)
        own = [f"{_ANY_CAMERA[:-2]}{camera}/{tail}" for camera in cameras]
        found += own if any_camera and not head else [key]
    return tuple(found)


def _in(namespace: str, wanted: tuple[str, ...]) -> list[str]:
    return [f"{namespace}/{key}" if namespace else key for key in wanted]
