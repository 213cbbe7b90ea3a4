"""An episode through the real processes, in real time: what the closed loop must agree with."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import OrderedDict
from contextlib import ExitStack
from pathlib import Path

import zenoh

from heel.evaluation.following.log import EpisodeLog
from heel.schemas import (
    EndOfStream,
    FollowState,
    HeelError,
    SimTruth,
    Target,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.loops.scenarios.perception import STREAM
from heel.services.loops.scenarios.user import User
from heel.services.loops.scenarios.witness import Moment, Witness
from heel.services.run.children import Children
from heel.services.run.presence import await_present
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.router import open_private_router
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount

_POLL_S = 0.1
_SILENCE_S = 15.0
_ASK_S = 1.0
_KEPT_TRUTHS = 64


class ProcessEpisode:
    """Simulator, tracker, follower and drive as processes around a router of their own.

    The simulator's own boxes stand for pixels and detector. Must run in a process that
    `heel.services.run.guard.guarded` has made.

    Args:
        name: of the scenario.
        seed: of its world.
        config: settings file of the services.
        stop: gives the episode up when set.
    """

    def __init__(self, name: str, seed: int, config: Path | None, stop: threading.Event) -> None:
        self._name, self._seed, self._config, self._stop = name, seed, config, stop
        world = scenario(name, seed)
        target = [person.role for person in world.people].index("target")
        self._witness = Witness(world, CameraMount())
        self._user = User(target)
        self._truths: OrderedDict[int, SimTruth] = OrderedDict()
        self._people_by_track: dict[int, int] = {}
        self._state: FollowState | None = None
        self._over = False

    def run(self) -> EpisodeLog:
        """Until the episode's end, or until the robot touches somebody.

        Raises:
            HeelError: a service failed, the simulator fell silent, or it was given up.
        """
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="heel-")))
            session, endpoint = stack.enter_context(open_private_router())
            inbox = stack.enter_context(Inbox(session))
            for topic, key, how in (
                ("truth", keys.SIM_TRUTH, qos.SIM_TRUTH),
                ("tracks", keys.tracks(STREAM), qos.TRACKS),
                ("state", keys.FOLLOW_STATE, qos.STATE),
            ):
                # A record needs every message, not only the newest.
                inbox.subscribe(topic, key, how.for_delivery("lossless"))
            children = stack.enter_context(Children(folder))
            self._start(session, endpoint, children)
            self._look_on(session, inbox, children)
        if self._stop.is_set():
            raise HeelError("stopped before the end of the episode: its scores mean nothing")
        return self._witness.log()

    def _start(self, session: zenoh.Session, endpoint: str, children: Children) -> None:
        common = ["--connect", endpoint]
        common += ["--config", str(self._config)] if self._config is not None else []
        children.start("tracker", *common)
        children.start("follower", *common)
        children.start("drive", *common, "--driver", "simulated")
        await_present(session, children, {"tracker", "follower", "drive"}, self._stop)
        children.start(
            "simulator", self._name, *common, "--seed", str(self._seed),
            "--perception", "simulated-boxes", "--no-pictures",
        )  # fmt: skip

    def _look_on(self, session: zenoh.Session, inbox: Inbox, children: Children) -> None:
        heard_s = time.monotonic()
        while not self._over and not self._stop.is_set():
            if (failure := children.failure()) is not None:
                raise failure
            arrival = inbox.get(_POLL_S)
            if arrival is not None:
                heard_s = arrival.arrived_s
                self._take(session, arrival)
            elif time.monotonic() - heard_s > _SILENCE_S:
                raise HeelError(
                    f"the simulator is silent for {_SILENCE_S:g} s: is the machine very busy?"
                )

    def _take(self, session: zenoh.Session, arrival: Arrival) -> None:
        payload, encoding = arrival.payload, arrival.encoding
        if arrival.topic == "state":
            self._state = decode(FollowState, payload, encoding)
        elif encoding == EndOfStream.encoding():
            self._over = True
        elif arrival.topic == "truth":
            self._take_truth(decode(SimTruth, payload, encoding))
        else:
            self._take_tracks(session, decode(Tracks, payload, encoding))

    def _take_truth(self, truth: SimTruth) -> None:
        self._truths[truth.seq] = truth
        while len(self._truths) > _KEPT_TRUTHS:
            self._truths.popitem(last=False)
        if self._state is not None:
            self._witness.record(Moment.of_truth(truth), self._state, self._people_by_track)
        self._over = self._over or truth.contact > 0

    def _take_tracks(self, session: zenoh.Session, tracks: Tracks) -> None:
        truth = self._truths.get(tracks.seq)
        if truth is None or self._state is None:
            return
        on = self._people_by_track = self._witness.people_of(truth, tracks)
        shown = self._state.target
        self._user.act(truth.t_s, lambda request: _ask(session, request), shown, truth, on)


def _ask(session: zenoh.Session, request: TargetRequest) -> Target:
    """Choose as the page does.

    Raises:
        HeelError: the follower refuses or does not answer.
    """
    for reply in session.get(
        keys.FOLLOW_TARGET, payload=encode(request), encoding=request.encoding(), timeout=_ASK_S
    ):
        if reply.ok is not None:
            return decode(Target, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if reply.err is not None:
            raise HeelError(reply.err.payload.to_string())
    raise HeelError(f"the follower does not answer within {_ASK_S:g} s")
