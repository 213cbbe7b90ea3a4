"""What recording costs, and whether anything is lost: raw frames at a camera's rate for some time.

Frames go through shared memory as a camera's do, with tracks beside them; the recorder is a process
of its own and tells in its health what it takes. The recording is read again and then removed.

Example run: python -m benchmarks.recording --seconds 600
"""

from __future__ import annotations

import logging
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import zenoh

from benchmarks.common import wait_for
from heel.schemas import FrameId, Header, Health, Stamp, Tracks, decode, encode, keys
from heel.schemas.image import RAW
from heel.services.commands.recording.checking import check
from heel.services.recordings.reading import Recording
from heel.services.runtime import qos
from heel.services.runtime.command_line import run_app
from heel.services.runtime.frame_memory import LIVE_FRAMES, MOST_LIVE_FRAMES, FrameMemory
from heel.services.runtime.router import open_private_router
from heel.services.runtime.session import open_session
from heel.services.runtime.settings import ZenohSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
WIDTH, HEIGHT, RATE_HZ = 768, 576, 25.0
_PRODUCER = "capture/bench@00000001"
_FIRST_S = 2.0
"""Recorded before it is measured: what is taken once, such as memory for the first frames, is not
counted; chosen by hand."""
_UP_S = 90.0
"""Longest wait for the recorder to be up, on a busy machine."""


def _publisher(session: zenoh.Session, key: str, how: qos.TopicQos) -> zenoh.Publisher:
    return session.declare_publisher(
        key, priority=how.priority, congestion_control=how.congestion, express=how.express
    )


class Camera:
    """Frames of noise, each another, and empty tracks of them."""

    def __init__(self, session: zenoh.Session) -> None:
        self._image = _publisher(session, keys.image("front"), qos.IMAGE)
        self._tracks = _publisher(session, keys.tracks("front"), qos.TRACKS)
        self._memory = FrameMemory(LIVE_FRAMES, logging.getLogger("bench"), MOST_LIVE_FRAMES)
        self._noise = np.random.default_rng(1).integers(0, 256, HEIGHT * WIDTH * 3, np.uint8)
        self.sent = 0

    def send(self) -> None:
        """Send one frame and its tracks."""
        frame = FrameId(stream="front", epoch=1, seq=self.sent, index=self.sent,
                        t_capture_ns=time.time_ns())  # fmt: skip
        header = Header(
            **frame.model_dump(), width=WIDTH, height=HEIGHT, source_width=WIDTH,
            source_height=HEIGHT, image_encoding="image/raw;bgr8", producer=_PRODUCER,
        )  # fmt: skip
        pixels = np.roll(self._noise, self.sent).tobytes()
        self._image.put(self._memory.hold(pixels), encoding=RAW, attachment=encode(header))
        tracks = Tracks(**frame.model_dump(), width=WIDTH, height=HEIGHT, source_width=WIDTH,
                        source_height=HEIGHT)  # fmt: skip
        stamp = Stamp(producer="tracker/bench@00000001", t_sent_ns=time.time_ns(), age_ns=0)
        self._tracks.put(encode(tracks), encoding=tracks.encoding(), attachment=encode(stamp))
        self.sent += 1


def send_for(camera: Camera, seconds: float) -> None:
    """Send frames at the camera's rate."""
    started_s = due_s = time.monotonic()
    while due_s < started_s + seconds:
        camera.send()
        due_s += 1 / RATE_HZ
        time.sleep(max(0.0, due_s - time.monotonic()))


def measure(seconds: float, out: Path, foxglove: bool) -> None:
    """Record for so long, with Foxglove's types or without, and print what came of it."""
    heard: list[Health] = []
    with open_private_router() as (_, endpoint):
        settings = ZenohSettings(connect=(endpoint,))
        session = open_session(settings, logging.getLogger("bench"), threading.Event().wait)
        assert session is not None
        with session:
            session.declare_subscriber(
                keys.health("recorder", "main"),
                lambda sample: heard.append(decode(Health, sample.payload.to_bytes())),
            )
            recorder = subprocess.Popen(
                [sys.executable, "-P", "-m", "heel.services.recorder", "--connect", endpoint,
                 "--frames", "raw", "--out", str(out), "--spare-mb", "0", "--file-mb", "1000000",
                 "--file-s", "86400", "--foxglove" if foxglove else "--no-foxglove"]
            )  # fmt: skip
            try:
                wait_for(lambda: any(h.state == "ok" for h in heard), _UP_S, "no recorder")
                camera = Camera(session)
                send_for(camera, _FIRST_S)
                first = heard[-1]
                send_for(camera, seconds)
                time.sleep(1.0)
                last = heard[-1]
            finally:
                recorder.terminate()
                recorder.wait(10)
    spent = (last.cpu_s - first.cpu_s) / (last.uptime_s - first.uptime_s)
    (file,) = out.glob("*.mcap")
    found = check(Recording(file))
    frames, tracks = (found.topics[key("front")] for key in (keys.image, keys.tracks))
    print(f"{camera.sent} frames of {WIDTH}x{HEIGHT} sent in "
          f"{_FIRST_S + seconds:.0f} s: {frames.messages} "
          f"recorded, {frames.missing} missing; tracks {tracks.messages}, {tracks.missing} "
          f"missing; dropped, as the recorder says, {last.dropped}")  # fmt: skip
    print(f"processor {spent:.1%} of a core; memory {first.rss_mb:.0f} MB at first, "
          f"{last.rss_mb:.0f} MB at last, {last.peak_rss_mb:.0f} MB at most; "
          f"file {file.stat().st_size / 1e6:.0f} MB")  # fmt: skip


@app.command()
def main(
    seconds: Annotated[float, typer.Option(min=1.0, help="how long is recorded")] = 600.0,
    foxglove: Annotated[bool, typer.Option(help="with what Foxglove shows beside it")] = True,
) -> None:
    """Record raw frames at a camera's rate, and read the recording again."""
    with tempfile.TemporaryDirectory() as folder:
        measure(seconds, Path(folder), foxglove)


if __name__ == "__main__":
    run_app(app)
