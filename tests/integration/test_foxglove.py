"""`heel foxglove` as a viewer meets it: Foxglove's protocol, on loopback alone."""

from __future__ import annotations

import asyncio
import json
import re
import struct
from typing import Any

import aiohttp
import pytest

from heel.schemas import keys
from tests.support import network
from tests.support.processes import finished, running
from tests.support.recordings import jpeg, tracks

pytestmark = pytest.mark.timeout(60)
pytest.importorskip("foxglove")

_DATA = struct.Struct("<BIQ")
"""Head of a message: its kind (1: data), the subscription, and the time in nanoseconds."""


async def seen(url: str, wanted: set[str]) -> dict[str, tuple[dict[str, Any], bytes]]:
    """The channel and the first message of some topics.

    A channel is asked for again where the server says that it does not know one it has just told
    of: foxglove-sdk 0.30 tells viewers before it keeps the channel, and one subscription of ten
    came between on a busy machine.
    """
    found: dict[str, tuple[dict[str, Any], bytes]] = {}
    channels: dict[int, dict[str, Any]] = {}
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(url, protocols=["foxglove.sdk.v1"]) as viewer,
    ):
        async with asyncio.timeout(20):
            while set(found) < wanted:
                message = await viewer.receive()
                if message.type is aiohttp.WSMsgType.TEXT:
                    told = json.loads(message.data)
                    new = {channel["id"]: channel for channel in told.get("channels", ())}
                    channels |= new
                    again = re.findall(r"^Unknown channel ID: (\d+)$", told.get("message", ""))
                    for number in (*new, *map(int, again)):
                        asked = [{"id": number, "channelId": number}]
                        await viewer.send_json({"op": "subscribe", "subscriptions": asked})
                elif message.type is aiohttp.WSMsgType.BINARY and message.data[0] == 1:
                    _, number, _ = _DATA.unpack(message.data[: _DATA.size])
                    topic = channels[number]["topic"]
                    found.setdefault(topic, (channels[number], message.data[_DATA.size :]))
                else:
                    assert message.type is aiohttp.WSMsgType.BINARY, message
    return found


def test_a_viewer_gets_pictures_marks_and_messages() -> None:
    with network.router() as endpoint, network.client(endpoint) as session:
        with running("-m", "heel", "foxglove", "--connect", endpoint, "--port", "0") as process:
            network.wait_until(lambda: "ws://" in process.stdout(), "the address", 30.0)
            told = re.search(r"ws://127\.0\.0\.1:\d+", process.stdout())
            assert told is not None
            pictures = session.declare_publisher(keys.jpeg("front"))
            network.wait_for_listener(pictures)
            boxes = session.declare_publisher(keys.tracks("front"))

            async def look() -> dict[str, tuple[dict[str, Any], bytes]]:
                wanted = {"/foxglove/cam/front/image", "/foxglove/cam/front/people",
                          keys.tracks("front")}  # fmt: skip
                looking = asyncio.create_task(seen(told[0], wanted))
                seq = 0
                while not looking.done():
                    for publisher, one in ((pictures, jpeg(seq)), (boxes, tracks(seq))):
                        publisher.put(one.payload, encoding=one.encoding, attachment=one.attachment)
                    seq += 1
                    await asyncio.sleep(0.05)
                return await looking

            found = asyncio.run(look())
    channel, picture = found["/foxglove/cam/front/image"]
    assert (channel["schemaName"], channel["encoding"]) == ("foxglove.CompressedImage", "protobuf")
    assert b"\xff\xd8" in picture
    assert found["/foxglove/cam/front/people"][0]["schemaName"] == "foxglove.ImageAnnotations"
    channel, message = found[keys.tracks("front")]
    assert channel["encoding"] == "json"
    assert json.loads(message)["width"] == 32


def test_it_listens_on_loopback_unless_told_by_name() -> None:
    code, _, stderr = finished(
        "-m", "heel", "foxglove", "--host", "0.0.0.0", "--connect", "tcp/x:1"
    )
    assert code != 0
    assert "say --insecure if that is meant" in " ".join(stderr.split())
