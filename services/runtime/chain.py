"""The parts needed for a person to be followed, and which are gone, silent or there twice.

Two signals, neither of which is enough: a liveliness token goes at once when a process ends or its
connection breaks, but stays while it hangs; health comes four times a second from
every part that works.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from heel.schemas import Health

CHAIN = ("capture", "detector", "tracker", "follower", "drive")
"""From the picture to the wheels: each works on what the one before it sends."""
CAMERA, PERCEPTION, MISSING, WITHHELD = "camera", "perception", "missing", "withheld"
"""Details of a service's health: the camera that it works for; what stands in for the detector;
which parts of the chain it has seen going; why people that may be in sight are not shown."""
STANDBY = "standby"
"""Another one: that it sends nothing, and waits to take over from the one that does."""
CERTIFICATE = "certificate"
"""Another one: that its certificate ends soon."""
_PER_CAMERA = ("capture", "detector", "tracker")
_ONE_AT_A_TIME = (*CHAIN, "simulator", "ros2")
_KNOWN = (*_ONE_AT_A_TIME, "web", "recorder")
_MOST_OF_A_KIND = 4
"""Parts of one known kind that are remembered; chosen by hand, a robot has one or two."""
_MOST_OTHERS = 12
"""Parts of unknown kinds that are remembered; chosen by hand."""
MAX_PARTS = _MOST_OF_A_KIND * len(_KNOWN) + _MOST_OTHERS
BEATS_MISSED = 3
"""Health messages in a row that may fail to come before a part counts as silent."""
_SLOWEST_BEAT_S = 1.0
"""Seconds: a part that states a longer period of health is held to this one. Chosen by hand."""
_MUTE_S = 1.0
"""Seconds that a part may be known without a word of health: four messages. Chosen by hand."""
_GONE_AFTER_S = 0.3
"""A token that comes back sooner was a connection made anew."""

PartState = Literal["ok", "silent", "gone", "ended"]


@dataclass(frozen=True, slots=True)
class Problem:
    """What keeps a person from being followed, in words for a user."""

    part: str
    kind: Literal["gone", "silent", "doubled", "bus", "fails"]
    words: str


@dataclass(slots=True)
class Part:
    """One process, as far as it was heard of."""

    health: Health
    first_s: float
    heard_s: float

    @property
    def limit_s(self) -> float:
        """Silence beyond this is no coincidence."""
        return BEATS_MISSED * min(self.health.period_s, _SLOWEST_BEAT_S)

    @property
    def stands_by(self) -> bool:
        """Whether it sends nothing, and waits to take over from the one that does."""
        return STANDBY in self.health.details

    @property
    def role(self) -> tuple[str, str]:
        """What only one process at a time should do; the camera where each has its own."""
        service = self.health.service
        return service, self.health.details.get(CAMERA, "") if service in _PER_CAMERA else ""


@dataclass(slots=True)
class ChainWatch:
    """Collects health and tokens and says what is wrong. Pure: the caller brings the time.

    Args:
        own: producer name of the process that watches; that it hears itself says nothing.
    """

    own: str = ""
    parts: dict[str, Part] = field(default_factory=dict)
    """By producer. Bounded, and a part that is still heard is not pushed out by newcomers."""
    unlisted: int = 0
    """Senders that found no place."""
    _tokens: dict[tuple[str, str], tuple[bool, float]] = field(default_factory=dict)
    """Whether it is there, and since when."""

    def hear(self, health: Health, now_s: float) -> None:
        """A service spoke of itself."""
        part = self.parts.get(health.producer)
        if part is not None:
            part.health, part.heard_s = health, now_s
            return
        for producer in self._replaced_by(health, now_s):
            del self.parts[producer]
        if not self._has_place(health.service, now_s):
            self.unlisted += 1
            return
        self.parts[health.producer] = Part(health, now_s, now_s)

    def token(self, service: str, instance: str, present: bool, now_s: float) -> None:
        """A liveliness token came or went."""
        name = (service, instance)
        if service in _KNOWN and (name in self._tokens or len(self._tokens) < MAX_PARTS):
            self._tokens[name] = (present, now_s)

    def state(self, part: Part, now_s: float) -> PartState:
        """How it is with a part at this moment."""
        if part.health.state == "ended":
            return "ended"
        name = (part.health.service, part.health.instance)
        present, since_s = self._tokens.get(name, (True, now_s))
        if not present and part.heard_s <= since_s + _GONE_AFTER_S < now_s:
            return "gone"
        return "silent" if now_s - part.heard_s > part.limit_s else "ok"

    def bus_silent_s(self, now_s: float) -> float | None:
        """Since when no part at all is heard though one was; None while one is."""
        others = [
            part for part in self.parts.values()
            if part.health.producer != self.own and part.health.state != "ended"
        ]  # fmt: skip
        if len(others) < 2 or any(self.state(part, now_s) != "silent" for part in others):
            return None
        return now_s - max(part.heard_s for part in others)

    def problems(self, now_s: float) -> list[Problem]:
        """What is wrong, first things first; nothing that has been put right since."""
        silent_s = self.bus_silent_s(now_s)
        if silent_s is not None:
            return [
                Problem("bus", "bus", f"nothing is heard from any service for {silent_s:.0f} s")
            ]
        found = [problem for role in self._roles() for problem in self._of_role(role, now_s)]
        return sorted(found, key=lambda problem: _place(problem.part))

    def missing(self, expected: Iterable[str], now_s: float) -> list[Problem]:
        """Parts that are expected, or stand between two that are there, and were never heard."""
        expected = set(expected)
        live = {part.health.service for part in self.parts.values()
                if self.state(part, now_s) == "ok"}  # fmt: skip
        known = {part.health.service for part in self.parts.values()}
        known |= {service for service, _ in self._tokens}
        stands_in = _stood_in_for(self.parts.values())
        there = [n for n, service in enumerate(CHAIN) if service in live | stands_in]
        wanted = set(expected)
        if len(there) > 1:
            # Where an unknown part sends the first part's input, what is behind it is its own.
            first = min(there) if CHAIN[min(there)] in stands_in else 0
            wanted |= set(CHAIN[first : max(there) + 1])
        absent = sorted(wanted - known - stands_in, key=_place)
        told = {True: "gone", False: "not there"}
        return [
            Problem(service, "gone", f"{service}: {told[service in expected]}")
            for service in absent
        ]

    def _roles(self) -> list[tuple[str, str]]:
        """Every role that is or was filled, those included that were never heard."""
        heard = {part.role for part in self.parts.values()}
        mute = {service for service, _ in self._tokens} - {service for service, _ in heard}
        return sorted(heard | {(service, "") for service in mute})

    def _of_role(self, role: tuple[str, str], now_s: float) -> list[Problem]:
        service = role[0]
        if service not in _KNOWN:
            return []
        filled = [part for part in self.parts.values() if part.role == role]
        parts = [part for part in filled if not part.stands_by]
        if not filled:
            return self._of_mute(service, now_s)
        if not parts:
            return []
        live = [part for part in parts if self.state(part, now_s) == "ok"]
        if service in _ONE_AT_A_TIME and len(live) > 1 and _overlap(live):
            names = ", ".join(sorted(part.health.producer for part in live))
            return [Problem(service, "doubled", f"{_count(live)} {service}s: {names}: stop one")]
        last = max(parts, key=lambda part: part.heard_s)
        state = self.state(last, now_s)
        if live or self._taken_over(role, now_s):
            return []
        if state == "silent":
            silent_s = now_s - last.heard_s
            return [Problem(service, "silent", f"{service}: silent for {max(1.0, silent_s):.0f} s")]
        if state == "ended" and service not in _ONE_AT_A_TIME:
            return []
        return [Problem(service, "gone", f"{service}: {state}")]

    def _of_mute(self, service: str, now_s: float) -> list[Problem]:
        """Of a service that has, or had, a token and was never heard: it hung before we came."""
        tokens = [token for (name, _), token in self._tokens.items() if name == service]
        if not any(present for present, _ in tokens):
            return [Problem(service, "gone", f"{service}: gone")]
        silent_s = now_s - min(since_s for _, since_s in tokens)
        if silent_s < _MUTE_S:
            return []
        return [Problem(service, "silent", f"{service}: silent for {silent_s:.0f} s or more")]

    def _taken_over(self, role: tuple[str, str], now_s: float) -> bool:
        """Whether a part does this work that does not say for which camera."""
        service, camera = role
        return any(
            part.health.service == service and "" in (camera, part.role[1])
            and self.state(part, now_s) == "ok"
            for part in self.parts.values()
        )  # fmt: skip

    def _replaced_by(self, health: Health, now_s: float) -> list[str]:
        """Parts that a newcomer takes the place of: the same part, no longer heard."""
        return [
            producer for producer, part in self.parts.items()
            if (part.health.service, part.health.instance) == (health.service, health.instance)
            and self.state(part, now_s) != "ok"
        ]  # fmt: skip

    def _has_place(self, service: str, now_s: float) -> bool:
        kind = [p for p in self.parts.items() if _kind(p[1].health.service) == _kind(service)]
        if len(kind) < (_MOST_OF_A_KIND if service in _KNOWN else _MOST_OTHERS):
            return True
        quiet = [(part.heard_s, producer) for producer, part in kind
                 if self.state(part, now_s) != "ok"]  # fmt: skip
        if not quiet:
            return False
        del self.parts[min(quiet)[1]]
        return True

    def rows(self, now_s: float) -> list[tuple[Part, PartState]]:
        """Every part with its state, the chain's first and in its order."""
        listed = sorted(
            self.parts.values(),
            key=lambda part: (_place(part.health.service), part.health.instance, part.first_s),
        )
        return [(part, self.state(part, now_s)) for part in listed]


_PAGE = re.compile(r"https?://[a-zA-Z0-9.:\[\]-]{1,80}:[0-9]{1,5}/")


def page_of(health: Health) -> str | None:
    """The address at which a web service says that its page is; None of any other part.

    People open it in a browser: what does not look like one of Heel's pages is not passed on.
    """
    url = health.details.get("url", "")
    return url if health.service == "web" and _PAGE.fullmatch(url) else None


def fails(health: Health) -> bool:
    """Whether a service that sends health does not do its work; a degraded one may still do it."""
    idle = health.rate_out_hz == 0.0 and health.service in CHAIN
    return health.state == "error" or (health.state == "degraded" and idle)


def describe(problems: Iterable[Problem]) -> list[dict[str, Any]]:
    """Problems as JSON."""
    return [{"part": one.part, "kind": one.kind, "words": one.words} for one in problems]


def _overlap(parts: list[Part]) -> bool:
    """Whether one was still heard after another had begun: no replacement, but two at once."""
    return min(part.heard_s for part in parts) > max(part.first_s for part in parts)


def _count(parts: list[Part]) -> str:
    return {2: "two", 3: "three"}.get(len(parts), str(len(parts)))


def _kind(service: str) -> str:
    return service if service in _KNOWN else ""


def _place(service: str) -> int:
    return _KNOWN.index(service) if service in _KNOWN else len(_KNOWN)


def _stood_in_for(parts: Iterable[Part]) -> set[str]:
    """What others do in place of the chain's own: simulator, ROS, another sender that is heard."""
    stands_in: set[str] = set()
    for part in parts:
        service, age_s = part.health.service, part.health.input_age_s
        if part.health.state == "ended":
            continue
        if service == "ros2":
            stands_in.add("capture")
        elif service == "simulator":
            stands_in.add("capture")
            if part.health.details.get(PERCEPTION) == "simulated-boxes":
                stands_in.add("detector")
        elif service in CHAIN[1:] and age_s is not None and age_s < _SLOWEST_BEAT_S:
            stands_in.add(CHAIN[CHAIN.index(service) - 1])
    return stands_in
