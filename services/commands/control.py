"""`heel follow`, `stop`, `resume` and `status`: a word with the robot that is running."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas import (
    EStop,
    FollowState,
    Health,
    HeelError,
    Message,
    MessageError,
    SettingsError,
    Target,
    TargetRequest,
    decode,
    encode,
    keys,
)

if TYPE_CHECKING:
    import zenoh
    from rich.table import Table

_TIMEOUT_S = 2.0
_POINT_WAIT_S, _POINT_POLL_S = 8.0, 0.1
"""Longer than the follower looks for somebody who was pointed at."""
_HEALTH_WAIT_S = 1.5
_SHM = {True: "yes", False: "no", None: "-"}

Connect = Annotated[
    str | None,
    typer.Option(help="router to talk to, e.g. tcp/192.168.1.7:7447", metavar="ENDPOINT"),
]
Namespace = Annotated[str | None, typer.Option(help="robot's name before every key")]
Config = Annotated[Path | None, typer.Option(help="settings file (TOML)", metavar="FILE")]


@contextmanager
def _session(
    connect: str | None, namespace: str | None, config: Path | None
) -> Iterator[zenoh.Session]:
    """A session with the robot's router."""
    import logging

    import zenoh

    from services.runtime.session import LOG_FILTER, open_session
    from services.runtime.settings import StrictSettings, load_settings

    zenoh.init_log_from_env_or(LOG_FILTER)
    given = {"connect": connect, "namespace": namespace}
    flags: dict[str, dict[str, object]] = {
        "zenoh": {"connect_timeout_s": _TIMEOUT_S} | {k: v for k, v in given.items() if v}
    }
    loaded = load_settings("run", StrictSettings, flags, config)
    session = open_session(loaded.zenoh, logging.getLogger("heel"), _pause)
    assert session is not None
    with session:
        yield session


def _pause(seconds: float) -> bool:
    return threading.Event().wait(seconds)


def _ask(
    session: zenoh.Session, key: str, kind: type[Message], request: Message | None = None
) -> Message | None:
    """The first good reply on a key, None if nobody answers.

    Raises:
        HeelError: the one who answers refuses.
    """
    payload = None if request is None else encode(request)
    encoding = None if request is None else request.encoding()
    for reply in session.get(key, payload=payload, encoding=encoding, timeout=_TIMEOUT_S):
        if reply.ok is not None:
            return decode(kind, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if reply.err is not None:
            raise HeelError(reply.err.payload.to_string())
    return None


def follow(
    who: Annotated[
        list[str],
        typer.Argument(help="an id, `nearest`, `imprint`, `none`, or X Y in pixels", metavar="WHO"),
    ],
    connect: Connect = None,
    namespace: Namespace = None,
    config: Config = None,
) -> None:
    """Choose whom the robot follows: `heel follow 7`, `nearest`, `none`, or a point `X Y`.

    `imprint` takes the one person who then stands before the robot for two seconds.
    """
    request = _request(who)
    with _session(connect, namespace, config) as session:
        target = _ask(session, keys.FOLLOW_TARGET, Target, request)
        if not isinstance(target, Target):
            raise HeelError("no follower answers: start one with `heel follower`, `heel run` or "
                            "`heel demo`")  # fmt: skip
        if target.mode == "point" and target.track_id is None:
            typer.echo(f"target: {_shown(target)}")
            target = _found(session, target)
        typer.echo(f"target: {_shown(target)}")


def _found(session: zenoh.Session, asked: Target) -> Target:
    """Who was found at a point.

    Raises:
        HeelError: nobody was.
    """
    deadline_s = time.monotonic() + _POINT_WAIT_S
    target = asked
    while target.seq == asked.seq and time.monotonic() < deadline_s:
        time.sleep(_POINT_POLL_S)
        answer = _ask(session, keys.FOLLOW_TARGET, Target)
        target = answer if isinstance(answer, Target) else target
    if target.track_id is None:
        raise HeelError(_shown(target))
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


def _shown(target: Target) -> str:
    who = target.mode if target.track_id is None else f"person {target.track_id} ({target.mode})"
    return f"{who}: {target.reason}"


def stop(connect: Connect = None, namespace: Namespace = None, config: Config = None) -> None:
    """Emergency stop: zero velocity until `heel resume`."""
    _estop(True, connect, namespace, config)


def resume(connect: Connect = None, namespace: Namespace = None, config: Config = None) -> None:
    """Release the emergency stop."""
    _estop(False, connect, namespace, config)


def _estop(engaged: bool, connect: str | None, namespace: str | None, config: Path | None) -> None:
    """Publish until somebody who obeys confirms: a stop that was not heard is no stop."""
    import zenoh

    message = EStop(engaged=engaged, source="heel command", t_ns=time.time_ns())
    with _session(connect, namespace, config) as session:
        publisher = session.declare_publisher(
            keys.FOLLOW_ESTOP, express=True, priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip
        deadline_s = time.monotonic() + _TIMEOUT_S
        while time.monotonic() < deadline_s:
            publisher.put(encode(message), encoding=message.encoding())
            state = _ask(session, keys.FOLLOW_STATE, FollowState)
            if isinstance(state, FollowState) and state.estop == engaged:
                typer.echo("stopped: `heel resume` releases it" if engaged else "resumed")
                return
    raise HeelError("no follower confirms: is the robot on, and is --connect its router?")


def status(connect: Connect = None, namespace: Namespace = None, config: Config = None) -> None:
    """Show which services run, how they are, and what the follower is doing."""
    from rich.console import Console

    seen: dict[str, Health] = {}
    with _session(connect, namespace, config) as session:
        samples: queue.Queue[zenoh.Sample] = queue.Queue(maxsize=256)
        session.declare_subscriber(keys.ALL_HEALTH, samples.put)
        deadline_s = time.monotonic() + _HEALTH_WAIT_S
        while (remaining_s := deadline_s - time.monotonic()) > 0:
            try:
                sample = samples.get(timeout=remaining_s)
            except queue.Empty:
                break
            try:
                health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))
            except MessageError as error:
                typer.echo(f"{sample.key_expr}: {error}", err=True)
                continue
            seen[f"{health.service}/{health.instance}"] = health
        state = _ask(session, keys.FOLLOW_STATE, FollowState)
    if not seen:
        raise HeelError("no service is running here: start some with `heel demo`")
    console = Console(soft_wrap=True, highlight=False)
    console.print(_health_table(seen))
    for name, health in sorted(seen.items()):
        if health.reason:
            console.print(f"{name}: {health.reason}")
    if isinstance(state, FollowState):
        console.print(f"follower: {state.state} ({state.reason}), target {_shown(state.target)}")


def _health_table(seen: dict[str, Health]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("service", "state", "in/s", "out/s", "dropped", "p99 ms", "MB", "shm"):
        table.add_column(title, no_wrap=True)
    for name, h in sorted(seen.items()):
        rates = (f"{h.rate_in_hz:.1f}", f"{h.rate_out_hz:.1f}")
        table.add_row(
            name, h.state, *rates, str(h.dropped), f"{h.age_ms_p99:.1f}", f"{h.rss_mb:.0f}",
            _SHM[h.shared_memory],
        )  # fmt: skip
    return table
