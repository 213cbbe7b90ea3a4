"""The example of a detector that knows nothing but the schemas, as a process beside the tracker."""

from __future__ import annotations

import ast

import numpy as np

from heel.schemas import Blobs, EndOfStream, Header, Tracks, decode, encode, keys
from heel.schemas.image import encode_image
from tests.support import network
from tests.support.processes import REPOSITORY, running

EXAMPLE = REPOSITORY / "examples" / "own_detector.py"
FRAMES = 12
BOX = (100, 40, 140, 160)


def header(seq: int) -> Header:
    return Header(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=seq * 10**8, width=320,
        height=240, source_width=320, source_height=240, image_encoding="image/raw;bgr8",
        producer="capture/test@00000000", age_ns=10**6,
    )  # fmt: skip


def test_the_example_needs_nothing_of_heel_but_the_schemas() -> None:
    tree = ast.parse(EXAMPLE.read_text())
    modules = {
        name.split(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert modules == {"json", "secrets", "sys", "time", "cv2", "numpy", "zenoh", "heel"}


def test_the_tracker_follows_what_the_example_finds_to_the_end_of_the_stream() -> None:
    image = np.full((240, 320, 3), 114, np.uint8)
    image[BOX[1] : BOX[3], BOX[0] : BOX[2]] = (0, 0, 255)
    pixels = encode_image(image, "image/raw;bgr8")
    with network.router() as endpoint, network.client(endpoint) as session:
        with (
            network.collected(session, keys.blobs("front")) as blobs,
            network.collected(session, keys.tracks("front")) as tracks,
            running(str(EXAMPLE), endpoint, "front") as detector,
            running("-m", "heel", "tracker", "--connect", endpoint, "--exit-at-end"),
        ):
            images = session.declare_publisher(keys.image("front"))
            network.wait_for_listener(images)
            network.wait_until(lambda: _has_tracker(session), "the tracker")
            found = []
            for seq in range(FRAMES):
                stamp = encode(header(seq))
                images.put(pixels, encoding="image/raw;bgr8", attachment=stamp)
                sample = blobs.get(timeout=network.DEADLINE_S)
                found.append(decode(Blobs, sample.payload.to_bytes(), str(sample.encoding)))
                tracked = decode(Tracks, tracks.get(timeout=network.DEADLINE_S).payload.to_bytes())
            end = EndOfStream(stream="front", epoch=1, frames=FRAMES, reason="end")
            images.put(encode(end), encoding=end.encoding())
            assert detector.wait(network.DEADLINE_S) == 0
    assert [message.seq for message in found] == list(range(FRAMES))
    assert found[-1].blobs[0].box_xyxy == BOX
    assert [track.state for track in tracked.tracks] == ["tracked"]


def _has_tracker(session: network.zenoh.Session) -> bool:
    replies = session.liveliness().get(keys.ALL_ALIVE, timeout=1.0)
    return any("tracker" in str(reply.ok.key_expr) for reply in replies if reply.ok is not None)
