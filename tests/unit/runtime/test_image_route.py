"""Frames are heard raw on their own host and as JPEG elsewhere, wherever the camera is now."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, cast

import numpy as np
import pytest
import zenoh

from heel.schemas import CameraInfo, EndOfStream, Header, decode, keys
from heel.schemas.image import JPEG, RAW, decode_depth, decode_image
from heel.services.runtime import images, qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.image_route import image_key, router_host
from heel.services.runtime.images import (
    DepthPublisher,
    ImagePublisher,
    StreamIdentity,
    image_header,
)
from heel.services.runtime.inbox import Inbox
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.settings import ServiceSettings
from tests.support.arrivals import PRODUCER
from tests.support.network import DEADLINE_S, wait_until

HERE, THERE = "0000-1", "1111-1"
IMAGE = np.random.default_rng(3).integers(0, 255, (32, 48, 3)).astype(np.uint8)


@pytest.mark.parametrize(
    ("camera_host", "router", "heard"),
    [
        (HERE, HERE, "image"),
        (HERE, None, "image"),
        (None, HERE, "image"),
        (None, None, "image"),
        (THERE, HERE, "jpeg"),
        (THERE, None, "jpeg"),
        # Through a router elsewhere even a frame of this host's would cross twice.
        (HERE, THERE, "jpeg"),
        (None, THERE, "jpeg"),
        # A camera that sends no JPEG.
        ("", HERE, "image"),
        ("", THERE, "image"),
    ],
)
def test_frames_are_heard_raw_only_where_camera_router_and_receiver_share_a_host(
    camera_host: str | None, router: str | None, heard: str
) -> None:
    assert image_key("front", camera_host, router, HERE) == f"cam/front/{heard}"


def test_a_router_tells_its_host(receiver: zenoh.Session) -> None:
    assert router_host(receiver) == monotonic_clock()


def service(
    session: zenoh.Session, inbox: Inbox, camera: str, shared_memory: bool = False
) -> ServiceContext[ServiceSettings]:
    return ServiceContext(
        name="detector", settings=ServiceSettings(camera=camera), session=session, inbox=inbox,
        statistics=ServiceStatistics(), log=logging.getLogger("heel.test"), producer=PRODUCER,
        shared_memory=shared_memory, stop=threading.Event(), announce=lambda: None, robot="robot",
        notifier=cast(Any, None),
    )  # fmt: skip


@pytest.fixture
def inbox(receiver: zenoh.Session) -> Iterator[Inbox]:
    with Inbox(receiver) as box:
        yield box


def header(camera: str, seq: int) -> Header:
    return image_header(StreamIdentity(camera, 1, PRODUCER), IMAGE, (seq, seq), (48, 32), 0, 0)


def info(camera: str, host: str) -> CameraInfo:
    return CameraInfo(
        stream=camera, epoch=1, width=48, height=32, source_width=48, source_height=32, fps=25.0,
        source="test", host=host,
    )  # fmt: skip


def test_a_receiver_changes_over_with_the_camera_and_no_frame_comes_twice(
    sender: zenoh.Session, receiver: zenoh.Session, inbox: Inbox
) -> None:
    camera = "moving"
    with ExitStack() as stack:
        described = stack.enter_context(Latched(sender, keys.info(camera), qos.INFO))
        described.set(info(camera, THERE))
        context = service(receiver, inbox, camera)
        judge = context.subscribe_images(qos.IMAGE)
        out = ImagePublisher(service(sender, inbox, camera), 90, None)
        for seq, (host, encoding) in enumerate([(THERE, JPEG), (monotonic_clock(), RAW)]):
            described.set(info(camera, host))
            wait_until(lambda e=encoding: listened(out) == {e}, f"a listener to {encoding}")
            out.send(header(camera, seq), IMAGE)
            arrival = inbox.get(DEADLINE_S, "image")
            assert arrival is not None
            told = judge.header(arrival)
            assert told is not None
            assert (told.seq, told.image_encoding) == (seq, encoding)
            pixels = decode_image(arrival.payload, told, arrival.encoding)
            assert pixels.shape == IMAGE.shape
            assert inbox.get(0.0, "image") is None
            # What has arrived as JPEG is confirmed, so that the next one may come.
            wait_until(lambda: "detector-main" in out._window._receivers, "a confirmation")
        assert context.statistics.details["images"] == "raw"


def listened(out: ImagePublisher) -> set[str]:
    """Encodings that somebody listens to."""
    return {encoding for encoding, one in ((RAW, out.raw), (JPEG, out._jpeg)) if one.has_listeners}


def test_nothing_is_coded_for_nobody(sender: zenoh.Session, inbox: Inbox) -> None:
    out = ImagePublisher(service(sender, inbox, "alone"), 90, None)
    broken = np.zeros((32, 48, 7), np.uint8)  # no JPEG of it can be made
    out.send(header("alone", 0), broken)


def test_the_end_comes_on_both_keys(
    sender: zenoh.Session, receiver: zenoh.Session, inbox: Inbox
) -> None:
    out = ImagePublisher(service(sender, inbox, "ending"), 90, None)
    for name in ("image", "jpeg"):
        inbox.subscribe(name, f"cam/ending/{name}", qos.IMAGE)
    wait_until(lambda: listened(out) == {RAW, JPEG}, "listeners")
    out.end(EndOfStream(stream="ending", epoch=1, frames=3, reason="over"))
    for name in ("image", "jpeg"):
        arrival = inbox.get(DEADLINE_S, name)
        assert arrival is not None
        assert decode(EndOfStream, arrival.payload, arrival.encoding).frames == 3


@pytest.mark.parametrize("shared_memory", [False, True])
def test_depth_takes_shared_memory_only_where_that_is_switched_on(
    shared_memory: bool, sender: zenoh.Session, inbox: Inbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[int] = []

    class Memory:
        def __init__(self, *_: object) -> None:
            pass

        def hold(self, frame: bytes) -> bytes:
            held.append(len(frame))
            return frame

    monkeypatch.setattr(images, "FrameMemory", Memory)
    camera = f"depth-{shared_memory}".lower()
    out = DepthPublisher(service(sender, inbox, camera, shared_memory))
    inbox.subscribe("depth", keys.depth(camera), qos.DEPTH)
    wait_until(lambda: out._publisher.has_listeners, "a listener")
    depth_mm = np.arange(48 * 32, dtype=np.uint16).reshape(32, 48)
    out.send(StreamIdentity(camera, 1, PRODUCER), header(camera, 0).frame_id(), depth_mm, 0)
    arrival = inbox.get(DEADLINE_S, "depth")
    assert arrival is not None
    assert arrival.attachment is not None
    told = decode(Header, arrival.attachment)
    assert np.array_equal(decode_depth(arrival.payload, told, arrival.encoding), depth_mm)
    assert bool(held) is shared_memory
