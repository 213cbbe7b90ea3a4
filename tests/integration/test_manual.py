"""Driving by hand through the real processes: how soon the wheels stand when the hand is gone."""

from __future__ import annotations

import asyncio
import queue
import signal
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass

import aiohttp
import pytest
import zenoh

from heel.schemas import DriveState, FollowState, Manual, Stamp, decode, encode, keys
from heel.services.web.hand import WISH_TTL_S
from tests.support import network
from tests.support.processes import Running, running
from tests.support.web_client import post
from tests.support.web_page import web_process

pytestmark = pytest.mark.timeout(120)

PERIOD_S = 0.05
BOUND_S = WISH_TTL_S + 0.1
"""From the last sign of the hand to zero at the wheels: the wish's time, a turn of the follower and
of the drive, and the links."""
DRIVES_TTL_S = 0.5


@dataclass
class Stack:
    """The processes, and what is heard of them."""

    session: zenoh.Session
    url: str
    follower: Running
    web: Running
    moved_s: float = 0.0
    newest: DriveState | None = None
    state: FollowState | None = None

    def hear(self, sample: zenoh.Sample) -> None:
        self.newest = decode(DriveState, sample.payload.to_bytes())
        if self.newest.linear_mps or self.newest.angular_radps:
            self.moved_s = time.monotonic()

    def hear_state(self, sample: zenoh.Sample) -> None:
        self.state = decode(FollowState, sample.payload.to_bytes())

    @property
    def drives(self) -> bool:
        return self.newest is not None and self.newest.linear_mps > 0.2

    @property
    def stands(self) -> bool:
        return self.newest is not None and self.newest.linear_mps == 0.0


@contextmanager
def stack() -> Iterator[Stack]:
    with ExitStack() as resources:
        endpoint = resources.enter_context(network.router())
        session = resources.enter_context(network.client(endpoint))
        service = ("--connect", endpoint)
        follower = resources.enter_context(running("-m", "heel.services.follower", *service))
        resources.enter_context(running("-m", "heel.services.drive", *service, "--driver", "log"))
        url, web = resources.enter_context(web_process(endpoint))
        made = Stack(session, url, follower, web)
        for key, hear in ((keys.ROBOT_DRIVE, made.hear), (keys.FOLLOW_STATE, made.hear_state)):
            resources.callback(session.declare_subscriber(key, hear).undeclare)
        network.wait_until(lambda: made.newest is not None and made.state is not None, "all", 30.0)
        yield made


@asynccontextmanager
async def hand(url: str) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    """A browser that drives by hand, until it is told to be silent."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}/hand") as socket:
        yield socket


async def held(
    socket: aiohttp.ClientWebSocketResponse, until: Callable[[], bool], beat: int | None = None
) -> float:
    """Hold the switch until something is so; when the last wish was sent, monotonic."""
    end_s = time.monotonic() + 10.0
    told = beat if beat is not None else (await socket.receive_json(timeout=5))["beat"]
    while not until():
        assert time.monotonic() < end_s, "the robot does not do as the hand wishes"
        await socket.send_json({"beat": told, "held": True, "forward": 1, "left": 0})
        answer = await socket.receive_json(timeout=5)
        told = told if beat is not None else answer["beat"]
        await asyncio.sleep(PERIOD_S)
    return time.monotonic() - PERIOD_S


def stood_after(robot: Stack, gone_s: float, within_s: float) -> float:
    """Wait until the wheels stand for good; seconds from then to the last motion."""
    never = time.monotonic() + within_s + 0.4
    network.wait_until(lambda: time.monotonic() > never, "a while")
    assert robot.stands
    return robot.moved_s - gone_s


def test_the_wheels_stand_within_the_bound_however_the_hand_is_gone() -> None:
    with stack() as robot:
        wishes: queue.Queue[zenoh.Sample]
        with network.collected(robot.session, keys.FOLLOW_MANUAL) as wishes:

            async def silent() -> float:
                async with hand(robot.url) as socket:
                    gone_s = await held(socket, lambda: robot.drives)
                    # The socket stays open: nothing says that the browser has frozen.
                    await asyncio.sleep(BOUND_S + 0.3)
                    return gone_s

            gone_s = asyncio.run(silent())
            assert 0.0 < stood_after(robot, gone_s, 0.0) < BOUND_S

            async def leaves() -> float:
                async with hand(robot.url) as socket:
                    await held(socket, lambda: robot.drives)
                return time.monotonic()

            assert stood_after(robot, asyncio.run(leaves()), BOUND_S) < 0.15
            assert robot.state is not None
            assert robot.state.driven_by, "it is the hand's until it is handed back"
            replayed = [
                one for one in list(wishes.queue) if decode(Manual, one.payload.to_bytes()).held
            ]
            moved_s = robot.moved_s
            for sample in replayed:
                assert sample.attachment is not None
                robot.session.put(keys.FOLLOW_MANUAL, sample.payload, encoding=sample.encoding,
                                  attachment=sample.attachment)  # fmt: skip
            forged = Manual(grant="0" * 16, seq=10**6, held=True, forward=1.0, left=0.0, ttl_s=0.5)
            stamp = encode(Stamp(producer="web/x@00000001", t_sent_ns=1, age_ns=0))
            robot.session.put(keys.FOLLOW_MANUAL, encode(forged), encoding=forged.encoding(),
                              attachment=stamp)  # fmt: skip
            stood_after(robot, 0.0, 0.1)
            assert robot.moved_s == moved_s, "neither a replay nor a forged wish moves it"
            assert len(replayed) > 3

        async def repeats_an_old_number() -> None:
            async with hand(robot.url) as socket:
                first = (await socket.receive_json(timeout=5))["beat"]
                await asyncio.sleep(WISH_TTL_S + 0.1)
                until_s = time.monotonic() + 0.4
                await held(socket, lambda: time.monotonic() > until_s, first)

        asyncio.run(repeats_an_old_number())
        assert robot.moved_s == moved_s, "what a stalled link delivers late moves nothing"
        assert post(f"{robot.url}/api/hand-back", b"{}")[0] == 200
        network.wait_until(lambda: robot.state is not None and not robot.state.driven_by, "back")


@pytest.mark.slow
@pytest.mark.parametrize("killed", ["web", "follower"])
def test_the_wheels_stand_when_a_service_between_dies_or_hangs(killed: str) -> None:
    bound_s = BOUND_S if killed == "web" else DRIVES_TTL_S + 0.1
    for number in (signal.SIGSTOP, signal.SIGKILL):
        with stack() as robot:
            process = robot.web if killed == "web" else robot.follower

            async def killing(process: Running, number: signal.Signals, robot: Stack) -> float:
                async with hand(robot.url) as socket:
                    await held(socket, lambda: robot.drives)
                    process.process.send_signal(number)
                    gone_s = time.monotonic()
                    await asyncio.sleep(bound_s + 0.5)
                    assert robot.moved_s - gone_s < bound_s
                    assert robot.stands
                    process.process.kill()
                    return gone_s

            asyncio.run(killing(process, number, robot))
