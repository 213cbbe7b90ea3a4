"""The page that lists robots: what each of them says of itself, and a link to its own page.

It hears health and the followers' states, and neither pictures nor tracks; it sends nothing.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import zenoh
from aiohttp import web

from heel.schemas import MessageError
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.presence import connected
from heel.services.runtime.robots import ALL_ALIVE, ROBOTS_PAGE, TOPICS, Robots, let_through
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext
from heel.services.web.door import Door
from heel.services.web.hub import Hub
from heel.services.web.serving import serving
from heel.services.web.settings import WebServiceSettings

_STATUS_PERIOD_S = 0.5
"""Seconds between two looks at what all robots do; chosen by hand."""
_ANY = "all"
"""In place of names: whichever robots there are."""


@dataclass(frozen=True)
class RobotsSite(Door):
    """The list, as a page and as JSON."""

    PAGE: ClassVar[str] = "robots.html"
    FILES: ClassVar[tuple[str, ...]] = ("robots.js",)

    def routes(self) -> list[web.RouteDef]:
        """The list."""
        return [web.get("/api/robots", self._robots)]

    async def _robots(self, _request: web.Request) -> web.Response:
        status, age_s = self.hub.status()
        return web.json_response(status | {"status_age_s": round(age_s, 3)})


class RobotsService:
    """Hears all robots of a router; runs in the service's loop."""

    def __init__(self, context: ServiceContext[WebServiceSettings], hub: Hub) -> None:
        self._context, self._hub = context, hub
        expected = tuple(name for name in context.settings.robots if name != _ANY)
        self._robots = Robots(expected, begun_s=time.monotonic())
        inbox = context.inbox
        for topic, key in TOPICS.items():
            inbox.subscribe(topic, key, qos.HEALTH)
        inbox.subscribe_alive("alive", ALL_ALIVE)
        self._resources = ExitStack()
        let_through(context.session, self._resources)
        self._due_s = 0.0

    def run(self) -> None:
        """List what comes until the service is stopped."""
        with self._resources:
            while self._context.running:
                arrival = self._context.inbox.get(LOOP_WAIT_S)
                if arrival is not None:
                    with self._context.surviving("listing"):
                        self._take(arrival)
                if (now_s := time.monotonic()) >= self._due_s:
                    self.tick(now_s)

    def tick(self, now_s: float) -> None:
        """Tell viewers how it is with every robot."""
        self._due_s = now_s + _STATUS_PERIOD_S
        router = connected(self._context.session)
        rows = self._robots.rows(now_s) if router else []
        self._hub.put_note("status", self._status(router, [row.as_json() for row in rows]))

    def _status(self, router: bool, robots: list[dict[str, Any]]) -> dict[str, Any]:
        return {
            "type": "robots", "router": router, "robots": robots,
            "unlisted": self._robots.unlisted,
        }  # fmt: skip

    def _take(self, arrival: Arrival) -> None:
        statistics = self._context.statistics
        if arrival.topic == "alive":
            there = arrival.sample.kind == zenoh.SampleKind.PUT
            self._robots.token(arrival.key, there, arrival.arrived_s)
            return
        statistics.input(arrival.arrived_s)
        try:
            self._robots.hear(
                arrival.topic, arrival.key, arrival.payload, arrival.encoding, arrival.arrived_s
            )
        except MessageError as error:
            statistics.malformed += 1
            self._context.warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)


def serve_robots(context: ServiceContext[WebServiceSettings]) -> None:
    """Serve the list of robots until the service is stopped."""
    hub = Hub(context.settings.max_viewers)
    service = RobotsService(context, hub)
    service.tick(time.monotonic())
    with serving(context, partial(RobotsSite, hub=hub)) as url:
        context.statistics.details[ROBOTS_PAGE] = url
        context.announce()
        service.run()
