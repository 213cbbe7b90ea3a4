"""The simulated world seen from above: what the page draws it from, where there is one."""

from __future__ import annotations

from typing import Any

from heel.schemas import MessageError, Pose, SimPerson, SimTruth, SimWorld, decode, keys
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import LatchedQuery
from heel.services.runtime.service import ServiceContext
from heel.services.web.hub import Hub
from heel.services.web.rate import RateLimiter
from heel.services.web.settings import WebServiceSettings

_MAX_HZ = 12.0
"""Views from above a second: the page moves people smoothly between them. Chosen by hand."""


class ViewFromAbove:
    """Passes a simulator's world and truth on to the viewers; without a simulator, nothing."""

    def __init__(self, context: ServiceContext[WebServiceSettings], hub: Hub) -> None:
        self._context = context
        self._hub = hub
        self._rate = RateLimiter(_MAX_HZ)
        self._known = False
        self._wanted = False
        self._latched = LatchedQuery(context.session, keys.SIM_WORLD, SimWorld)
        context.inbox.subscribe("sim-world", keys.SIM_WORLD, qos.SIM_WORLD)
        context.inbox.subscribe("sim-truth", keys.SIM_TRUTH, qos.SIM_TRUTH)

    def take(self, arrival: Arrival) -> None:
        """A world or the truth of one frame.

        Raises:
            MessageError: it is neither.
        """
        if arrival.topic == "sim-world":
            self._show(decode(SimWorld, arrival.payload, arrival.encoding))
            return
        self._wanted = True
        if self._hub.viewer_count and self._rate.admit(arrival.arrived_s):
            truth = decode(SimTruth, arrival.payload, arrival.encoding)
            self._hub.put_note("sim-truth", describe_truth(truth))

    def catch_up(self, now_s: float) -> None:
        """Ask for a world that was described before this service came."""
        if self._known or not self._wanted:
            return
        try:
            world = self._latched.poll(now_s)
        except MessageError as error:
            self._context.statistics.malformed += 1
            self._context.warn.warning("sim-world-reply", f"{keys.SIM_WORLD}: {error}", now_s)
            return
        if world is not None:
            self._show(world)

    def _show(self, world: SimWorld) -> None:
        self._known = True
        self._hub.put_note("sim-world", describe_world(world))


def describe_world(world: SimWorld) -> dict[str, Any]:
    """What does not move, as the page draws it."""
    return {
        "type": "sim-world",
        "scenario": world.scenario,
        "seed": world.seed,
        "bounds": [round(edge, 2) for edge in world.bounds_m],
        "obstacles": [
            {
                "kind": thing.kind,
                "pose": _pose(thing.pose),
                "length": round(thing.length_m, 3),
                "width": round(thing.width_m, 3),
            }
            for thing in world.obstacles
        ],
    }


def describe_truth(truth: SimTruth) -> dict[str, Any]:
    """Where all are, as the page draws it."""
    return {
        "type": "sim-truth",
        "seq": truth.seq,
        "t_s": round(truth.t_s, 2),
        "robot": _pose(truth.robot),
        "radius": truth.robot_radius_m,
        "linear_mps": round(truth.linear_mps, 3),
        "contacts": truth.contact,
        "people": [_person(person) for person in truth.people],
    }


def _person(person: SimPerson) -> dict[str, Any]:
    box = person.box_xyxy
    return {
        "id": person.id,
        "role": person.role,
        "pose": _pose(person.pose),
        "radius": person.radius_m,
        "box": None if box is None else [round(side) for side in box],
        "visible": round(person.visible, 2),
    }


def _pose(pose: Pose) -> list[float]:
    return [round(pose.x_m, 3), round(pose.y_m, 3), round(pose.heading_rad, 3)]
