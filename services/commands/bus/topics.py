"""`heel topics`, `heel hz`, `heel bw` and `heel echo`: what passes on the bus, without a subscriber
of one's own."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas import HeelError, keys
from heel.services.commands.bus import rates as figures
from heel.services.commands.bus.listening import (
    EVERYTHING,
    AsJson,
    Count,
    For,
    Topic,
    key_of,
    listening,
    received,
)
from heel.services.commands.bus.message import Received, as_line, as_object, tell
from heel.services.commands.bus.rates import BusRates, KeyRates, bw_line, bytes_text, hz_line
from heel.services.commands.columns import aligned
from heel.services.commands.robot import RobotFlags, for_robot
from heel.services.runtime.logs import printable

if TYPE_CHECKING:
    import zenoh

_TOPICS_S = 2.0
"""Seconds that `heel topics` listens where none are given: two messages of what comes once a
second."""
_REPORT_S = 1.0
"""Seconds between two lines of figures."""
_HINT_S = 2.0
"""Seconds without a message after which a hint is given; chosen by hand."""
_ASK_S = 0.5
"""Longest wait for the answers of those that keep a value [s]; answers take milliseconds. Chosen by
hand."""
_LATCHED = (keys.FOLLOW_STATE, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP, keys.TOPICS["info"],
            keys.SIM_WORLD)  # fmt: skip
"""Keys of values that are kept. One by one: access rules refuse wildcards beyond them."""
_LARGEST_BYTES = 1 << 20
"""Of a payload that is looked into: the largest cap of a message that is no image."""


@for_robot
def topics(
    robot: RobotFlags,
    for_s: Annotated[
        float, typer.Option("--for", help="listen for so many seconds", min=0.1, metavar="SECONDS")
    ] = _TOPICS_S,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """List what is sent on the robot's bus: kind, rate, bandwidth and sender of every topic."""
    heard, kept = BusRates(), set()
    with listening(robot.find(), {"bus": EVERYTHING}, for_s) as bus:
        for sample in _kept(bus.session, *_LATCHED):
            kept.add(sample.key)
            heard.hear(sample, tell(sample))
        for arrival in bus.turns():
            if arrival is not None:
                one = received(arrival, _LARGEST_BYTES)
                heard.hear(one, tell(one))
        missed = bus.missed
    now_s = time.monotonic()
    if not heard.keys:
        raise HeelError(f"nothing was sent for {for_s:g} s: `heel status` says who should be there")
    if as_json:
        listed = [figures.as_object(key, one, now_s) | {"latched": key in kept}
                  for key, one in heard.rows()]  # fmt: skip
        typer.echo(json.dumps({"topics": listed, "missed": missed}, indent=2))
        return
    for line in _table(heard, kept, now_s):
        typer.echo(line)
    if heard.unlisted:
        typer.echo(f"{heard.unlisted} messages on further keys")
    _say_missed(missed)


@for_robot
def hz(
    robot: RobotFlags,
    topic: Topic,
    for_s: For = None,
    count: Count = None,
    as_json: AsJson = False,
) -> None:
    """Tell every second how often TOPIC comes, how old it is, and how many messages are missing.

    Age and missing messages are those that the senders tell; pixels are not looked into.
    """
    _figures(robot, topic, for_s, count, as_json, hz_line)


@for_robot
def bw(
    robot: RobotFlags,
    topic: Annotated[str, typer.Argument(metavar="TOPIC", help="as of `heel hz`")] = EVERYTHING,
    for_s: For = None,
    count: Count = None,
    as_json: AsJson = False,
) -> None:
    """Tell every second how many bytes pass on TOPIC, or on all; of payloads, without overhead."""
    _figures(robot, topic, for_s, count, as_json, bw_line)


@for_robot
def echo(
    robot: RobotFlags,
    topic: Topic,
    for_s: For = None,
    count: Count = None,
    as_json: AsJson = False,
) -> None:
    """Print the messages on TOPIC, decoded, one a line; a value that is kept comes first.

    What has its default is left out of a line; --json prints all of it. Of an image it is the
    header.
    """
    key, shown = key_of(topic), 0

    def show(message: Received) -> None:
        told = tell(message)
        if as_json:
            typer.echo(json.dumps(as_object(message.key, told)))
        else:
            typer.echo(as_line(message.key, told))

    with listening(robot.find(), {"bus": key}, for_s) as bus:
        for sample in _kept(bus.session, key):
            if count is None or shown < count:
                show(sample)
                shown += 1
        started_s = time.monotonic()
        for arrival in bus.turns():
            if count is not None and shown >= count:
                break
            if arrival is not None:
                show(received(arrival, _LARGEST_BYTES))
                shown += 1
            elif shown == 0:
                started_s = _hint(key, started_s)
        _say_missed(bus.missed)
    _fail_without(shown, key)


def _figures(
    robot: RobotFlags, topic: str, for_s: float | None, count: int | None, as_json: bool,
    line: Callable[[str, KeyRates, float], str],
) -> None:  # fmt: skip
    key, heard, total, told = key_of(topic), BusRates(), 0, 0

    def report(now_s: float) -> None:
        for name, rates in heard.rows():
            if as_json:
                typer.echo(json.dumps(figures.as_object(name, rates, now_s)))
            else:
                typer.echo(line(name, rates, now_s))
        if len(heard.keys) > 1 and not as_json:
            whole = sum(one.bytes_per_s(now_s) for one in heard.keys.values())
            typer.echo(f"in all  {bytes_text(whole)}/s\n" if line is bw_line else "")

    with listening(robot.find(), {"bus": key}, for_s) as bus:
        started_s = reported_s = time.monotonic()
        for arrival in bus.turns():
            now_s = time.monotonic()
            if arrival is not None:
                one = received(arrival, _LARGEST_BYTES)
                heard.hear(one, tell(one))
                total += 1
            elif total == 0:
                started_s = _hint(key, started_s)
            if total == count:
                break
            if total and now_s - reported_s >= _REPORT_S:
                reported_s, told = now_s, total
                report(now_s)
        if total > told:
            report(time.monotonic())
        _say_missed(bus.missed)
    _fail_without(total, key)


def _kept(session: zenoh.Session, *wanted: str) -> list[Received]:
    """Values that their senders keep for those who come late."""
    from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY

    found: list[Received] = []
    for key in wanted:
        for reply in session.get(key, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=_ASK_S):
            if (sample := reply.ok) is None:
                continue
            payload = sample.payload.to_bytes() if len(sample.payload) <= _LARGEST_BYTES else None
            found.append(Received(
                str(sample.key_expr), time.monotonic(), len(sample.payload), str(sample.encoding),
                None if sample.attachment is None else sample.attachment.to_bytes(), payload,
            ))  # fmt: skip
    return found


def _hint(key: str, started_s: float) -> float:
    """Say once that nothing comes; the time from which on it would be said again: never."""
    if time.monotonic() - started_s < _HINT_S:
        return started_s
    sys.stderr.write(f"heel: nothing on {key} yet: `heel topics` lists what is sent\n")
    return float("inf")


def _fail_without(total: int, key: str) -> None:
    """Fail where nothing came.

    Raises:
        HeelError: nothing came.
    """
    if total == 0:
        raise HeelError(f"nothing came on {key}: `heel topics` lists what is sent")


def _say_missed(missed: int) -> None:
    if missed:
        sys.stderr.write(f"heel: {missed} further messages came faster than they were looked at\n")


def _table(heard: BusRates, kept: set[str], now_s: float) -> list[str]:
    table = [("topic", "kind", "per s", "bytes/s", "ms old", "sent by")]
    for key, rates in heard.rows():
        rate_hz, ages_s = rates.rate_hz(now_s), rates.ages_s(now_s)
        table.append((
            printable(key, 120),
            printable(rates.kind, 40),
            f"{rate_hz:.1f}" if rate_hz else "kept" if key in kept else "once",
            bytes_text(rates.bytes_per_s(now_s)) if rate_hz else "-",
            f"{statistics.median(ages_s) * 1e3:.0f}" if ages_s else "-",
            ", ".join(one.partition("@")[0] for one in list(rates.producers)[:3]) or "-",
        ))  # fmt: skip
    return aligned(table, right=frozenset({2, 3, 4}))
