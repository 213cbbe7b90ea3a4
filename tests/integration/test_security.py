"""Attacks on the bus as `heel security init` sets it up: every row of docs/guides/security.md.

One router and one session per role for all of them, over TLS, and again over QUIC. A message that
the router refuses leaves no trace, so each attack is followed by something that its sender may
send: what arrives after it arrives without it.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import RingChannel

from heel.schemas import EStop, encode, keys
from heel.services.runtime import qos
from heel.services.runtime.router import RouterSettings, open_router
from heel.services.runtime.session import with_datagrams, zenoh_config
from heel.services.runtime.settings import ZenohSettings
from heel.services.security.certificates import Certified, certify, new_authority
from heel.services.security.folder import SecurityFolder
from heel.services.security.roles import ROLES, sent_by
from tests.support.network import free_port, wait_until

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")


@dataclass
class Bus:
    """The router of a folder, a session of every role, and what the one that hears all heard."""

    made: SecurityFolder
    protocol: str
    port: int
    resources: ExitStack
    sessions: dict[str, zenoh.Session] = field(default_factory=dict)
    heard: list[tuple[str, bytes]] = field(default_factory=list)

    @property
    def endpoint(self) -> str:
        return f"{self.protocol}/127.0.0.1:{self.port}"

    def config(self, name: str) -> zenoh.Config:
        return zenoh_config(
            ZenohSettings(
                config_file=self.made.file_of(name), connect=(self.endpoint,), shared_memory=False
            )
        )

    def enter(self, name: str) -> zenoh.Session:
        session = self.sessions[name] = self.resources.enter_context(zenoh.open(self.config(name)))
        return session

    def collect(self, name: str, *wanted: str) -> list[tuple[str, bytes]]:
        """What a member hears from now on."""
        heard: list[tuple[str, bytes]] = []

        def hear(sample: zenoh.Sample) -> None:
            heard.append((str(sample.key_expr), sample.payload.to_bytes()))

        session = self.sessions[name]
        # The router refuses the first of these; within the session it hears what comes for the
        # others, in the order in which it comes.
        listeners = [session.declare_subscriber("**", hear)]
        listeners += [session.declare_subscriber(key, RingChannel(1)) for key in wanted]
        for one in listeners:
            self.resources.callback(one.undeclare)
        return heard

    def sent_before(self, name: str, heard: list[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
        """What had come by the time that something came which the member may send."""
        role = self.made.members.roles[name]
        marks = [key for key in sent_by(role) if key.startswith("svc/")] or [keys.FOLLOW_ESTOP]
        mark = (marks[0].replace("*", "fence"), f"{name}-{time.monotonic_ns()}".encode())
        sent_s: list[float] = []

        def arrived() -> bool:
            # Sent again each second: nobody may have been known yet to listen.
            if not sent_s or time.monotonic() > sent_s[-1] + 1.0:
                sent_s.append(time.monotonic())
                # The same priority and no batching, or it might overtake.
                self.sessions[name].put(*mark, congestion_control=zenoh.CongestionControl.BLOCK)
            return mark in heard

        wait_until(arrived, f"what {name} may send")
        return [one for one in heard[: heard.index(mark)] if not one[1].startswith(name.encode())]


@pytest.fixture(scope="module", params=["tls", "quic"])
def bus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bus]:
    folder = tmp_path_factory.mktemp("security") / "keys"
    made = SecurityFolder.create(folder)
    for role in ("watch", "sensor"):
        made.add(role, role)
    made.add("removed", "follower")
    removed = made.file_of("removed").read_bytes()
    made.remove("removed")
    made.file_of("removed").write_bytes(removed)
    port = free_port()
    settings = RouterSettings(
        config_file=made.file_of("router"), listen=(f"{request.param}/127.0.0.1:{port}",),
        shared_memory=False,
    )  # fmt: skip
    with open_router(settings), ExitStack() as resources:
        found = Bus(made, request.param, port, resources)
        for name in made.members.roles:
            found.enter(name)
        found.heard = found.collect("watch", *keys.TOPICS.values())
        wait_until(lambda: all(_heard(found, name) for name in ("drive", "capture", "operator")),
                   "the bus")  # fmt: skip
        yield found


def _heard(bus: Bus, name: str) -> bool:
    role = bus.made.members.roles[name]
    key = sent_by(role)[-1].replace("*", "start")
    bus.sessions[name].put(key, b"start")
    return (key, b"start") in bus.heard


def refused(config: zenoh.Config) -> bool:
    try:
        zenoh.open(config).close()
    except zenoh.ZError:
        return True
    return False


def with_identity(bus: Bus, identity: Certified | None) -> zenoh.Config:
    import base64

    document = {
        "mode": "client",
        "connect": {"endpoints": [with_datagrams(bus.endpoint)], "timeout_ms": 0},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"link": {"tls": {
            "root_ca_certificate": str(bus.made.folder / "authority.crt"),
        }}},
    }  # fmt: skip
    config = zenoh.Config.from_json5(json.dumps(document))
    if identity is not None:
        for what, content in (("certificate", identity.certificate), ("private_key", identity.key)):
            config.insert_json5(
                f"transport/link/tls/connect_{what}_base64",
                json.dumps(base64.b64encode(content).decode()),
            )
        config.insert_json5("transport/link/tls/enable_mtls", "true")
    return config


def authority_of(bus: Bus) -> Certified:
    folder = bus.made.folder
    return Certified(
        (folder / "authority.crt").read_bytes(), (folder / "authority.key").read_bytes(),
        bus.made.members.until["authority.crt"],
    )  # fmt: skip


def test_nobody_gets_in_without_a_certificate_that_is_valid_and_ours(bus: Bus) -> None:
    assert refused(with_identity(bus, None))
    assert refused(with_identity(bus, certify(new_authority("Heel robot", 9), "follower", 9)))
    assert refused(with_identity(bus, certify(authority_of(bus), "follower", -0.5)))
    assert not refused(with_identity(bus, certify(authority_of(bus), "follower", 9)))


def test_nobody_gets_in_past_tls(bus: Bus) -> None:
    config = with_identity(bus, None)
    plain = "udp" if bus.protocol == "quic" else "tcp"
    endpoint = with_datagrams(f"{plain}/127.0.0.1:{bus.port}")
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    assert refused(config)


def test_a_router_that_is_not_ours_gets_no_client(bus: Bus, tmp_path: Path) -> None:
    other = SecurityFolder.create(tmp_path / "other")
    port = free_port()
    settings = RouterSettings(
        config_file=other.file_of("router"), listen=(f"tls/127.0.0.1:{port}",), shared_memory=False
    )
    with open_router(settings):
        config = bus.config("follower")
        config.insert_json5("connect/endpoints", json.dumps([f"tls/127.0.0.1:{port}"]))
        assert refused(config)


@pytest.mark.parametrize("name", ["capture", "detector", "tracker", "follower", "drive", "sensor",
                                  "simulator", "ros2", "web", "recorder", "operator"])  # fmt: skip
def test_no_role_sends_what_is_another_ones(bus: Bus, name: str) -> None:
    role = bus.made.members.roles[name]
    everything = [
        key.replace("cam/*", "cam/front").replace("svc/*/*", "svc/tracker/main").replace("*", "x")
        for key in keys.TOPICS.values()
    ]
    allowed = [zenoh.KeyExpr(key) for key in sent_by(role)]
    for key in everything:
        bus.sessions[name].put(key, f"attack by {name}".encode())
    heard = bus.sent_before(name, bus.heard)
    arrived = {key for key, payload in heard if payload == f"attack by {name}".encode()}
    assert arrived == {
        key for key in everything if any(one.includes(zenoh.KeyExpr(key)) for one in allowed)
    }


def test_who_watches_and_who_was_removed_send_nothing(bus: Bus) -> None:
    removed = bus.enter("removed")
    heard = bus.collect("web", *keys.TOPICS.values())
    for session in (bus.sessions["watch"], removed):
        for key in (keys.FOLLOW_COMMAND, keys.FOLLOW_ESTOP, "svc/follower/main/health"):
            session.put(key, b"by nobody")
            session.delete(key)
    # Of those no message may come back; the time is one that others take to arrive.
    bus.sent_before("operator", heard)
    bus.sent_before("follower", heard)
    assert not [one for one in heard if one[1] == b"by nobody"]


@pytest.mark.parametrize("key", ["**", "follow/**", "*/command", "cam/*/image", "cam/front/*"])
def test_a_wildcard_reaches_nobody(bus: Bus, key: str) -> None:
    for name in ("follower", "capture", "simulator"):
        bus.sessions[name].put(key, b"wildcard")
        heard = bus.sent_before(name, bus.heard)
        assert (key, b"wildcard") not in heard


def test_who_listens_to_everything_hears_nothing(bus: Bus) -> None:
    # Not even through a subscription that somebody else's is covered by.
    heard = bus.collect("detector", "follow/**", "svc/**", keys.FOLLOW_STATE, keys.ALL_TRACKS)
    bus.sessions["follower"].put(keys.FOLLOW_COMMAND, b"secret")
    bus.sessions["follower"].put(keys.FOLLOW_STATE, b"secret")
    bus.sent_before("follower", bus.heard)
    wait_until(lambda: _sends(bus, "tracker", "cam/front/tracks", heard), "tracks for the detector")
    assert not [one for one in heard if one[1] == b"secret"]


def _sends(bus: Bus, name: str, key: str, heard: list[tuple[str, bytes]]) -> bool:
    bus.sessions[name].put(key, b"open")
    return (key, b"open") in heard


def answers(bus: Bus, name: str, key: str) -> list[bytes]:
    return [
        reply.ok.payload.to_bytes() for reply in bus.sessions[name].get(key, timeout=2.0)
        if reply.ok is not None
    ]  # fmt: skip


def answering(bus: Bus, name: str, key: str, answer: str, said: bytes) -> None:
    def reply(query: zenoh.Query) -> None:
        with query:
            if query.key_expr.intersects(zenoh.KeyExpr(answer)):
                query.reply(answer, said)

    queryable = bus.sessions[name].declare_queryable(key, reply)
    bus.resources.callback(queryable.undeclare)


def test_a_choice_is_asked_of_the_follower_by_operators_and_the_page_alone(bus: Bus) -> None:
    # Those that may not answer are there first.
    for name in ("tracker", "detector", "sensor"):
        answering(bus, name, keys.FOLLOW_TARGET, keys.FOLLOW_TARGET, b"false")
        answering(bus, name, "**", keys.FOLLOW_TARGET, b"false")
    answering(bus, "follower", keys.FOLLOW_TARGET, keys.FOLLOW_TARGET, b"true")
    wait_until(lambda: answers(bus, "operator", keys.FOLLOW_TARGET) == [b"true"], "the follower")
    assert answers(bus, "web", keys.FOLLOW_TARGET) == [b"true"]
    for name in ("watch", "drive", "capture", "simulator"):
        assert answers(bus, name, keys.FOLLOW_TARGET) == []
    for key in ("**", "follow/*"):
        assert answers(bus, "operator", key) == []


def test_what_every_service_has_is_heard_and_answered_for_all_of_them_at_once(bus: Bus) -> None:
    # A publisher sends only where it knows of a listener, unlike a plain put.
    publisher = bus.sessions["tracker"].declare_publisher("svc/tracker/main/health")
    wait_until(lambda: publisher.matching_status.matching, "who listens to health")
    answering(bus, "tracker", "svc/tracker/main/config", "svc/tracker/main/config", b"mine")
    answering(bus, "tracker", "svc/drive/main/config", "svc/drive/main/config", b"not mine")
    wait_until(lambda: answers(bus, "watch", keys.ALL_CONFIG) == [b"mine"], "its settings")


def test_nobody_is_there_under_another_ones_name(bus: Bus) -> None:
    seen: set[str] = set()
    watch = bus.sessions["web"].liveliness().declare_subscriber(
        keys.ALL_ALIVE, lambda sample: seen.add(str(sample.key_expr)), history=True
    )  # fmt: skip
    liveliness = bus.sessions["tracker"].liveliness()
    tokens = [liveliness.declare_token(f"alive/{name}/main")
              for name in ("follower", "drive", "tracker")]  # fmt: skip
    wait_until(lambda: "alive/tracker/main" in seen, "its own token")
    assert seen == {"alive/tracker/main"}
    for token in tokens:
        token.undeclare()
    watch.undeclare()


def test_what_is_too_large_ends_at_the_router(bus: Bus) -> None:
    follower = bus.sessions["follower"]
    largest = bytes(qos.COMMAND.max_bytes)
    for payload in (bytes(qos.COMMAND.max_bytes + 8192), largest):
        follower.put(keys.FOLLOW_COMMAND, payload)
    heard = bus.sent_before("follower", bus.heard)
    sizes = {len(one) for key, one in heard if key == keys.FOLLOW_COMMAND}
    assert max(sizes) == len(largest)


def test_a_stop_gets_through_while_members_flood(bus: Bus) -> None:
    """The attackers send all that they may, and what they may not, as fast as they can."""
    drive = bus.collect("drive", keys.FOLLOW_ESTOP)
    wait_until(lambda: _sends(bus, "operator", keys.FOLLOW_ESTOP, drive), "the drive")
    done = threading.Event()

    def flood(name: str, *wanted: tuple[str, int]) -> Callable[[], None]:
        def run() -> None:
            while not done.is_set():
                for key, size in wanted:
                    bus.sessions[name].put(key, bytes(size))

        return run

    attacks = [
        flood("detector", ("cam/front/blobs", 1 << 20), (keys.FOLLOW_ESTOP, 100)),
        flood("sensor", (keys.ROBOT_RANGE, 1 << 10), (keys.FOLLOW_COMMAND, 100)),
    ]
    threads = [threading.Thread(target=attack, daemon=True) for attack in attacks]
    for thread in threads:
        thread.start()
    try:
        stop = EStop(engaged=True, source="test", id="ab12", t_ns=1)
        sent = (keys.FOLLOW_ESTOP, encode(stop))

        def said_again() -> bool:
            # As every sender of ours does, see the wire's page.
            bus.sessions["operator"].put(
                *sent, priority=qos.ESTOP.priority, express=True,
                congestion_control=qos.ESTOP.congestion,
            )  # fmt: skip
            time.sleep(0.05)
            return sent in drive

        wait_until(said_again, "the stop at the drive", 5.0)
    finally:
        done.set()
        for thread in threads:
            thread.join(5.0)
    assert {payload for _, payload in drive} == {b"open", encode(stop)}


def test_by_password_the_same_rules_hold_without_tls(tmp_path: Path) -> None:
    made = SecurityFolder.create(tmp_path / "keys", by="password")
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = RouterSettings(
        config_file=made.file_of("router"), listen=(endpoint,), shared_memory=False
    )

    def config(name: str, **changes: object) -> zenoh.Config:
        settings = ZenohSettings(
            config_file=made.file_of(name), connect=(endpoint,), shared_memory=False
        )
        found = zenoh_config(settings)
        for part, value in changes.items():
            found.insert_json5(f"transport/auth/usrpwd/{part}", json.dumps(value))
        return found

    with open_router(router), ExitStack() as resources:
        assert refused(config("follower", password="guess"))
        assert refused(config("follower", user="nobody"))
        drive, follower, detector = (
            resources.enter_context(zenoh.open(config(name)))
            for name in ("drive", "follower", "detector")
        )
        heard: list[bytes] = []
        commands = drive.declare_subscriber(
            keys.FOLLOW_COMMAND, lambda sample: heard.append(sample.payload.to_bytes())
        )

        def passes() -> bool:
            detector.put(keys.FOLLOW_COMMAND, b"by the detector")
            follower.put(keys.FOLLOW_COMMAND, b"by the follower")
            return heard.count(b"by the follower") >= 3

        wait_until(passes, "commands")
        assert set(heard) == {b"by the follower"}
        commands.undeclare()


def test_every_role_is_attacked(bus: Bus) -> None:
    assert set(bus.made.members.roles.values()) == set(ROLES)
