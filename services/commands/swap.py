"""`heel swap`: the work of a running service goes over to one that stands by."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from heel.schemas import Handover, Health, HeelError, Message, MessageError, Stamp, decode, encode
from heel.services.commands.robot import TIMEOUT_S, RobotFlags, for_robot, session_with

if TYPE_CHECKING:
    import zenoh

    from heel.services.runtime.inbox import Inbox
    from heel.services.runtime.qos import TopicQos

_LISTEN_S = 0.9
"""Seconds in which those that stand by are heard: three messages of health."""
_SWAP_S = 3.0
"""Longest wait [s] for the first message of the successor, which comes with the next frame."""
Swapped = Literal["tracker", "detector", "follower"]


@for_robot
def swap(
    robot: RobotFlags,
    service: Annotated[Swapped, typer.Argument(help="whose work is handed over")],
    to: Annotated[
        str | None,
        typer.Option(help="--instance of the one that goes on [default: the one that stands by]",
                     metavar="INSTANCE"),
    ] = None,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="also to one that is not ready: people get new ids")
    ] = False,
) -> None:  # fmt: skip
    """Hand over from a running tracker, detector or follower to one started with `--standby`.

    The one that has handed over stands by from then on; stop it, or swap back.
    """
    from heel.services.runtime.inbox import Inbox

    with session_with(robot.find()) as session, Inbox(session) as inbox:
        chosen = _chosen(_heard(inbox), service, to, anyway)
        camera = chosen.details.get("camera", "front")
        stream = _stream(service, camera)
        inbox.subscribe("stream", *stream)
        asked_s = time.monotonic()
        before = _ask(session, service, camera, chosen.producer)
        took_s = _await(inbox, chosen.producer, asked_s)
        typer.echo(
            f"{service}: {before.partition('@')[0]} has handed over to "
            f"{chosen.producer.partition('@')[0]} in {took_s:.2f} s"
        )


def _heard(inbox: Inbox) -> list[Health]:
    """The newest word of every service."""
    from heel.schemas import keys
    from heel.services.runtime import qos

    inbox.subscribe("health", keys.ALL_HEALTH, qos.HEALTH)
    heard: dict[str, Health] = {}
    until_s = time.monotonic() + _LISTEN_S
    while (left_s := until_s - time.monotonic()) > 0:
        arrival = inbox.get(left_s)
        if arrival is None:
            continue
        try:
            health = decode(Health, arrival.payload, arrival.encoding)
        except MessageError:
            continue
        heard[health.producer] = health
    return list(heard.values())


def _chosen(heard: list[Health], service: str, to: str | None, anyway: bool) -> Health:
    """The one that goes on.

    Raises:
        HeelError: there is none, several, or it is not ready.
    """
    from heel.services.runtime.chain import STANDBY
    from heel.services.runtime.succession import READY

    standing = [one for one in heard if one.service == service and STANDBY in one.details]
    named = [one for one in standing if to in (None, one.instance)]
    if not named:
        names = ", ".join(one.instance for one in standing)
        remedy = f"; there stand by: {names}" if names else ""
        whose = f"no {service} of the name {to}" if to else f"no {service}"
        raise HeelError(
            f"{whose} stands by{remedy}: start one with `heel {service} --standby --instance NAME`"
        )
    if len(named) > 1:
        names = ", ".join(f"--to {one.instance}" for one in named)
        raise HeelError(f"{len(named)} of them stand by, name one: {names}")
    told = named[0].details[STANDBY]
    if not anyway and not told.startswith(f"{READY}:"):
        raise HeelError(f"{named[0].producer.partition('@')[0]} is {told}: wait, or use --anyway")
    return named[0]


def _stream(service: str, camera: str) -> tuple[str, TopicQos]:
    from heel.schemas import keys
    from heel.services.runtime import qos

    return {
        "tracker": (keys.tracks(camera), qos.TRACKS),
        "detector": (keys.blobs(camera), qos.BLOBS),
        "follower": (keys.FOLLOW_COMMAND, qos.COMMAND),
    }[service]


def _ask(session: zenoh.Session, service: str, camera: str, successor: str) -> str:
    """Tell the one that works; its name.

    Raises:
        HeelError: none answers, or it refuses.
    """
    from heel.schemas import keys
    from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY, refusal

    request: Message = Handover(successor=successor)
    replies = session.get(
        keys.handover(camera, service), target=EVERYBODY, consolidation=EVERY_ANSWER,
        payload=encode(request), encoding=request.encoding(), timeout=TIMEOUT_S,
    )  # fmt: skip
    for reply in replies:
        if reply.ok is not None:
            return reply.ok.payload.to_string()
        if (refused := refusal(reply)) is not None:
            raise HeelError(refused)
    raise HeelError(f"no {service} of camera {camera} answers: the one that stands by takes over "
                    "by itself once frames come")  # fmt: skip


def _await(inbox: Inbox, successor: str, asked_s: float) -> float:
    """Seconds until the first message of the successor.

    Raises:
        HeelError: none came.
    """
    while (now_s := time.monotonic()) < asked_s + _SWAP_S:
        arrival = inbox.get(asked_s + _SWAP_S - now_s, "stream")
        if arrival is None or arrival.attachment is None:
            continue
        try:
            stamp = decode(Stamp, arrival.attachment)
        except MessageError:
            continue
        if stamp.producer == successor:
            return arrival.arrived_s - asked_s
    raise HeelError(
        f"{successor.partition('@')[0]} has sent nothing within {_SWAP_S:g} s: do frames come? "
        "see `heel status`"
    )
