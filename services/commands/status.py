"""`heel status`: which services are present, which are missing, and what the robot does."""

from __future__ import annotations

import json
import time
from typing import Annotated, Any

import typer

from heel.schemas import FollowState, HeelError, keys
from heel.services.commands.bus.listening import Listening, listening
from heel.services.commands.columns import aligned
from heel.services.commands.follow import shown
from heel.services.commands.observed import TOPICS, Observed, facts, sight
from heel.services.commands.robot import RobotFlags, Where, ask, for_robot
from heel.services.commands.robots import show_all
from heel.services.commands.screen import Screen
from heel.services.runtime.chain import (
    CERTIFICATE,
    WITHHELD,
    Part,
    PartState,
    Problem,
    describe,
    fails,
)
from heel.services.runtime.logs import printable
from heel.services.runtime.process import software_version

_LISTEN_S = 1.3
"""Seconds of listening: five messages of health of most services, and one of those that send it
once a second."""
_WATCH_S = 1.0
"""Seconds between two looks of `--watch`."""
_SHM = {True: "yes", False: "no", None: "-"}


@for_robot
def status(
    robot: RobotFlags,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="show it anew every second until Ctrl-C")
    ] = False,
    everyone: Annotated[
        bool,
        typer.Option(
            "--all", help="every robot of the router and every run on this machine, a line each"
        ),
    ] = False,
) -> None:
    """Show which services run, who is missing, who is in sight and what the follower is doing.

    Ends with 1 if anything is not as it should be, and names it.
    """
    if everyone:
        if show_all(robot.find_all(), as_json, watch, _LISTEN_S, _WATCH_S):
            raise typer.Exit(1)
        return
    where = robot.find()
    heard = Observed()
    for_s = None if watch else _LISTEN_S
    with listening(where, TOPICS, for_s, alive=True, quiet=watch) as bus:
        _ask_for_state(bus, heard)
        if watch:
            _watch(bus, heard, as_json)
            return
        for arrival in bus.turns():
            if arrival is not None:
                heard.take(arrival)
    now_s = time.monotonic()
    problems = heard.problems(where, now_s)
    if not heard.watch.parts and not problems:
        raise HeelError(
            f"no service is running at {where.router}: start some with `heel demo`, or name the "
            "router with --connect and the robot with --namespace"
        )
    rows = heard.watch.rows(now_s)
    if as_json:
        typer.echo(json.dumps(_as_json(heard, where, rows, problems, now_s), indent=2))
    else:
        for line in lines(heard, where, rows, problems, now_s):
            typer.echo(line)
        for line in heard.unreadable:
            typer.echo(line, err=True)
    failing = any(fails(part.health) for part, state in rows if state == "ok")
    if problems or failing or heard.stops(now_s).differ:
        raise typer.Exit(1)


def _ask_for_state(bus: Listening, heard: Observed) -> None:
    try:
        state = ask(bus.session, keys.FOLLOW_STATE, FollowState)
    except HeelError as error:
        heard.note_unreadable(keys.FOLLOW_STATE, error)
    else:
        if isinstance(state, FollowState):
            heard.take_state(state, time.monotonic())


def _watch(bus: Listening, heard: Observed, as_json: bool) -> None:
    next_s = time.monotonic() + _LISTEN_S
    with Screen(plain=as_json) as screen:
        for arrival in bus.turns():
            now_s = time.monotonic()
            if arrival is not None:
                heard.take(arrival)
            if now_s < next_s:
                continue
            next_s = now_s + _WATCH_S
            rows, problems = heard.watch.rows(now_s), heard.problems(bus.where, now_s)
            if as_json:
                screen.show([json.dumps(_as_json(heard, bus.where, rows, problems, now_s))])
            else:
                told = lines(heard, bus.where, rows, problems, now_s)
                screen.show([*bus.away_lines(now_s), *told])


def _as_json(
    heard: Observed, where: Where, rows: list[tuple[Part, PartState]], problems: list[Problem],
    now_s: float,
) -> dict[str, Any]:  # fmt: skip
    follower, drive = heard.state_now(now_s), heard.drive_now(now_s)
    return {
        "router": where.router,
        "run": None if where.run is None else where.run.model_dump(mode="json"),
        "page": heard.page,
        "problems": describe(problems),
        "services": [
            {"heard": state} | part.health.model_dump(mode="json") for part, state in rows
        ],
        "follower": None if follower is None else follower.model_dump(mode="json"),
        "drive": None if drive is None else drive.model_dump(mode="json"),
        "people": heard.people(now_s),
    } | heard.stops(now_s).as_json()


def lines(
    heard: Observed, where: Where, rows: list[tuple[Part, PartState]], problems: list[Problem],
    now_s: float,
) -> list[str]:  # fmt: skip
    """All that was heard, as lines for a user. Services' own texts are shown as they are."""
    told = [f"router {where.router}{_run_of(where)}"]
    if heard.page is not None:
        told.append(f"page {heard.page}")
    if where.run is not None and where.run.logs is not None:
        told.append(f"logs {printable(where.run.logs)}")
    told += ["", *_health_table(rows), ""]
    told += _versions(heard)
    told += [printable(problem.words) for problem in problems]
    told += [
        f"{part.health.service}/{part.health.instance}: {printable(part.health.reason)}"
        for part, state in rows
        if part.health.reason and state == "ok"
    ]
    told += [
        f"{part.health.service}/{part.health.instance}: {printable(part.health.details[detail])}"
        for detail in (WITHHELD, CERTIFICATE)
        for part, state in rows
        if detail in part.health.details and state == "ok"
    ]
    if heard.watch.unlisted:
        told.append(f"{heard.watch.unlisted} further senders of health are not listed")
    return told + doing_lines(heard, now_s)


def _run_of(where: Where) -> str:
    if where.run is None:
        return ""
    robot = f", robot {where.run.robot}" if where.run.robot else ""
    return f"  (heel {where.run.kind}, process {where.run.pid}{robot})"


def _versions(heard: Observed) -> list[str]:
    """That there are several versions; nothing where all services have this command's."""
    others = {name: one for name, one in heard.versions.items() if one != software_version()}
    if not others:
        return []
    told = ", ".join(f"{name} {printable(one, 40)}" for name, one in sorted(others.items()))
    return [f"versions: {told}; here {software_version()}: install one version everywhere"]


def doing_lines(heard: Observed, now_s: float) -> list[str]:
    """Whether the robot is stopped, what follower and drive do, and who is in sight."""
    stops, follower, drive = heard.stops(now_s), heard.state_now(now_s), heard.drive_now(now_s)
    told = [stops.words] if stops.words else []
    if follower is not None:
        state = printable(f"{follower.state} ({follower.reason})")
        told.append(f"follower: {state}, target {shown(follower.target)}")
        told.append(f"follower: {facts(follower)}")
    if drive is not None:
        told.append(f"drive: {printable(f'{drive.state} ({drive.reason})')}")
    if heard.tracks is not None:
        told.append(sight(heard.people(now_s)))
    return told


def _health_table(rows: list[tuple[Part, PartState]]) -> list[str]:
    table = [("service", "state", "in/s", "out/s", "dropped", "p99 ms", "MB", "shm")]
    for part, state in rows:
        h = part.health
        name = f"{h.service}/{h.instance}"
        if state != "ok":
            table.append((name, state, "", "", "", "", "", ""))
            continue
        table.append((
            name, h.state, f"{h.rate_in_hz:.1f}", f"{h.rate_out_hz:.1f}", str(h.dropped),
            f"{h.age_ms_p99:.1f}", f"{h.rss_mb:.0f}", _SHM[h.shared_memory],
        ))  # fmt: skip
    return aligned(table, right=frozenset(range(2, 7)))
