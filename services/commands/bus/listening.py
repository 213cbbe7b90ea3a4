"""Listening to the robot's bus for a while: until enough was heard, the time is over, or Ctrl-C."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas import HeelError, keys
from heel.schemas.errors import SettingsError
from heel.services.commands.bus.message import Received
from heel.services.commands.robot import TIMEOUT_S, Where, session_with

if TYPE_CHECKING:
    import zenoh

    from heel.services.runtime.inbox import Arrival, Inbox

_POLL_S = 0.1
"""Longest wait for a message [s] before signals, deadlines and the router are looked at; chosen by
hand."""
_LOOK_S = 0.5
"""Seconds between two looks whether the router is there; chosen by hand."""
_SETTLED_S = 2.0
"""Seconds after which a session that was opened has told of its router; chosen by hand."""
EVERYTHING = "**"
"""The key expression of all topics, known or not."""
_RING = 256
"""Messages that may wait to be looked at; chosen by hand, what is more is counted as missed."""

For = Annotated[
    float | None,
    typer.Option("--for", help="end after so many seconds", min=0.0, metavar="SECONDS"),
]
Count = Annotated[int | None, typer.Option(help="end after so many messages", min=1, metavar="N")]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON, one object a line")]


def _completed(incomplete: str) -> list[str]:
    return [name for name in keys.TOPICS if name.startswith(incomplete)]


Topic = Annotated[
    str,
    typer.Argument(
        autocompletion=_completed,
        help="a topic by the last word of its key (tracks), a key (cam/front/tracks), or a pattern "
        "(cam/*/tracks, **)",
        metavar="TOPIC",
    ),
]


def key_of(topic: str) -> str:
    """The key expression of a topic as a user names it.

    Raises:
        SettingsError: it is no key expression.
    """
    import zenoh

    named = keys.TOPICS.get(topic, topic)
    try:
        return str(zenoh.KeyExpr(named))
    except zenoh.ZError:
        raise SettingsError(
            f"{topic[:80]!r} is no topic: name one of {', '.join(keys.TOPICS)}, or a key"
        ) from None


@dataclass
class Listening:
    """A session that hears some keys, and the turns of a loop that looks at what it heard."""

    where: Where
    session: zenoh.Session
    inbox: Inbox
    until_s: float
    """Monotonic; the end of what was asked for."""
    stop: threading.Event
    quiet: bool = False
    """Whether the caller itself says that the router is away."""
    away_since_s: float | None = None
    """Monotonic; None while the router is there."""
    _looked_s: float = field(default=float("-inf"))
    _begun_s: float = field(default_factory=time.monotonic)

    def turns(self) -> Iterator[Arrival | None]:
        """Every message, and None now and then while there is none, until the end.

        Raises:
            HeelError: the run that is listened to has ended.
        """
        while not self.stop.is_set() and (now_s := time.monotonic()) < self.until_s:
            self._look_at_router(now_s)
            yield self.inbox.get(min(_POLL_S, self.until_s - now_s))

    @property
    def missed(self) -> int:
        """Messages that this process was too slow for."""
        return sum(self.inbox.overflowed.values())

    def away_lines(self, now_s: float) -> list[str]:
        """That the router is away, as lines for a user; none while it is there."""
        if self.away_since_s is None:
            return []
        return [f"the router does not answer for {now_s - self.away_since_s:.0f} s"]

    def _look_at_router(self, now_s: float) -> None:
        from heel.services.runtime.presence import connected
        from heel.services.runtime.registry import is_over

        if now_s - self._looked_s < _LOOK_S:
            return
        self._looked_s = now_s
        there, run = connected(self.session), self.where.run
        if not there and run is not None and is_over(run):
            raise HeelError(f"heel {run.kind} (process {run.pid}) has ended")
        if there != (self.away_since_s is not None) or now_s - self._begun_s < _SETTLED_S:
            return
        self.away_since_s = None if there else now_s
        if not self.quiet:
            words = "is back" if there else "does not answer, waiting for it"
            sys.stderr.write(f"heel: the router at {self.where.router} {words}\n")


@contextmanager
def listening(
    where: Where,
    topics: Mapping[str, str],
    for_s: float | None,
    alive: bool = False,
    quiet: bool = False,
) -> Iterator[Listening]:
    """Hear every message of some key expressions for so long.

    Args:
        where: the robot.
        topics: key expressions by the name that their arrivals get.
        for_s: seconds; None: until Ctrl-C.
        alive: whether liveliness tokens are heard, too, as `alive`.
        quiet: whether the caller itself says that the router is away.

    Raises:
        HeelError: the router cannot be reached.
    """
    import zenoh
    from zenoh.handlers import RingChannel

    from heel.services.runtime.inbox import Inbox
    from heel.services.runtime.qos import TopicQos
    from heel.services.runtime.session import MAX_MESSAGE_BYTES
    from heel.services.runtime.stop_signals import stop_signals

    # Only how it is received counts here.
    qos = TopicQos(
        zenoh.Priority.DATA, zenoh.CongestionControl.DROP, False, _RING, MAX_MESSAGE_BYTES
    )
    with stop_signals(TIMEOUT_S) as stop, session_with(where) as session:
        with Inbox(session) as inbox, ExitStack() as stack:
            for topic, key in topics.items():
                inbox.subscribe(topic, key, qos)
            if EVERYTHING in topics.values():
                # Where access rules refuse that, it still hears what comes for these.
                for key in keys.TOPICS.values():
                    opened = session.declare_subscriber(key, RingChannel(1))
                    stack.callback(opened.undeclare)
            if alive:
                inbox.subscribe_alive("alive", keys.ALL_ALIVE)
            until_s = time.monotonic() + (float("inf") if for_s is None else for_s)
            yield Listening(where, session, inbox, until_s, stop, quiet)


def received(arrival: Arrival, largest: int) -> Received:
    """A message of an inbox; its payload only up to so many bytes."""
    encoding = arrival.encoding
    wanted = arrival.size <= largest and not encoding.startswith("image/")
    return Received(
        arrival.key, arrival.arrived_s, arrival.size, encoding, arrival.attachment,
        arrival.payload if wanted else None,
    )  # fmt: skip
