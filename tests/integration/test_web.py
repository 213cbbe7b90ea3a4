"""The web process from outside, without a browser: viewers, refusals, bad messages, its end."""

from __future__ import annotations

import asyncio
import signal
import socket
from collections.abc import Iterator
from typing import Any

import aiohttp
import pytest

from heel.schemas import EStop, FollowState, Health, MotionCommand, Target, Tracks, encode, keys
from heel.schemas.image import JPEG, RAW, jpeg_size
from tests.support.network import client, router, wait_until
from tests.support.processes import finished
from tests.support.web_client import DEADLINE_S, get, next_frame, status_of, upgrade, viewing
from tests.support.web_page import HEIGHT_PX, WIDTH_PX, DrawnStream, walker_box, web_process


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with router() as address:
        yield address


@pytest.fixture(scope="module")
def page(endpoint: str) -> Iterator[str]:
    """A web service that several tests look at."""
    with web_process(endpoint) as (url, _):
        yield url


@pytest.mark.parametrize("encoding", [RAW, JPEG])
def test_viewers_get_each_picture_with_its_own_boxes(endpoint: str, encoding: str) -> None:
    async def look(url: str) -> list[tuple[dict[str, Any], bytes]]:
        async with viewing(url) as viewer:
            return [await next_frame(viewer) for _ in range(10)]

    with web_process(endpoint, "--camera", encoding[-4:]) as (url, _):
        with client(endpoint) as session:
            with DrawnStream(session, encoding=encoding, camera=encoding[-4:]):
                frames = asyncio.run(look(url))
    for header, jpeg in frames:
        assert jpeg_size(jpeg) == (WIDTH_PX, HEIGHT_PX)
        assert header["tracks"][0]["box"] == list(walker_box(header["seq"]))
    numbers = [header["seq"] for header, _ in frames]
    assert numbers == sorted(set(numbers))


def test_a_slow_viewer_slows_nobody(endpoint: str) -> None:
    async def watch(url: str) -> tuple[int, float, int]:
        """Frames for the reader, its rate, and frames sent to the one that never answers."""
        async with viewing(url) as slow, viewing(url) as reader:
            with socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2]))) as dead:
                dead.sendall(upgrade(url))
                await next_frame(reader)
                started_s = asyncio.get_running_loop().time()
                frames = [(await next_frame(reader))[0] for _ in range(45)]
                spent_s = asyncio.get_running_loop().time() - started_s
                dropped = frames[-1]["dropped"]
            sent = 0
            while True:
                try:
                    message = await slow.receive(timeout=0.5)
                except TimeoutError:
                    return dropped, len(frames) / spent_s, sent
                sent += message.type is aiohttp.WSMsgType.BINARY
                if message.type is not aiohttp.WSMsgType.BINARY and sent >= 2:
                    return dropped, len(frames) / spent_s, sent

    with web_process(endpoint, "--camera", "slow") as (url, _), client(endpoint) as session:
        with DrawnStream(session, camera="slow", rate_hz=25):
            dropped, rate_hz, sent_to_slow = asyncio.run(watch(url))
    assert rate_hz > 12, "of the 15 that are the cap"
    assert dropped <= 2
    assert sent_to_slow == 2, "not more than may be in flight"


def test_pictures_go_on_without_tracks_after_the_deadline(endpoint: str) -> None:
    async def look(url: str) -> dict[str, Any]:
        async with viewing(url) as viewer:
            return (await next_frame(viewer))[0]

    with web_process(endpoint, "--camera", "lone") as (url, _), client(endpoint) as session:
        with DrawnStream(session, camera="lone", with_tracks=False):
            header = asyncio.run(look(url))
            code, headers, jpeg = get(f"{url}/snapshot.jpg")
    assert header["tracks"] is None
    assert header["age_ms"] >= 350
    assert (code, headers["Content-Type"]) == (200, "image/jpeg")
    assert jpeg_size(jpeg) == (WIDTH_PX, HEIGHT_PX)


def test_nothing_is_coded_while_nobody_looks(endpoint: str) -> None:
    with web_process(endpoint, "--camera", "idle") as (url, _), client(endpoint) as session:
        with DrawnStream(session, camera="idle") as stream:
            wait_until(lambda: stream.sent >= 30, "thirty frames")
            web = status_of(url)["web"]
    assert web["rate_in_hz"] > 5
    assert web["rate_out_hz"] == 0


def test_hostile_messages_disturb_nothing(endpoint: str) -> None:
    bad = (b"", b"\xc1", b"\x00" * 5000, b"\xde\xff\xff", encode(EStop(engaged=True, source="x")))
    topics = {
        keys.image("bad"): RAW,
        keys.tracks("bad"): Tracks.encoding(),
        keys.FOLLOW_STATE: FollowState.encoding(),
        keys.FOLLOW_COMMAND: MotionCommand.encoding(),
        keys.FOLLOW_ESTOP: Health.encoding(),
        "svc/liar/main/health": Health.encoding(),
        keys.FOLLOW_TARGET: Target.encoding(),
    }

    async def look(url: str) -> int:
        async with viewing(url) as viewer:
            return len([await next_frame(viewer) for _ in range(10)])

    with web_process(endpoint, "--camera", "bad") as (url, process), client(endpoint) as session:
        with DrawnStream(session, camera="bad"):
            for payload in bad:
                for key, encoding in topics.items():
                    session.put(key, payload, encoding=encoding, attachment=payload[:100])
                    session.put(key, payload, encoding="text/plain")
            assert asyncio.run(look(url)) == 10
            # The topics keep few messages for a reader that is behind, so not all were seen.
            wait_until(lambda: status_of(url)["web"]["malformed"] >= 10, "refusals", 5)
        assert not status_of(url)["stop"]["engaged"]
        assert "Traceback" not in process.stderr()
        assert process.alive


def test_a_latched_follower_state_is_known_from_the_start(endpoint: str) -> None:
    state = FollowState(
        seq=4, state="stopped", reason="latched before", estop=True,
        target=Target(seq=0, mode="none"), linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip
    with client(endpoint) as session:
        queryable = session.declare_queryable(
            keys.FOLLOW_STATE,
            lambda query: query.reply(keys.FOLLOW_STATE, encode(state), encoding=state.encoding()),
        )
        with web_process(endpoint) as (url, _):
            wait_until(lambda: status_of(url)["follower"] is not None, "the state")
            status = status_of(url)
            assert status["follower"]["reason"] == "latched before"
            assert status["stop"]["engaged"]

            # A follower that restarts must learn of the stop from somebody.
            def told() -> bool:
                session.put(keys.FOLLOW_STATE, encode(state), encoding=state.encoding())
                return any(reply.ok for reply in session.get(keys.FOLLOW_ESTOP, timeout=2.0))

            wait_until(told, "an answer of the page")
        queryable.undeclare()


def test_viewers_that_do_not_keep_to_the_protocol_are_let_go(page: str) -> None:
    async def misbehave(words: str) -> int | None:
        async with viewing(page) as viewer:
            await viewer.send_str(words)
            async with asyncio.timeout(DEADLINE_S):
                while not viewer.closed:
                    await viewer.receive()
            return viewer.close_code

    for words in ("hello", '{"ack": 99}', '{"ack": -1}'):
        assert asyncio.run(misbehave(words)) == aiohttp.WSCloseCode.POLICY_VIOLATION
    assert asyncio.run(misbehave("x" * 5000)) == aiohttp.WSCloseCode.MESSAGE_TOO_BIG


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_ends_in_two_seconds_with_viewers_connected(endpoint: str, number: signal.Signals) -> None:
    async def end_it() -> tuple[int, float]:
        with web_process(endpoint, "--camera", "exit") as (url, process):
            with client(endpoint) as session, DrawnStream(session, camera="exit"):
                async with viewing(url) as reader, viewing(url):
                    with socket.create_connection(("127.0.0.1", int(url[-5:].strip(":")))) as dead:
                        dead.sendall(upgrade(url))
                        await next_frame(reader)
                        result = await asyncio.to_thread(process.stop, number, 5.0)
                        assert "Traceback" not in process.stderr()
                        return result

    code, spent_s = asyncio.run(end_it())
    assert code == 0
    assert spent_s < 2.0


def test_a_port_in_use_is_one_line_with_the_remedy(endpoint: str, page: str) -> None:
    port = page.rpartition(":")[2]
    code, _, err = finished("-m", "heel.services.web", "--connect", endpoint, "--port", port)
    assert code == 1
    assert f"127.0.0.1:{port} is in use" in err
    assert "--port" in err
    assert "Traceback" not in err


def test_an_open_address_needs_insecure_by_name(endpoint: str) -> None:
    flags = ("-m", "heel.services.web", "--connect", endpoint, "--port", "0", "--host", "0.0.0.0")
    code, _, err = finished(*flags)
    assert code == 2
    assert "--insecure" in err
    assert len(err.strip().splitlines()) == 1


def test_ends_with_the_stream_when_asked_to(endpoint: str) -> None:
    with web_process(endpoint, "--camera", "last", "--exit-at-end") as (_, process):
        with client(endpoint) as session, DrawnStream(session, camera="last") as stream:
            wait_until(lambda: stream.sent > 5, "some frames")
            stream.end("end of file")
            assert process.wait(5.0) == 0
