"""From pixels to what goes on the wire: raw for the camera's own host, JPEG for others."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import EndOfStream, FrameId, Header, MessageError, Progress, decode, encode, keys
from heel.schemas.image import DEPTH, JPEG, RAW, encode_depth, encode_image
from heel.services.runtime import qos
from heel.services.runtime.frame_memory import FrameMemory
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.jpeg_window import JpegWindow
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.service import S, ServiceContext


@dataclass(frozen=True)
class StreamIdentity:
    """What every header of one start of a stream has in common."""

    stream: str
    epoch: int
    producer: str


def image_header(
    identity: StreamIdentity,
    image: NDArray[np.uint8],
    numbers: tuple[int, int],
    source_size: tuple[int, int],
    t_capture_ns: int,
    age_ns: int,
) -> Header:
    """Header of one frame as it is sent raw.

    Args:
        identity: of the stream.
        image: (H, W, 3) uint8 BGR that fits the cap already.
        numbers: seq within the stream, and index on the source's own timeline.
        source_size: width and height before anything scaled it, pixels.
        t_capture_ns: acquisition time.
        age_ns: monotonic time since then.
    """
    height, width = image.shape[:2]
    seq, index = numbers
    return Header(
        stream=identity.stream,
        epoch=identity.epoch,
        seq=seq,
        index=index,
        t_capture_ns=t_capture_ns,
        width=width,
        height=height,
        source_width=source_size[0],
        source_height=source_size[1],
        image_encoding=RAW,
        producer=identity.producer,
        age_ns=age_ns,
    )


class ImagePublisher:
    """Sends the frames of one camera on its two image topics, to each while somebody listens.

    In a lossless run every frame goes out raw: what waits for it may not be known here yet.

    Args:
        context: of the service.
        jpeg_quality: percent.
        memory: shared memory for raw frames; None sends them as they are.
    """

    def __init__(
        self, context: ServiceContext[S], jpeg_quality: int,
        memory: FrameMemory | None,
    ) -> None:  # fmt: skip
        camera, producer = context.settings.camera, context.producer
        self._quality = jpeg_quality
        self._memory = memory
        self._lossless = context.settings.delivery == "lossless"
        self.raw = context.publisher(keys.image(camera), qos.IMAGE)
        # Viewers elsewhere are live also where the pipeline runs lossless.
        self._jpeg = StreamPublisher(context.session, keys.jpeg(camera), qos.JPEG, "live", producer)
        self._context = context
        self._window = JpegWindow()
        self._deciding = threading.Lock()
        context.inbox.hear(keys.all_progress(camera), qos.PROGRESS, self._hear)

    def send(self, header: Header, image: NDArray[np.uint8]) -> None:
        """Send one frame, raw first: coding takes some milliseconds.

        Args:
            header: of the raw frame.
            image: (H, W, 3) uint8 BGR.
        """
        if self._lossless or self.raw.has_listeners:
            payload = encode_image(image, RAW)
            held = payload if self._memory is None else self._memory.hold(payload)
            self.raw.send_bytes(held, RAW, encode(header))
        if self._jpeg.has_listeners and self._may_send(header):
            coded = header.model_copy(update={"image_encoding": JPEG})
            payload = encode_image(image, JPEG, self._quality)
            self._jpeg.send_bytes(payload, JPEG, encode(coded))

    def _may_send(self, header: Header) -> bool:
        now_s = time.monotonic()
        with self._deciding:
            may = self._window.may_send(header.epoch, now_s)
            if may:
                self._window.sent(header.seq, now_s)
        return may

    def _hear(self, arrival: Arrival) -> None:
        try:
            progress = decode(Progress, arrival.payload, arrival.encoding)
        except MessageError as error:
            # A lossless capture refuses it as well, and counts it there.
            if not self._lossless:
                self._context.statistics.malformed += 1
                self._context.warn.warning("progress", f"{arrival.key}: {error}", arrival.arrived_s)
            return
        receiver = arrival.key.rpartition("/")[2]
        with self._deciding:
            self._window.heard(receiver, progress.epoch, progress.seq, arrival.arrived_s)

    def end(self, message: EndOfStream) -> None:
        """Announce on both that nothing more follows in this epoch."""
        self.raw.end(message)
        self._jpeg.end(message)


_DEPTHS_IN_FLIGHT = 8
"""Depth pictures in shared memory: those that a tracker keeps, and one on its way."""


class DepthPublisher:
    """Sends the depth pictures of a camera while somebody listens, in a lossless run all; raw.

    Args:
        context: of the service.
    """

    def __init__(self, context: ServiceContext[S]) -> None:
        self._publisher = context.publisher(keys.depth(context.settings.camera), qos.DEPTH)
        self._memory: FrameMemory | None = None
        if context.shared_memory:
            self._memory = FrameMemory(_DEPTHS_IN_FLIGHT, context.log)
        self._lossless = context.settings.delivery == "lossless"

    def send(
        self, identity: StreamIdentity, frame: FrameId, depth_mm: NDArray[np.uint16], age_ns: int
    ) -> None:
        """Send the depth of one frame.

        Args:
            identity: of the stream.
            frame: that it is of.
            depth_mm: (H, W) uint16, of the same view, 0 where nothing was measured.
            age_ns: monotonic time since acquisition.

        Raises:
            MessageError: it is larger than the cap.
        """
        if not (self._lossless or self._publisher.has_listeners):
            return
        height, width = depth_mm.shape
        header = Header(
            **frame.frame_id().model_dump(), width=width, height=height, source_width=width,
            source_height=height, image_encoding=DEPTH, producer=identity.producer, age_ns=age_ns,
        )  # fmt: skip
        payload = encode_depth(depth_mm)
        held = payload if self._memory is None else self._memory.hold(payload)
        self._publisher.send_bytes(held, DEPTH, encode(header))
