"""`heel top`: a live table of the services, as they tell of themselves."""

from __future__ import annotations

import json
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Annotated, Any

import typer

from heel.schemas import Health
from heel.services.commands.bus.listening import AsJson, For, listening
from heel.services.commands.columns import aligned
from heel.services.commands.observed import TOPICS, Observed
from heel.services.commands.robot import RobotFlags, for_robot
from heel.services.commands.screen import Screen
from heel.services.commands.status import doing_lines
from heel.services.runtime.chain import Part, PartState, describe
from heel.services.runtime.logs import printable

_REFRESH_S = 1.0
"""Seconds between two tables."""
_FIRST_S = 1.3
"""Seconds before the first: two messages of health of every service, which processor time takes."""
_HEALTHS = 9
"""Messages that figures per second are of: those of two seconds."""
_MOST_SENDERS = 128
"""Senders that are remembered: bounds the memory; chosen by hand."""


@dataclass(slots=True)
class UseOverTime:
    """Processor time and losses per second, from what each sender counts since its start. Pure."""

    _heard: dict[str, deque[Health]] = field(default_factory=dict)

    def hear(self, health: Health) -> None:
        """A service spoke of itself."""
        if health.producer not in self._heard and len(self._heard) >= _MOST_SENDERS:
            self._heard.pop(next(iter(self._heard)))
        self._heard.setdefault(health.producer, deque(maxlen=_HEALTHS)).append(health)

    def cpu_percent(self, producer: str) -> float | None:
        """Of one core; None until two messages have come."""
        first, last = self._ends(producer)
        # By the sender's own clock: how long a message is on its way does not count.
        time_s = last.uptime_s - first.uptime_s if first and last else 0.0
        if first is None or last is None or time_s <= 0.0:
            return None
        return max(0.0, 100.0 * (last.cpu_s - first.cpu_s) / time_s)

    def dropped(self, producer: str) -> int:
        """Input frames lost since the first message remembered, of two seconds."""
        first, last = self._ends(producer)
        return max(0, last.dropped - first.dropped) if first and last else 0

    def _ends(self, producer: str) -> tuple[Health | None, Health | None]:
        heard = self._heard.get(producer)
        return (heard[0], heard[-1]) if heard else (None, None)


def table(rows: list[tuple[Part, PartState]], use: UseOverTime) -> list[str]:
    """The services as lines; latency is that of a frame when the result is sent."""
    told: list[tuple[str, ...]] = [
        ("service", "state", "in/s", "out/s", "busy ms", "latency ms", "p99", "cpu %", "MB",
         "dropped", "refused")
    ]  # fmt: skip
    for part, state in rows:
        h = part.health
        name = f"{h.service}/{h.instance}"
        if state != "ok":
            told.append((name, state, *[""] * (len(told[0]) - 2)))
            continue
        cpu, lost = use.cpu_percent(h.producer), use.dropped(h.producer)
        told.append((
            name, h.state, f"{h.rate_in_hz:.1f}", f"{h.rate_out_hz:.1f}", f"{h.busy_ms_p50:.1f}",
            f"{h.age_ms_p50:.0f}", f"{h.age_ms_p99:.0f}", "-" if cpu is None else f"{cpu:.0f}",
            f"{h.rss_mb:.0f}", f"{h.dropped}{f' +{lost}' if lost else ''}", str(h.malformed),
        ))  # fmt: skip
    return aligned(told, right=frozenset(range(2, 11)))


@for_robot
def top(
    robot: RobotFlags,
    for_s: For = None,
    count: Annotated[
        int | None, typer.Option(help="end after so many tables", min=1, metavar="N")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Watch the services: rates, latency, processor, memory and losses, anew every second.

    A number behind + is of the last two seconds. Ends with Ctrl-C.
    """
    heard, use, shown = Observed(), UseOverTime(), 0
    with listening(robot.find(), TOPICS, for_s, alive=True, quiet=True) as bus:
        next_s = time.monotonic() + _FIRST_S
        with Screen(plain=as_json) as screen:
            for arrival in bus.turns():
                now_s = time.monotonic()
                if arrival is not None:
                    heard.take(arrival)
                    for part in heard.watch.parts.values():
                        if part.heard_s == arrival.arrived_s:
                            use.hear(part.health)
                if now_s < next_s:
                    continue
                next_s = now_s + _REFRESH_S
                rows, problems = heard.watch.rows(now_s), heard.problems(bus.where, now_s)
                if as_json:
                    screen.show([json.dumps(
                        {"t": time.time(), "problems": describe(problems),
                         "services": [_as_json(part, state, use) for part, state in rows]}
                        | heard.stops(now_s).as_json()
                    )])  # fmt: skip
                else:
                    told = [printable(problem.words) for problem in problems]
                    screen.show([
                        f"{time.strftime('%H:%M:%S')}  router {bus.where.router}",
                        # A low terminal cuts off the end: a stop is not to be there.
                        *bus.away_lines(now_s), *doing_lines(heard, now_s),
                        *table(rows, use), *told, *([] if screen.in_place else [""]),
                    ])  # fmt: skip
                shown += 1
                if shown == count:
                    break


def _as_json(part: Part, state: PartState, use: UseOverTime) -> dict[str, Any]:
    cpu = use.cpu_percent(part.health.producer)
    figures = {"heard": state, "cpu_percent": None if cpu is None else round(cpu, 1)}
    return figures | part.health.model_dump(mode="json")
