"""Stands in for camera, detector and tracker: somebody 4 m ahead, and frames for whoever looks on.

What an emergency stop is worth does not depend on who found the person, and a processor that is
busy with finding people has little to say about it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import zenoh

from benchmarks.stopping.periodic import Periodic
from heel.schemas import Stamp, Track, Tracks, encode, keys
from heel.services.runtime import qos

_TRACKS_HZ = 25.0
_FRAME_EVERY = 2
_FRAME_BYTES = 640 * 480 * 3 // 2
_WIDTH_PX, _HEIGHT_PX = 640, 480
_BOX_XYXY = (285.0, 115.0, 355.0, 351.0)
_SWAY_PX, _SWAY_S = 15.0, 1.5
"""People sway; who does not move in the picture of a moving robot is a frozen picture."""


class StandIn(Periodic):
    """Publishes tracks and frames from a thread. Use as a context manager.

    Args:
        session: opens a session of its own: frames must not hold up anything else.
    """

    def __init__(self, session: Callable[[], zenoh.Session]) -> None:
        super().__init__()
        self._open = session

    def run(self) -> None:
        """As `Periodic.run`."""
        stamp = Stamp(producer="tracker/main@00000001", t_sent_ns=0, age_ns=20_000_000)
        attachment, pixels = encode(stamp), bytes(_FRAME_BYTES)
        with self._open() as session:
            tracks_out = _publisher(session, keys.tracks("front"), qos.TRACKS)
            frames_out = _publisher(session, keys.image("front"), qos.IMAGE)
            for seq in self.turns(_TRACKS_HZ):
                tracks = _tracks(seq)
                tracks_out.put(encode(tracks), encoding=tracks.encoding(), attachment=attachment)
                if seq % _FRAME_EVERY == 0:
                    frames_out.put(pixels)


def _publisher(session: zenoh.Session, key: str, how: qos.TopicQos) -> zenoh.Publisher:
    return session.declare_publisher(
        key, priority=how.priority, congestion_control=how.congestion, express=how.express
    )


def _tracks(seq: int) -> Tracks:
    sway_px = _SWAY_PX * math.sin(2.0 * math.pi * seq / _TRACKS_HZ / _SWAY_S)
    left, top, right, bottom = _BOX_XYXY
    box = left + sway_px, top, right + sway_px, bottom
    person = Track(
        id=1, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=16_520.0,
        span_px=70.0, identity_confidence=0.99, shown=True,
    )  # fmt: skip
    return Tracks(
        stream="front", epoch=7, seq=seq, index=seq, t_capture_ns=time.time_ns(),
        width=_WIDTH_PX, height=_HEIGHT_PX, source_width=_WIDTH_PX, source_height=_HEIGHT_PX,
        tracks=(person,),
    )  # fmt: skip
