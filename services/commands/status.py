"""`heel status`: which services are present, which are missing, and what the robot does."""

from __future__ import annotations

import json
import queue
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heel.schemas import (
    EndOfStream,
    FollowState,
    Health,
    HeelError,
    MessageError,
    Tracks,
    decode,
    keys,
)
from heel.services.commands.follow import shown
from heel.services.commands.robot import RobotFlags, Where, ask, for_robot, session_with
from heel.services.runtime.chain import (
    CHAIN,
    MISSING,
    ChainWatch,
    Part,
    PartState,
    Problem,
    describe,
    page_of,
)
from heel.services.runtime.logs import printable

if TYPE_CHECKING:
    import zenoh
    from rich.table import Table

_LISTEN_S = 1.3
"""Seconds of listening: five messages of health of most services, and one of those that send it
once a second."""
_MAX_WAITING = 1024
"""Messages that may wait to be read: bounds memory and time in a flood; chosen by hand."""
_SHM = {True: "yes", False: "no", None: "-"}


@dataclass
class _Heard:
    """Messages received while this command listened."""

    watch: ChainWatch = field(default_factory=ChainWatch)
    tracks: Tracks | None = None
    state: FollowState | None = None
    unreadable: list[str] = field(default_factory=list)

    def problems(self, where: Where, now_s: float) -> list[Problem]:
        """Problems of the services that are present, and the services that are missing."""
        found = self.watch.problems(now_s)
        expected = set(where.run.parts if where.run is not None else ())
        for part, state in self.watch.rows(now_s):
            if state == "ok" and part.health.details.get(MISSING):
                expected |= set(part.health.details[MISSING].split(","))
        return found + self.watch.missing(expected, now_s)

    @property
    def page(self) -> str | None:
        """Where the live page is, if one is served."""
        urls = [page_of(part.health) for part in self.watch.parts.values()]
        return next((url for url in urls if url), None)

    @property
    def people(self) -> list[dict[str, Any]]:
        """People that can be chosen: the shown tracks."""
        tracks = () if self.tracks is None else self.tracks.tracks
        return [
            {"id": track.id, "state": track.state,
             "confidence": round(track.identity_confidence, 2)}
            for track in tracks if track.shown
        ]  # fmt: skip


@for_robot
def status(
    robot: RobotFlags,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Show which services run, who is missing, who is in sight and what the follower is doing.

    Ends with 1 if anything is not as it should be, and names it.
    """
    where = robot.find()
    with session_with(where) as session:
        heard = _listen(session)
    now_s = time.monotonic()
    if not heard.watch.parts and not heard.problems(where, now_s):
        raise HeelError(
            f"no service is running at {where.router}: start some with `heel demo`, or name the "
            "router with --connect and the robot with --namespace"
        )
    problems = heard.problems(where, now_s)
    rows = heard.watch.rows(now_s)
    if as_json:
        typer.echo(json.dumps(_as_json(heard, where, rows, problems), indent=2))
    else:
        _print(heard, where, rows, problems)
    if problems or any(_fails(part.health) for part, state in rows if state == "ok"):
        raise typer.Exit(1)


def _fails(health: Health) -> bool:
    """Whether a service that sends health does not do its work; a degraded one may still do it."""
    idle = health.rate_out_hz == 0.0 and health.service in CHAIN
    return health.state == "error" or (health.state == "degraded" and idle)


def _listen(session: zenoh.Session) -> _Heard:
    """Tokens, then a little more than a second of health and tracks, then the state."""
    heard = _Heard()
    # Bounded, and full is full: a flood must not delay the answer.
    samples: queue.Queue[zenoh.Sample] = queue.Queue(maxsize=_MAX_WAITING)

    def take(sample: zenoh.Sample) -> None:
        if not samples.full():
            samples.put_nowait(sample)

    watching: list[Any] = [
        session.declare_subscriber(keys.ALL_HEALTH, take),
        session.declare_subscriber(keys.ALL_TRACKS, take),
        session.liveliness().declare_subscriber(keys.ALL_ALIVE, take, history=True),
    ]
    until_s = time.monotonic() + _LISTEN_S
    while (remaining_s := until_s - time.monotonic()) > 0:
        try:
            sample = samples.get(timeout=remaining_s)
        except queue.Empty:
            break
        try:
            _take(heard, sample, time.monotonic())
        except MessageError as error:
            heard.unreadable.append(f"{sample.key_expr}: {error}")
    for one in watching:
        one.undeclare()
    try:
        state = ask(session, keys.FOLLOW_STATE, FollowState)
    except HeelError as error:
        heard.unreadable.append(f"{keys.FOLLOW_STATE}: {error}")
    else:
        heard.state = state if isinstance(state, FollowState) else None
    return heard


def _take(heard: _Heard, sample: zenoh.Sample, now_s: float) -> None:
    import zenoh

    key, encoding = str(sample.key_expr), str(sample.encoding)
    kind, *rest = key.split("/")
    if kind == "alive" and len(rest) == 2:
        heard.watch.token(rest[0], rest[1], sample.kind == zenoh.SampleKind.PUT, now_s)
    elif kind == "svc":
        heard.watch.hear(decode(Health, sample.payload.to_bytes(), encoding), now_s)
    elif kind == "cam" and encoding != EndOfStream.encoding():
        heard.tracks = decode(Tracks, sample.payload.to_bytes(), encoding)


def _as_json(
    heard: _Heard, where: Where, rows: list[tuple[Part, PartState]], problems: list[Problem]
) -> dict[str, Any]:
    return {
        "router": where.router,
        "run": None if where.run is None else where.run.model_dump(mode="json"),
        "page": heard.page,
        "problems": describe(problems),
        "services": [
            {"heard": state} | part.health.model_dump(mode="json") for part, state in rows
        ],
        "follower": None if heard.state is None else heard.state.model_dump(mode="json"),
        "people": heard.people,
    }


def _print(
    heard: _Heard, where: Where, rows: list[tuple[Part, PartState]], problems: list[Problem]
) -> None:
    from rich.console import Console

    # Nothing below is markup: the services' own texts are shown as they are.
    console = Console(soft_wrap=True, highlight=False, markup=False, emoji=False)
    named = f"  (heel {where.run.kind}, process {where.run.pid})" if where.run is not None else ""
    console.print(f"router {where.router}{named}")
    if heard.page is not None:
        console.print(f"page {heard.page}")
    console.print(_health_table(rows))
    for problem in problems:
        console.print(printable(problem.words))
    for part, state in rows:
        if part.health.reason and state == "ok":
            name = f"{part.health.service}/{part.health.instance}"
            console.print(f"{name}: {printable(part.health.reason)}")
    if heard.watch.unlisted:
        console.print(f"{heard.watch.unlisted} further senders of health are not listed")
    if heard.state is not None:
        told = printable(f"{heard.state.state} ({heard.state.reason})")
        console.print(f"follower: {told}, target {shown(heard.state.target)}")
        console.print(f"follower: {facts(heard.state)}")
    if heard.tracks is not None:
        ids = ", ".join(str(person["id"]) for person in heard.people)
        console.print(f"in sight: {ids or 'nobody'}")
    for line in heard.unreadable[:5]:
        typer.echo(printable(line, 300), err=True)


def facts(state: FollowState) -> str:
    """The follower's estimates of its target and of the free way, as one line."""
    known = []
    if state.distance_m is not None:
        known.append(f"{state.distance_m:.1f} m away")
    if state.identity_confidence is not None:
        next_best = state.runner_up_confidence
        beside = f" (next best {next_best:.0%})" if next_best is not None else ""
        known.append(f"{state.identity_confidence:.0%} sure{beside}")
    bounded = f" ({printable(state.speed_reason)})" if state.speed_reason else ""
    known.append(f"{state.linear_mps:.2f} m/s{bounded}")
    free = "" if state.free_distance_m is None else f", {state.free_distance_m:.1f} m free"
    watched = f"obstacles are watched{free}"
    known.append(watched if state.obstacle_watch else "nothing looks out for obstacles")
    return ", ".join(known)


def _health_table(rows: list[tuple[Part, PartState]]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("service", "state", "in/s", "out/s", "dropped", "p99 ms", "MB", "shm"):
        table.add_column(title, no_wrap=True)
    for part, state in rows:
        h = part.health
        name = f"{h.service}/{h.instance}"
        if state != "ok":
            table.add_row(name, state)
            continue
        table.add_row(
            name, h.state, f"{h.rate_in_hz:.1f}", f"{h.rate_out_hz:.1f}", str(h.dropped),
            f"{h.age_ms_p99:.1f}", f"{h.rss_mb:.0f}", _SHM[h.shared_memory],
        )  # fmt: skip
    return table
