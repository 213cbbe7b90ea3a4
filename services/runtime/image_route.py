"""Which of a camera's two image topics a process listens to: raw on its own host, JPEG elsewhere.

Raw frames cost next to nothing through shared memory, and 266 Mbit/s (768x576 at 25/s) through
anything else. So the two travel on keys of their own, capture sends each only while somebody
listens there, and every receiver chooses by what is possible for it. Raw it is where the camera,
the router and the receiver are on one host, as the camera's `info` and the router tell.
"""

from __future__ import annotations

import json
import logging
import threading
from contextlib import suppress

import zenoh

from heel.schemas import CameraInfo, Header, MessageError, Progress, decode, encode, keys
from heel.services.runtime import qos as topics
from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.latched import latched_values
from heel.services.runtime.qos import TopicQos

IMAGE_TOPIC = "image"
"""The receivers' own name for frames, whichever way they come."""
_MOST_BYTES = 1024
"""Of a router's answer that is read; ours has less than 200."""
_ROUTER_S = 1.0
"""Seconds that the router has to tell its host; it takes milliseconds. Chosen by hand."""


def image_key(camera: str, camera_host: str | None, router_host: str | None, here: str) -> str:
    """The key on which a process on the host `here` is to listen for frames.

    Args:
        camera: its name.
        camera_host: from its `info`: empty if it sends no JPEG, None if nothing was heard of it.
        router_host: None if it does not say, or there is none.
        here: this host.
    """
    if camera_host == "":
        return keys.image(camera)
    elsewhere = {camera_host or here, router_host or here} != {here}
    return keys.jpeg(camera) if elsewhere else keys.image(camera)


def router_host(session: zenoh.Session) -> str | None:
    """The host of the router that this session is a client of; None if it does not say."""
    for reply in session.get(
        keys.ROUTER_VERSION,
        target=EVERYBODY,
        consolidation=EVERY_ANSWER,
        timeout=_ROUTER_S,
        congestion_control=zenoh.CongestionControl.DROP,
    ):
        if reply.ok is not None:
            with suppress(ValueError, AttributeError):
                host = json.loads(reply.ok.payload.to_bytes()[:_MOST_BYTES]).get("host")
                return host if isinstance(host, str) else None
    return None


class ImageRoute:
    """Keeps a service's subscription to frames on the right key while cameras come and go.

    Args:
        session: the service's.
        inbox: in which frames arrive, as topic `image`.
        camera: whose frames.
        receiver: this process's name among those that hear them.
        qos: of the subscription.
        statistics: told which way it is.
        log: told of every change.
    """

    def __init__(
        self, session: zenoh.Session, inbox: Inbox, camera: str, receiver: str, qos: TopicQos,
        statistics: ServiceStatistics, log: logging.Logger,
    ) -> None:  # fmt: skip
        self._session, self._inbox = session, inbox
        self._camera, self._qos = camera, qos
        self._statistics, self._log = statistics, log
        self._router = router_host(session)
        self._progress = session.declare_publisher(
            keys.progress(camera, receiver), priority=topics.PROGRESS.priority,
            congestion_control=zenoh.CongestionControl.DROP, express=True,
        )  # fmt: skip
        self._key = ""
        self._choosing = threading.Lock()

    def start(self, stop: threading.Event) -> None:
        """Subscribe, and from now on follow what the camera says of itself.

        It is asked first: a slow link would need a second for a raw frame that nobody wants.
        """
        asked = keys.info(self._camera)
        self._inbox.hear(asked, topics.INFO, self._take)
        for info in latched_values(self._session, asked, CameraInfo, self._log, stop):
            self._choose(info.host)
        if not self._key:
            self._choose(None)

    def _confirm(self, arrival: Arrival) -> None:
        """Say that a JPEG has arrived: the camera sends no more than the link takes."""
        with suppress(MessageError):
            header = decode(Header, arrival.attachment or b"")
            progress = Progress(stream=header.stream, epoch=header.epoch, seq=header.seq)
            self._progress.put(encode(progress), encoding=progress.encoding())

    def _take(self, arrival: Arrival) -> None:
        # The services that work with `info` say what is wrong with one.
        with suppress(MessageError):
            self._choose(decode(CameraInfo, arrival.payload, arrival.encoding).host)

    def _choose(self, camera_host: str | None) -> None:
        with self._choosing:
            key = image_key(self._camera, camera_host, self._router, monotonic_clock())
            if key == self._key:
                return
            as_jpeg = key == keys.jpeg(self._camera)
            told = self._confirm if as_jpeg else None
            self._inbox.move(IMAGE_TOPIC, key, self._qos, told)
            self._key = key
            self._statistics.details["images"] = "JPEG" if as_jpeg else "raw"
            if as_jpeg:
                self._log.info("frames come as JPEG: camera or router are on another host")
