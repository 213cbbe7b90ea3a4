"""A stack of real services, and everything that can be wrong with a message to them."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
import zenoh

from heel.schemas import (
    Blobs,
    CameraInfo,
    EndOfStream,
    EStop,
    FrameId,
    Header,
    Health,
    Manual,
    Message,
    MotionCommand,
    Odometry,
    Pointed,
    Ranges,
    RangeSector,
    Stamp,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.schemas.image import MAX_IMAGE_BYTES, RAW
from tests.support import network
from tests.support.processes import running

SERVICES = ("detector", "tracker", "follower")
_WIDTH, _HEIGHT = 64, 48
_SIZE = {"width": _WIDTH, "height": _HEIGHT, "source_width": _WIDTH, "source_height": _HEIGHT}
_PRODUCER = "test/main@00000001"
_STAMP = encode(Stamp(producer=_PRODUCER, t_sent_ns=0, age_ns=0))


def frame(camera: str, seq: int) -> dict[str, Any]:
    return {
        "stream": camera, "epoch": 1, "seq": seq, "index": seq, "t_capture_ns": seq * 40_000_000,
    }  # fmt: skip


@dataclass(frozen=True)
class Put:
    """What goes over the wire."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None = None


def good_image(seq: int) -> Put:
    header = Header(
        **frame("detector", seq), **_SIZE, image_encoding=RAW, producer=_PRODUCER
    )  # fmt: skip
    pixels = np.full((_HEIGHT, _WIDTH, 3), 90, np.uint8).tobytes()
    return Put(keys.image("detector"), pixels, RAW, encode(header))


def good_message(message: Message, key: str, stamped: bool = True) -> Put:
    return Put(key, encode(message), message.encoding(), _STAMP if stamped else None)


def good_messages(seq: int) -> dict[str, Put]:
    """One valid message for every topic that the three services subscribe to."""
    seen = {camera: Tracks(**frame(camera, seq), **_SIZE) for camera in ("detector", "follower")}
    blobs = Blobs(**frame("tracker", seq), **_SIZE, detector="test")
    info = CameraInfo(stream="follower", epoch=1, **_SIZE, fps=25.0, source="test")
    pointed = Pointed(
        frame=FrameId(**frame("detector", seq)), width=_WIDTH, height=_HEIGHT, x_px=9.0, y_px=9.0
    )
    released = EStop(engaged=False, source="test")
    standing = Odometry(
        seq=seq, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.0, angular_radps=0.0
    )
    wish = Manual(grant="0" * 16, seq=seq, held=True, forward=1.0, left=0.0, ttl_s=0.3)
    ahead = RangeSector(bearing_rad=0.0, width_rad=0.2, distance_m=5.0)
    return {
        "detector tracks": good_message(seen["detector"], keys.tracks("detector")),
        "detector pointed": good_message(pointed, keys.FOLLOW_POINTED, stamped=False),
        "detector image": good_image(seq),
        "tracker blobs": good_message(blobs, keys.blobs("tracker")),
        "follower tracks": good_message(seen["follower"], keys.tracks("follower")),
        "follower estop": good_message(released, keys.FOLLOW_ESTOP, stamped=False),
        "follower info": good_message(info, keys.info("follower"), stamped=False),
        "follower odometry": good_message(standing, keys.ROBOT_ODOMETRY),
        "follower manual": good_message(wish, keys.FOLLOW_MANUAL),
        "follower ranges": good_message(Ranges(seq=seq, sectors=(ahead,)), keys.ROBOT_RANGE),
    }


_CAPS = {
    "image": MAX_IMAGE_BYTES, "tracks": Tracks.max_bytes, "blobs": Blobs.max_bytes,
    "estop": EStop.max_bytes, "info": CameraInfo.max_bytes, "command": MotionCommand.max_bytes,
    "odometry": Odometry.max_bytes, "ranges": Ranges.max_bytes,
    "pointed": Pointed.max_bytes, "manual": Manual.max_bytes,
}  # fmt: skip


def newer(packed: bytes) -> bytes:
    fields = msgpack.unpackb(packed)
    packed_again: bytes = msgpack.packb(fields | {"v": 2})
    return packed_again


def broken(good: Put, topic: str, fault: str) -> Put:
    """A good message with one thing wrong with it."""
    is_image = topic == "image"
    payload, encoding, attachment = good.payload, good.encoding, good.attachment
    if fault == "malformed":
        payload = b"\xc1 not msgpack" if not is_image else payload[:-1]
    elif fault == "empty":
        payload = b""
    elif fault == "oversized":
        payload = bytes(_CAPS[topic] + 1)
    elif fault == "wrong version":
        if is_image and attachment is not None:
            attachment = newer(attachment)
        else:
            payload = newer(payload)
    elif fault == "wrong encoding":
        encoding = "image/png" if is_image else "application/json"
    elif fault == "wrong encoding version":
        encoding = encoding.replace(".v1", ".v2") if not is_image else "image/jpeg"
    elif fault == "malformed end of stream":
        payload, encoding = b"\xc1", EndOfStream.encoding()
    elif fault == "attachment missing or unasked for":
        payload, attachment = (payload, None) if attachment else (b"", b"\xff" * 5000)
    return Put(good.key, payload, encoding, attachment)


FAULTS = (
    "malformed", "empty", "oversized", "wrong version", "wrong encoding", "wrong encoding version",
    "malformed end of stream", "attachment missing or unasked for",
)  # fmt: skip


class Stack:
    """The three services on one router, and a client that plays everybody else."""

    def __init__(self, endpoint: str, session: zenoh.Session, resources: ExitStack) -> None:
        self.session = session
        self.health: dict[str, Health] = {}
        self.seq = 0
        subscriber = session.declare_subscriber(keys.ALL_HEALTH, self._note_health)
        resources.callback(subscriber.undeclare)
        self.processes = {
            name: resources.enter_context(
                running("-m", f"heel.services.{name}", "--camera", name, "--connect", endpoint)
            )
            for name in SERVICES
        }
        for name, process in self.processes.items():
            # Health comes first, and a service that is up hears everything.
            network.wait_until(lambda p=process: "is up" in p.stderr(), f"{name} is up", 30.0)
            network.wait_until(lambda n=name: n in self.health, f"health of {name}", 30.0)

    def _note_health(self, sample: zenoh.Sample) -> None:
        health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))
        self.health[health.service] = health

    def send(self, put: Put) -> None:
        self.session.put(
            put.key, put.payload, encoding=put.encoding, attachment=put.attachment,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip

    def refused(self) -> dict[str, int]:
        return {name: self.health[name].malformed for name in SERVICES}

    def next_messages(self) -> dict[str, Put]:
        self.seq += 1
        return good_messages(self.seq)
