"""The depth pictures that a tracker hears: the one of each frame, and what is said without it."""

from __future__ import annotations

import math
import threading
import time
from collections import deque

from heel.schemas import (
    CameraInfo,
    EndOfStream,
    Header,
    HeelError,
    MessageError,
    Tracks,
    decode,
    keys,
)
from heel.schemas.image import decode_depth
from heel.services.geometry.camera import Pinhole, camera_from_info, resized
from heel.services.geometry.depth import Depth
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.image_route import image_key, router_host
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import LatchedQuery, latched_values
from heel.services.runtime.service import LOOP_WAIT_S, S, ServiceContext
from heel.services.runtime.streams import StreamJudge
from heel.services.tracker.depth_places import with_depth

_KEPT = 12
"""Depth pictures kept until the people of their frame are known: half a second at 24 a second."""
_SILENT_S = 1.0
"""Silence after which health says that depth is missing; chosen by hand: some tens of frames."""
_WAIT_S = 0.02
"""Longest wait for the depth of a frame whose people are known already, while depth comes; chosen
by hand: a third of what a robot needs to obey. Depth is computed from pictures, as people are."""
_LOSSLESS_WAIT_S = 5.0
"""Longest wait for the depth of a frame of a lossless run, which is on its way; chosen by hand: a
machine that was held up."""
_DETAIL = "distances"
"""Of health: what the distances of people rest on."""


class DepthInput:
    """Hears depth where camera, router and this process share a host; pictures are not sent on.

    In a lossless run it hears depth wherever it is, and a camera that announces depth of every
    frame is waited for.

    Args:
        context: of the tracker.
    """

    def __init__(self, context: ServiceContext[S]) -> None:
        self._context = context
        camera = context.settings.camera
        self._lossless = context.settings.delivery == "lossless"
        self._qos = qos.DEPTH.for_delivery(context.settings.delivery)
        self._judge = StreamJudge(
            "depth", self._qos, context.statistics, context.warn, False, not self._lossless
        )
        self._arrivals: deque[Arrival] = deque(maxlen=_KEPT)
        self._arrived = threading.Event()
        self._kept: deque[tuple[Header, Arrival]] = deque(maxlen=_KEPT)
        self._info: CameraInfo | None = None
        self._router = router_host(context.session)
        self._subscribing = threading.Lock()
        self._subscribed = self._lossless
        self._heard_s = -math.inf
        self._asked_epoch: int | None = None
        if self._lossless:
            context.inbox.hear(keys.depth(camera), self._qos, self._take)
        context.inbox.hear(keys.info(camera), qos.INFO, self._hear_info)
        self._info_asked = LatchedQuery(context.session, keys.info(camera), CameraInfo)

    def take_info(self, info: CameraInfo) -> None:
        """Use what the camera says of itself; depth is heard from then on, if it is here."""
        self._info = info
        camera, here = self._context.settings.camera, monotonic_clock()
        with self._subscribing:
            near = image_key(camera, info.host, self._router, here) == keys.image(camera)
            if near and not self._subscribed:
                self._subscribed = True
                self._context.inbox.hear(keys.depth(camera), self._qos, self._take)

    def _take(self, arrival: Arrival) -> None:
        self._arrivals.append(arrival)
        self._arrived.set()

    def _hear_info(self, arrival: Arrival) -> None:
        try:
            self.take_info(decode(CameraInfo, arrival.payload, arrival.encoding))
        except MessageError as error:
            self._context.warn.warning("info", f"{arrival.key}: {error}", arrival.arrived_s)

    def placed(self, tracks: Tracks, now_s: float) -> Tracks:
        """The tracks with what depth tells of them; as they are without it.

        Raises:
            HeelError: the depth of a frame of a lossless run did not come.
        """
        if self._lossless:
            return self._placed_or_fail(tracks)
        if self._info is None:
            self._ask_info(now_s)
        self._judge_arrivals()
        silent_s = now_s - self._heard_s
        if silent_s == math.inf:
            return tracks
        reason = None
        if silent_s > _SILENT_S:
            reason = f"no depth for {_SILENT_S:g} s: distances rest on boxes again"
        if self._context.statistics.problem("depth", reason):
            self._context.log.info("%s", reason or "depth is heard again")
        if silent_s <= _SILENT_S and tracks.tracks:
            self._await(tracks)
        return self._told(tracks)

    def _placed_or_fail(self, tracks: Tracks) -> Tracks:
        """As `placed`, whenever the depth comes: the same in every run."""
        if not self._announced(tracks.epoch):
            return tracks
        deadline_s = time.monotonic() + _LOSSLESS_WAIT_S
        while not self._is_past(tracks) and not self._context.stop.is_set():
            self._arrived.wait(min(LOOP_WAIT_S, max(0.0, deadline_s - time.monotonic())))
            if time.monotonic() > deadline_s:
                raise HeelError(
                    f"no depth of frame {tracks.seq} within {_LOSSLESS_WAIT_S:g} s, though the "
                    "camera announced it"
                )
        if not any(one.seq == tracks.seq and one.epoch == tracks.epoch for one, _ in self._kept):
            raise HeelError(f"depth of frame {tracks.seq} was lost on its way")
        return self._told(tracks)

    def _announced(self, epoch: int) -> bool:
        """Whether every frame has depth; the camera said so before it sent the first one."""
        known = self._info is not None and self._info.epoch == epoch
        if not known and epoch != self._asked_epoch:
            self._asked_epoch = epoch
            context, key = self._context, keys.info(self._context.settings.camera)
            for info in latched_values(
                context.session, key, CameraInfo, context.log, context.stop
            ):  # fmt: skip
                self.take_info(info)
        return self._info is not None and self._info.epoch == epoch and self._info.depth

    def _told(self, tracks: Tracks) -> Tracks:
        depth_mm, camera = self._depth(tracks), self._camera(tracks)
        if depth_mm is None or camera is None:
            words = "by boxes: no depth of this frame" if camera else "by boxes: no field of view"
            self._context.statistics.detail(_DETAIL, words)
            return tracks
        self._context.statistics.detail(_DETAIL, "by depth")
        return with_depth(tracks, depth_mm, camera)

    def _await(self, tracks: Tracks) -> None:
        """Until the depth of a frame is there or cannot come any more, a moment at most."""
        deadline_s = time.monotonic() + _WAIT_S
        while not self._is_past(tracks):
            if not self._arrived.wait(max(0.0, deadline_s - time.monotonic())):
                return

    def _is_past(self, tracks: Tracks) -> bool:
        """Whether the depth of a frame is there or cannot come any more."""
        self._arrived.clear()
        self._judge_arrivals()
        newest = self._kept[-1][0] if self._kept else None
        return newest is not None and newest.epoch == tracks.epoch and newest.seq >= tracks.seq

    def _ask_info(self, now_s: float) -> None:
        try:
            info = self._info_asked.poll(now_s)
        except MessageError as error:
            self._context.warn.warning("info", f"{error}", now_s)
            return
        if info is not None:
            self.take_info(info)

    def _judge_arrivals(self) -> None:
        while self._arrivals:
            arrival = self._arrivals.popleft()
            if arrival.encoding == EndOfStream.encoding():
                continue
            header = self._judge.header(arrival)
            if header is not None:
                self._kept.append((header, arrival))
                self._heard_s = arrival.arrived_s

    def _depth(self, tracks: Tracks) -> Depth | None:
        """The depth picture of the tracks' very frame."""
        for header, arrival in self._kept:
            if (header.epoch, header.seq) == (tracks.epoch, tracks.seq):
                try:
                    return decode_depth(arrival.payload, header, arrival.encoding)
                except MessageError as error:
                    self._judge.refuse(arrival, error)
        return None

    def _camera(self, tracks: Tracks) -> Pinhole | None:
        if self._info is None:
            return None
        return camera_from_info(resized(self._info, tracks.width, tracks.height))
