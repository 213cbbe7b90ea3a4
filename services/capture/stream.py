"""Live streams over the network: one thread takes what arrives, another decodes the newest."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import av.error

from heel.schemas.errors import SourceError
from heel.services.capture.arrivals import CountedArrivals, StampedArrivals
from heel.services.capture.decoding import Converter, Decoded, Decoder
from heel.services.capture.device import Picture, RecordingEnded
from heel.services.capture.ffmpeg import reason, video_stream

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.packet import Packet
    from av.video.stream import VideoStream

KEY_FRAME_WAIT_S = 30.0
"""Key frames come every 10 s from some cameras; less often is told as a fault."""
_BLIND_S = 10.0
"""Data from which no picture can be made is endured for so long in mid-stream."""
_NO_KEY_FRAME = "data arrives, no key frame yet: shorten the camera's key frame interval"
_DAMAGED = "its pictures arrive cut off or damaged: check the link and the camera"
_HOPELESS_S = 5.0
"""Farther behind than this a new connection is the shorter way to the newest picture."""
_BEHIND_S = 0.25
"""A decoder so far behind leaves out frames that no other needs."""
_MOST_PACKETS = 500
"""Packets that wait to be decoded: `_HOPELESS_S` of a fast camera; chosen by hand."""
_MOST_BYTES = 64 << 20
"""Of those packets together; chosen by hand."""
_NO_TIME_STAMPS = 0x80
"""AVFMT_NOTIMESTAMPS: FFmpeg counts frames instead."""
_GENERATE_STAMPS = 0x1
"""AVFMT_FLAG_GENPTS, which PyAV sets and which holds packets back."""
_END_OF_IMAGE = b"\xff\xd9"
_START_OF_SCAN = b"\xff\xda"


@dataclass(slots=True)
class _Arrived:
    """A packet, when it arrived, and how late it was where that is known before decoding."""

    packet: Packet[VideoStream]
    at_s: float
    late_s: float | None


class StreamDevice:
    """An open RTSP, HTTP or other network stream.

    The receiving thread never decodes, so that nothing waits in the socket while a picture is
    decoded; it ends within the container's read time-out after `close`, and closes the container.

    Args:
        container: belongs to this device from now on.
        name: for people.

    Raises:
        SourceError: there is no video in it that FFmpeg can decode.
    """

    def __init__(self, container: InputContainer, name: str) -> None:
        try:
            stream = video_stream(container, name)
        except SourceError:
            container.close()
            raise
        container.flags &= ~_GENERATE_STAMPS
        self._stream = stream
        self.fps = float(stream.guessed_rate or 0.0)
        self.complaint = ""
        self._single = stream.codec_context.codec.intra_only
        self._is_jpeg = stream.codec_context.name == "mjpeg"
        self._format = container.format.name
        self._stamped = not container.format.flags & _NO_TIME_STAMPS
        self._length_s = (container.duration or 0) / av.time_base
        self._stamps, self._counts = StampedArrivals(), CountedArrivals()
        self._decoder, self._converter = Decoder(stream, threads="SLICE"), Converter()
        self._opened_s = self._pictured_s = time.monotonic()
        self._packets = self._pictures = self._skipped = 0
        self._arrival_of: dict[int, float] = {}
        self._changed = threading.Condition()
        # Everything below is guarded by the condition.
        self._waiting: deque[_Arrived] = deque()
        self._waiting_bytes = self._replaced = 0
        self._overrun = False
        self._end: SourceError | None = None
        self._closing = False
        thread = threading.Thread(
            target=self._receive, args=(container,), name="camera-receiver", daemon=True
        )
        thread.start()

    def read(self) -> Picture:
        """Block for the newest picture; see `Device`."""
        while True:
            newest: tuple[Decoded, float, float] | None = None
            for arrived in self._take():
                for decoded, at_s, late_s in self._decode(arrived):
                    self._skipped += newest is not None
                    newest = decoded, at_s, late_s
            if newest is None:
                self._judge_blindness()
                continue
            decoded, at_s, late_s = newest
            if late_s > _HOPELESS_S:
                raise SourceError(f"its pictures are {late_s:.0f} s late")
            image = self._converter.image(decoded.frame)
            skipped, self._skipped = self._skipped, 0
            self._pictured_s = time.monotonic()
            self._pictures += 1
            self.complaint = ""
            return Picture(image, round((at_s - late_s) * 1e9), skipped)

    def interrupt(self) -> None:
        """Let a blocked read end now, the receiving thread with its next packet or time-out."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()

    def close(self) -> None:
        """As `interrupt`: the receiving thread closes the connection."""
        self.interrupt()

    def _receive(self, container: InputContainer) -> None:
        end = SourceError("the camera closed the connection")
        try:
            with container:
                for packet in container.demux(self._stream):
                    if packet.size:
                        self._put(packet, time.monotonic())
                    if self._closing:
                        return
        except av.error.ExitError:
            end = SourceError(f"no data for {container.read_timeout:g} s")
        except (av.error.FFmpegError, ValueError) as error:
            end = SourceError(self._why_it_broke(error))
        finally:
            with self._changed:
                self._end = end
                self._changed.notify_all()

    def _why_it_broke(self, error: Exception) -> str:
        if isinstance(error, av.error.InvalidDataError) and self._format == "mpjpeg":
            return "its pictures have another length than their Content-Length states"
        if isinstance(error, av.error.OSError):
            # So FFmpeg calls a connection that the other side closed in the middle of a picture.
            return "the camera closed the connection"
        return f"the connection broke ({reason(error)})"

    def _put(self, packet: Packet[VideoStream], now_s: float) -> None:
        late_s: float | None = None
        if not self._stamped:
            late_s = self._counts.late_s(now_s)
        elif self._single and packet.pts is not None and self._stream.time_base is not None:
            late_s = self._stamps.late_s(now_s, float(packet.pts * self._stream.time_base))
        with self._changed:
            if self._single and self._waiting:
                # Every picture stands alone: the newest is the one to decode.
                self._waiting.clear()
                self._replaced += 1
                self._waiting_bytes = 0
            if len(self._waiting) >= _MOST_PACKETS or self._waiting_bytes > _MOST_BYTES:
                self._waiting.clear()
                self._waiting_bytes, self._overrun = 0, True
            if self._overrun and not packet.is_keyframe:
                return
            self._overrun = False
            self._waiting.append(_Arrived(packet, now_s, late_s))
            self._waiting_bytes += packet.size
            self._changed.notify_all()

    def _take(self) -> list[_Arrived]:
        """All packets that wait, without those before the newest key frame if they are old."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._end or self._closing, 1.0)
            packets = list(self._waiting)
            self._waiting.clear()
            self._skipped += self._replaced
            self._waiting_bytes = self._replaced = 0
            if self._closing:
                raise SourceError("closed")
            if not packets and self._end is not None:
                raise self._ended(self._end)
        self._packets += len(packets)
        waited_s = time.monotonic() - packets[0].at_s if packets else 0.0
        self._stream.codec_context.skip_frame = "NONREF" if waited_s > _BEHIND_S else "DEFAULT"
        if waited_s > _BEHIND_S:
            keys = [count for count, one in enumerate(packets) if one.packet.is_keyframe]
            if keys and keys[-1]:
                self._skipped += keys[-1]
                packets = packets[keys[-1] :]
        return packets

    def _decode(self, arrived: _Arrived) -> list[tuple[Decoded, float, float]]:
        """The good pictures of a packet, when each arrived, and how late that was; seconds."""
        packet = arrived.packet
        if self._is_jpeg and _cut_off(packet):
            self._note_damage()
            return []
        if packet.pts is not None:
            self._arrival_of[packet.pts] = arrived.at_s
            while len(self._arrival_of) > _MOST_PACKETS:
                self._arrival_of.pop(next(iter(self._arrival_of)))
        before = self._decoder.damaged_packets
        pictures = []
        for decoded in self._decoder.decode(packet):
            at_s, late_s = self._lateness(decoded, arrived)
            if decoded.damaged:
                self._note_damage()
            elif late_s is not None:
                pictures.append((decoded, at_s, late_s))
        if self._decoder.damaged_packets > before and self._pictures:
            self._note_damage()
        return pictures

    def _lateness(self, decoded: Decoded, arrived: _Arrived) -> tuple[float, float | None]:
        """When the frame arrived, and how late; None: the newest is still to come."""
        if arrived.late_s is not None:
            joined = not self._stamped or self._stamps.joined or self._pictures
            return arrived.at_s, arrived.late_s if joined else None
        if decoded.pts_s is None or self._stream.time_base is None:
            return arrived.at_s, 0.0
        pts = round(decoded.pts_s / float(self._stream.time_base))
        at_s = self._arrival_of.pop(pts, arrived.at_s)
        late_s = self._stamps.late_s(at_s, decoded.pts_s)
        return at_s, late_s if self._stamps.joined else None

    def _note_damage(self) -> None:
        self._skipped += 1
        self.complaint = _DAMAGED

    def _judge_blindness(self) -> None:
        """Give up where data came for too long without a picture.

        Raises:
            SourceError: so it is.
        """
        blind_s = time.monotonic() - self._pictured_s
        if self._packets and not self._pictures and blind_s > 1.0 and not self.complaint:
            self.complaint = _NO_KEY_FRAME
        if blind_s > (_BLIND_S if self._pictures else KEY_FRAME_WAIT_S):
            raise SourceError(f"no picture for {blind_s:.0f} s; {self.complaint or 'no data'}")

    def _ended(self, end: SourceError) -> SourceError:
        played_s = time.monotonic() - self._opened_s
        if self._length_s > 0.0 and self._pictures and played_s > 0.9 * self._length_s:
            return RecordingEnded("end of the recording")
        if not self._pictures and self.complaint:
            return SourceError(f"{end}; {self.complaint}")
        return end


def _cut_off(packet: Packet[VideoStream]) -> bool:
    """Whether a JPEG has no end: a decoder fills what is missing with grey, and says nothing."""
    data = bytes(packet)
    return data.rfind(_END_OF_IMAGE) < data.rfind(_START_OF_SCAN)
