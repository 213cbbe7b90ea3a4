"""Real processes and everything that can be wrong around them: bad messages, signals, no router."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgpack
import pytest

from heel.schemas import (
    Blobs,
    EStop,
    MotionCommand,
    Target,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from tests.support import network
from tests.support.processes import Running, finished, running
from tests.support.service_faults import FAULTS, SERVICES, Put, Stack, broken


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture(scope="module")
def stack(endpoint: str) -> Iterator[Stack]:
    with ExitStack() as resources:
        session = resources.enter_context(network.client(endpoint))
        yield Stack(endpoint, session, resources)


@pytest.mark.parametrize("fault", FAULTS)
def test_bad_messages_are_counted_in_health_and_end_nothing(stack: Stack, fault: str) -> None:
    """On every topic at once; the counts are exact."""
    expected = stack.refused()
    messages = stack.next_messages()
    del messages["detector tracks"], messages["detector pointed"]
    for name, good in messages.items():
        service, topic = name.split()
        stack.send(broken(good, topic, fault))
        expected[service] += 1
    network.wait_until(lambda: stack.refused() == expected, f"{expected} refused")
    assert all(process.alive for process in stack.processes.values())
    assert not any("Traceback" in process.stderr() for process in stack.processes.values())


@pytest.mark.parametrize("topic", ["tracks", "pointed"])
@pytest.mark.parametrize("fault", FAULTS)
def test_the_detector_counts_bad_messages_and_goes_on_with_images(
    stack: Stack, fault: str, topic: str
) -> None:
    """It looks at them when an image comes: the next image answers for both."""
    before = stack.refused()["detector"]
    with network.collected(stack.session, keys.blobs("detector")) as blobs:
        stack.send(broken(stack.next_messages()[f"detector {topic}"], topic, fault))
        for _ in range(2):
            stack.send(stack.next_messages()["detector image"])
            sample = blobs.get(timeout=network.DEADLINE_S)
            assert decode(Blobs, sample.payload.to_bytes()).seq == stack.seq
    received = stack.health["detector"].received
    network.wait_until(lambda: stack.health["detector"].received > received, "the next health")
    assert stack.refused()["detector"] == before + 1


def test_good_messages_still_pass_through_every_service(stack: Stack) -> None:
    with (
        network.collected(stack.session, keys.blobs("detector")) as blobs,
        network.collected(stack.session, keys.tracks("tracker")) as tracks,
        network.collected(stack.session, keys.FOLLOW_COMMAND) as commands,
    ):
        messages = stack.next_messages()
        # A follower that has had ranges stops for the lack of them: the tests below would not tell.
        del messages["follower ranges"]
        for put in messages.values():
            stack.send(put)
        sample = blobs.get(timeout=network.DEADLINE_S)
        assert decode(Blobs, sample.payload.to_bytes(), str(sample.encoding)).seq == stack.seq
        sample = tracks.get(timeout=network.DEADLINE_S)
        assert decode(Tracks, sample.payload.to_bytes(), str(sample.encoding)).seq == stack.seq

        def idle() -> bool:
            sample = commands.get(timeout=network.DEADLINE_S)
            command = decode(MotionCommand, sample.payload.to_bytes(), str(sample.encoding))
            assert (command.linear_mps, command.angular_radps) == (0.0, 0.0)
            return command.state == "idle"

        # The sensors that could not be read before count for a second more.
        network.wait_until(idle, "a follower at rest")


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (b"\xc1", "target-request: not msgpack"),
        (bytes(2000), "exceed the cap"),
        (msgpack.packb({"v": 2, "mode": "none"}), "version 2"),
        (msgpack.packb({"v": 1, "mode": "id"}), "needs track_id"),
        (encode(TargetRequest(mode="id", track_id=9)), "nobody has id 9"),
    ],
)
def test_bad_target_requests_are_answered_with_the_reason(
    payload: bytes, words: str, stack: Stack
) -> None:
    (reply,) = list(stack.session.get(keys.FOLLOW_TARGET, payload=payload, timeout=5.0))
    assert reply.err is not None
    assert words in reply.err.payload.to_string()
    (reply,) = list(stack.session.get(keys.FOLLOW_TARGET, timeout=5.0))
    assert reply.ok is not None
    assert decode(Target, reply.ok.payload.to_bytes(), str(reply.ok.encoding)).mode == "none"


def test_an_emergency_stop_is_heard_after_all_that(stack: Stack) -> None:
    stack.send(Put(keys.FOLLOW_ESTOP, encode(EStop(engaged=True, source="test")),
                   EStop.encoding()))  # fmt: skip
    with network.collected(stack.session, keys.FOLLOW_COMMAND) as commands:

        def stopped() -> bool:
            sample = commands.get(timeout=network.DEADLINE_S)
            return decode(MotionCommand, sample.payload.to_bytes()).state == "stopped"

        network.wait_until(stopped, "the stop")


def test_services_say_what_they_refused_once_a_second_and_name_it(stack: Stack) -> None:
    lines = [json.loads(line) for line in stack.processes["tracker"].stderr().splitlines()]
    warnings = [line["message"] for line in lines if line["level"] == "warning"]
    assert any(text.startswith("cam/tracker/blobs: blobs: ") for text in warnings)
    assert all(len(text) < 500 for text in warnings)


def is_up(process: Running) -> bool:
    return "is up" in process.stderr()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
def test_services_end_cleanly_within_two_seconds_of_a_signal(
    number: signal.Signals, endpoint: str
) -> None:
    with ExitStack() as resources:
        started = {
            name: resources.enter_context(
                running("-m", f"heel.services.{name}", "--instance", "signals",
                        "--camera", "signals", "--connect", endpoint)
            )
            for name in (*SERVICES, "capture", "drive")
        }  # fmt: skip
        for name, process in started.items():
            network.wait_until(lambda p=process: is_up(p), f"{name} up", 30.0)
        for name, process in started.items():
            code, took_s = process.stop(number, 10.0)
            assert (name, code) == (name, 0), process.stderr()
            assert took_s < 2.0, name
            assert "Traceback" not in process.stderr()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.mark.parametrize("service", [*SERVICES, "drive"])
def test_without_a_router_one_line_says_so(service: str) -> None:
    address = f"tcp/127.0.0.1:{free_port()}"
    code, out, err = finished(
        "-m", f"heel.services.{service}", "--connect", address, "--connect-timeout-s", "0.3",
        "--log-level", "error",
    )  # fmt: skip
    assert (code, out) == (1, "")
    (line,) = err.splitlines()
    assert f"no Zenoh router at {address} within 0.3 s" in json.loads(line)["message"]


def test_a_signal_while_waiting_for_the_router_ends_the_service() -> None:
    with running(
        "-m", "heel.services.tracker", "--connect", f"tcp/127.0.0.1:{free_port()}"
    ) as process:
        network.wait_until(lambda: "waiting for a router" in process.stderr(), "the wait", 30.0)
        code, took_s = process.stop(signal.SIGTERM, 10.0)
        assert (code, took_s < 2.0) == (0, True), process.stderr()


def test_services_outlive_their_router_and_still_end_in_time() -> None:
    address = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as resources:
        router = resources.enter_context(
            running("-m", "heel.services.cli", "router", "--listen", address)
        )
        network.wait_until(lambda: "router listens" in router.stderr(), "the router", 30.0)
        service = resources.enter_context(
            running("-m", "heel.services.tracker", "--connect", address)
        )
        network.wait_until(lambda: is_up(service), "the tracker", 30.0)
        router.stop(signal.SIGKILL, 10.0)
        assert service.alive
        code, took_s = service.stop(signal.SIGTERM, 10.0)
        assert (code, took_s < 2.0) == (0, True), service.stderr()


@pytest.mark.parametrize("service", [*SERVICES, "drive"])
def test_an_unknown_key_in_the_file_is_one_line(service: str, tmp_path: Path) -> None:
    file = tmp_path / "heel.toml"
    file.write_text(f"[{service}]\ncamra = 'front'\n")
    code, out, err = finished("-m", f"heel.services.{service}", "--config", str(file))
    assert (code, out) == (2, "")
    (line,) = err.splitlines()
    told = f"{service}.camra: unknown key; did you mean 'camera'?"
    assert line == f"heel: settings file {file}: {told}"


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("HEEL_TRACKER__CAMRA", "front", "tracker.camra: unknown key; did you mean 'camera'?"),
        ("HEEL_TRAKCER__CAMERA", "front", "did you mean 'tracker'?"),
        ("HEEL_TRACKER__CAMERA", "a/b", "tracker.camera = 'a/b'"),
        ("HEEL_CONFIG", "/nowhere/heel.toml", "settings file /nowhere/heel.toml"),
        ("HEEL_ZENOH__CONNECT", "smoke/1", "zenoh: "),
    ],
)
def test_wrong_settings_in_the_environment_are_one_line(
    variable: str, value: str, words: str
) -> None:
    code, out, err = finished("-m", "heel.services.tracker", **{variable: value})
    assert (code, out) == (2, "")
    (line,) = err.splitlines()
    assert words in line
