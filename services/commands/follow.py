"""`heel follow`: the person that a running robot is to follow."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas import (
    HeelError,
    SettingsError,
    Target,
    TargetRequest,
    keys,
)
from heel.services.commands.robot import RobotFlags, ask, for_robot, session_with
from heel.services.runtime.logs import printable

if TYPE_CHECKING:
    import zenoh

_POINT_WAIT_S = 8.0
"""Longest wait for the pointed-at person [s]; above the follower's own `PENDING_S`."""
_POINT_POLL_S = 0.1
"""Seconds between two questions to the follower meanwhile; chosen by hand."""


@for_robot
def follow(
    robot: RobotFlags,
    who: Annotated[
        list[str],
        typer.Argument(help="an id, `nearest`, `imprint`, `none`, or X Y in pixels", metavar="WHO"),
    ],
) -> None:
    """Choose whom the robot follows: `heel follow 7`, `nearest`, `none`, or a point `X Y`.

    `imprint` takes the one person who then stands before the robot for two seconds.
    """
    request = _request(who)
    with session_with(robot.find()) as session:
        target = ask(session, keys.FOLLOW_TARGET, Target, request)
        if not isinstance(target, Target):
            raise HeelError("no follower answers: start one with `heel follower`, `heel run` or "
                            "`heel demo`")  # fmt: skip
        if target.mode == "point" and target.track_id is None:
            typer.echo(f"target: {shown(target)}")
            target = _found(session, target)
        typer.echo(f"target: {shown(target)}")


def _found(session: zenoh.Session, asked: Target) -> Target:
    """The pointed-at person, once the follower has found it.

    Raises:
        HeelError: no person was found there.
    """
    deadline_s = time.monotonic() + _POINT_WAIT_S
    target = asked
    while target.seq == asked.seq and time.monotonic() < deadline_s:
        time.sleep(_POINT_POLL_S)
        answer = ask(session, keys.FOLLOW_TARGET, Target)
        target = answer if isinstance(answer, Target) else target
    if target.track_id is None:
        raise HeelError(shown(target))
    return target


def _request(who: list[str]) -> TargetRequest:
    try:
        if len(who) == 2:
            return TargetRequest(mode="point", x_px=float(who[0]), y_px=float(who[1]))
        if len(who) == 1 and who[0] in ("nearest", "imprint", "none"):
            return TargetRequest.model_validate({"mode": who[0]})
        if len(who) == 1:
            return TargetRequest(mode="id", track_id=int(who[0]))
    except ValueError:
        pass
    raise SettingsError(
        f"{' '.join(who)!r}: give an id, `nearest`, `imprint`, `none`, or X Y in pixels"
    )


def shown(target: Target) -> str:
    """A target as one line of text for a user."""
    who = target.mode if target.track_id is None else f"person {target.track_id} ({target.mode})"
    return printable(f"{who}: {target.reason}")
