"""`python -m benchmarks.hostile_messages`: a person is followed while somebody floods the bus.

The whole stack runs as real processes and follows a drawn person, as in `benchmarks.time_to_stop`.
A client without a password then sends messages made from the stack's own: most of them spoilt (they
must be refused), some well formed under other producers' names, and a few under the true names with
a sequence number that no producer reaches; and it asks every queryable what nobody asks. Counted is
what must not happen: a service that ends,
a stream that is silent, memory that grows, a robot that stops following.
"""

from __future__ import annotations

import functools
import json
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import msgpack
import typer
import zenoh
from zenoh.handlers import RingChannel

from benchmarks.common import Write, publish, wait_for
from benchmarks.hostile.mutations import CAMERA, TOPICS, Kind, Mutations, Wire
from benchmarks.stopping.rig import Rig
from heel.schemas import keys
from heel.services.runtime.process import memory_mb

WATCHED = {"tracks": keys.tracks(CAMERA), "commands": keys.FOLLOW_COMMAND,
           "drive": keys.ROBOT_DRIVE}  # fmt: skip
LONGEST_SILENCE_S = 1.0
MOST_GROWTH_MB = 150.0
"""Of a service, once 10 % of the messages have gone by; chosen by hand: its rings and glibc's
arenas fill up once, a leak of one kB a message would be 900 MB."""
MOST_LINES_S = 1.05
"""Once a second is what a service says of one kind of trouble."""
_KINDS = ("refused", "epoch", "an end that")
_QUESTION_EVERY = 20
_ANSWER_S = 0.5
_TRACKS_S = 60.0
_LEARN_S, _CALM_S = 6.0, 10.0
_MOST_RECORDED = 60
_REASONS_SHOWN = 8
_BURST = 50
_LEAP_EVERY_S = 2.0
_RIVAL_SHARE = 0.1
_PRIORITIES = (zenoh.Priority.REAL_TIME, zenoh.Priority.DATA, zenoh.Priority.BACKGROUND)

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of the stack."""

    messages: int
    seconds: float
    ended: tuple[str, ...]
    longest_silence_s: dict[str, float]
    following_before: float
    following_during: float
    following_after: float
    not_following: dict[str, int]
    target_kept: bool
    growth_mb: dict[str, float]
    log_kb: float
    lines_s: dict[str, float]
    """Of each service, of the kind of line that it wrote most often, a second."""

    def faults(self) -> list[str]:
        """What must not have happened and did."""
        found = [f"{name} ended" for name in self.ended]
        found += [f"{name} silent for {s:.2f} s" for name, s in self.longest_silence_s.items()
                  if s > LONGEST_SILENCE_S]  # fmt: skip
        found += [f"{name} grew by {mb:.0f} MB" for name, mb in self.growth_mb.items()
                  if mb > MOST_GROWTH_MB]  # fmt: skip
        found += [f"{name} wrote {rate:.1f} lines a second of one kind"
                  for name, rate in self.lines_s.items() if rate > MOST_LINES_S]  # fmt: skip
        if not self.target_kept:
            found.append("another target")
        return found


class Onlooker:
    """Hears the true streams: how long each is silent, and how much of the time is following."""

    def __init__(self, session: zenoh.Session) -> None:
        self._last_s: dict[str, float] = {}
        self._true: dict[str, str] = {}
        self.silence_s: dict[str, float] = dict.fromkeys(WATCHED, 0.0)
        self.states: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        for name, key in WATCHED.items():
            session.declare_subscriber(key, functools.partial(self._hear, name))

    def settle(self) -> None:
        """From now on only producers heard so far are true, and silence counts from here."""
        self._last_s.clear()
        self.silence_s = dict.fromkeys(WATCHED, 0.0)
        self.states.clear()
        self.reasons.clear()

    def following(self) -> float:
        """Share of commands that say so since `settle`."""
        return self.states["following"] / max(1, sum(self.states.values()))

    def _hear(self, name: str, sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        if sample.attachment is None:
            return
        try:
            producer = msgpack.unpackb(sample.attachment.to_bytes())["producer"]
            message = msgpack.unpackb(sample.payload.to_bytes())
            seq = message["seq"]
        except (ValueError, TypeError, KeyError, msgpack.UnpackException):
            return
        if producer != self._true.setdefault(name, producer) or not isinstance(seq, int):
            return
        if seq > 2**39:
            return  # one of ours
        if name in self._last_s:
            self.silence_s[name] = max(self.silence_s[name], now_s - self._last_s[name])
        self._last_s[name] = now_s
        if name == "commands":
            self.states[str(message.get("state"))] += 1
            if message.get("state") != "following":
                self.reasons[str(message.get("reason"))] += 1


def attack(
    rig: Rig, count: int, rate_hz: float, seed: int, calm_s: float = _CALM_S, driving: bool = True
) -> Outcome:
    """Send `count` hostile messages to a stack that follows somebody.

    Args:
        rig: the stack, which may not be following yet.
        count: of messages.
        rate_hz: at most so many a second.
        seed: of what is sent.
        calm_s: for so long following is judged before and after.
        driving: whether to wait until the robot drives.
    """
    if driving:
        rig.await_driving()
    onlooker = Onlooker(rig.session)
    recorded = _recorded(rig.session)
    onlooker.settle()
    time.sleep(calm_s)
    before = onlooker.following()
    target_before = _target(rig.session)
    mutations = Mutations(recorded, seed)
    onlooker.settle()
    logged = {name: len(text) for name, text in rig.logs().items()}
    started_s = time.monotonic()
    memory: dict[str, float] = {}
    with _client(rig) as client:
        for sent in _sending(client, mutations, count, rate_hz):
            if not memory and sent >= 0.1 * count:
                memory = _memory_mb(rig)
    seconds = time.monotonic() - started_s
    during, silence_s = onlooker.following(), dict(onlooker.silence_s)
    reasons = dict(onlooker.reasons.most_common(_REASONS_SHOWN))
    onlooker.settle()
    time.sleep(calm_s)
    return Outcome(
        messages=count, seconds=seconds, ended=tuple(rig.ended()), longest_silence_s=silence_s,
        following_before=before, following_during=during, following_after=onlooker.following(),
        not_following=reasons,
        target_kept=_target(rig.session) == target_before,
        growth_mb={name: mb - memory.get(name, mb) for name, mb in _memory_mb(rig).items()},
        log_kb=rig.log_bytes() / 1e3,
        lines_s={
            f"{name}: {kind}": rate
            for name, text in rig.logs().items()
            for kind, rate in Counter(
                lines_a_kind(text[logged.get(name, 0) :], seconds + calm_s)
            ).most_common(1)
        },
    )  # fmt: skip


def _sending(
    client: zenoh.Session, mutations: Mutations, count: int, rate_hz: float
) -> Iterator[int]:
    started_s = time.monotonic()
    leap_s = started_s + _LEAP_EVERY_S
    for sent in range(1, count + 1):
        kind: Kind = "rival" if sent % round(1 / _RIVAL_SHARE) == 0 else "junk"
        if time.monotonic() >= leap_s:
            kind, leap_s = "leap", leap_s + _LEAP_EVERY_S
        wire = mutations.draw(kind)
        client.put(
            wire.key, wire.payload, encoding=wire.encoding, attachment=wire.attachment,
            congestion_control=(
                zenoh.CongestionControl.BLOCK if sent % 2 else zenoh.CongestionControl.DROP
            ),
            priority=_PRIORITIES[sent % len(_PRIORITIES)],
        )  # fmt: skip
        if sent % _QUESTION_EVERY == 0:
            _ask(client, mutations.question())
        if sent % _BURST == 0:
            time.sleep(max(0.0, started_s + sent / rate_hz - time.monotonic()))
            yield sent


def _ask(client: zenoh.Session, question: Wire) -> None:
    """Ask, and read nothing of the answer."""
    client.get(
        question.key, RingChannel(1), payload=question.payload, encoding=question.encoding,
        attachment=question.attachment, timeout=_ANSWER_S, target=zenoh.QueryTarget.ALL,
        congestion_control=zenoh.CongestionControl.DROP,
    )  # fmt: skip


def lines_a_kind(log: str, seconds: float) -> dict[str, float]:
    """Lines a second of each kind of warning: what it is about, and of several what it says."""
    counts: Counter[str] = Counter()
    for line in log.splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            counts["not a line of the log"] += 1
            continue
        about, _, said = str(record.get("message")).partition(": ")
        kind = next((word for word in _KINDS if said.startswith(word)), "")
        counts[f"{about} {kind}".strip()[:80]] += 1
    return {kind: count / seconds for kind, count in counts.items()}


def _recorded(session: zenoh.Session) -> dict[str, list[Wire]]:
    heard: defaultdict[str, list[Wire]] = defaultdict(list)

    def keep(sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        if key in TOPICS and len(heard[key]) < _MOST_RECORDED:
            attachment = None if sample.attachment is None else sample.attachment.to_bytes()
            payload = sample.payload.to_bytes()
            heard[key].append(Wire(key, payload, str(sample.encoding), attachment))

    subscriber = session.declare_subscriber("**", keep)
    wait_for(lambda: keys.tracks(CAMERA) in heard, _TRACKS_S, "no tracks on the bus")
    time.sleep(_LEARN_S)
    subscriber.undeclare()  # type: ignore[no-untyped-call]
    return dict(heard)


def _target(session: zenoh.Session) -> object:
    for reply in session.get(keys.FOLLOW_TARGET, timeout=2.0):
        if reply.ok is not None:
            target = msgpack.unpackb(reply.ok.payload.to_bytes())
            return target["track_id"], target["tracker"]
    return None


@contextmanager
def _client(rig: Rig) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([rig.endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        yield session


def _memory_mb(rig: Rig) -> dict[str, float]:
    return {name: memory_mb(pid)[0] for name, pid in rig.pids().items()}


def table_of(outcome: Outcome) -> str:
    """Markdown: what became of the services, and of the robot."""
    lines = {name.partition(":")[0]: rate for name, rate in outcome.lines_s.items()}
    silence = ", ".join(f"{name} {s:.2f} s" for name, s in outcome.longest_silence_s.items())
    return "\n".join([
        f"{outcome.messages:,} messages in {outcome.seconds:.0f} s. Ended: "
        f"{', '.join(outcome.ended) or 'none'}. Longest silence: {silence}. Following before, "
        f"during, after: {100 * outcome.following_before:.0f}, "
        f"{100 * outcome.following_during:.0f}, {100 * outcome.following_after:.0f} %. "
        f"Faults: {'; '.join(outcome.faults()) or 'none'}.", "",
        "| process | memory, MB | lines of one kind, 1/s |", "|---|---|---|",
        *(f"| {name} | {mb:+.1f} | {f'{lines[name]:.2f}' if name in lines else '-'} |"
          for name, mb in outcome.growth_mb.items()),
    ]) + "\n"  # fmt: skip


@app.command()
def main(
    count: Annotated[int, typer.Option(help="messages to send", min=1000)] = 1_000_000,
    rate_hz: Annotated[float, typer.Option(help="messages a second at most", min=10)] = 2000.0,
    seed: Annotated[int, typer.Option(help="of what is sent")] = 1,
    driving: Annotated[
        bool, typer.Option(help="wait until the robot drives; a busy machine is too late to follow")
    ] = True,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="write the figures", metavar="FILE")
    ] = None,
    write: Write = None,
) -> None:
    """Print what became of a stack under a flood of hostile messages; exit code 1 for a fault."""
    with tempfile.TemporaryDirectory(prefix="heel-") as folder, Rig(Path(folder)) as rig:
        rig.start_viewer()
        outcome = attack(rig, count, rate_hz, seed, driving=driving)
    for name, value in asdict(outcome).items():
        shown = {key: round(one, 2) for key, one in value.items()} if isinstance(value, dict) else (
            round(value, 3) if isinstance(value, float) else value)  # fmt: skip
        print(f"{name}: {shown}")
    publish(table_of(outcome), write, "hostile")
    if json_file is not None:
        json_file.write_text(json.dumps(asdict(outcome), indent=2))
    if faults := outcome.faults():
        sys.exit(f"faults: {'; '.join(faults)}")


if __name__ == "__main__":
    app()
