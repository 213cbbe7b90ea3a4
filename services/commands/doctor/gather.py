"""Finding the facts out: every wait has an end, and nothing is changed by it."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import socket
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from heel.schemas import CameraInfo, HeelError, MessageError, Stamp, decode, keys
from heel.services.commands.bus.listening import Listening, listening
from heel.services.commands.doctor.facts import (
    BusFacts,
    CameraFacts,
    MachineFacts,
    ModelFacts,
    RouterFacts,
)
from heel.services.commands.doctor.knock import knock
from heel.services.commands.observed import TOPICS, Observed
from heel.services.commands.robot import TIMEOUT_S, RobotFlags, Where, ask
from heel.services.runtime.certificate import days_left, valid_until

if TYPE_CHECKING:
    from heel.services.runtime.inbox import Arrival

_ENTER_S = 0.5
"""Longest wait for a router that answers to let us in [s]: refused is refused. Chosen by hand."""
_LISTEN_S = 1.5
"""Seconds of listening: five messages of health of every service."""
_CAMERA_S = 3.0
"""Seconds of pictures that a rate is of; chosen by hand."""
_CAMERA_START_S = 15.0
"""Longest time of a camera to open and give its pictures [s]; chosen by hand."""
_LOOKS = 5
"""Pictures that the time of a network is of, the first left out; chosen by hand."""
_PORTS = (7447, 8470)
"""Of a router, and of the page."""
_EXTRAS = {
    "neural": ("onnx", "onnxruntime"),
    "sim": ("panda3d",),
    "eval": ("matplotlib",),
    "metrics": ("prometheus_client",),
    "secure": ("cryptography", "segno"),
}
_USUAL_ROUTER = "tcp/127.0.0.1:7447"
_STAMPED = {"command": keys.FOLLOW_COMMAND, "drive": keys.ROBOT_DRIVE}
_TCP = re.compile(r"tcp/(.+):(\d{1,5})(?:[#?].*)?")


def find(robot: RobotFlags) -> Where:
    """The robot that is meant; a run folder that cannot be used is a finding here, and no end.

    Raises:
        SettingsError: several are possible, or the one named does not run.
    """
    try:
        return robot.find()
    except HeelError:
        if _run_folder_problem() is None:
            raise
    # Without the folder only a router can be meant.
    return replace(robot, connect=robot.connect or _USUAL_ROUTER, run=None, robot=None).find()


def ask_robot(where: Where) -> tuple[RouterFacts, BusFacts | None]:
    """Whether the router lets us in, and what is heard there."""
    endpoint, user = where.router, where.zenoh.user
    named = where.run is not None or bool(where.zenoh.model_fields_set & {"connect", "config_file"})
    found = _TCP.fullmatch(endpoint)
    answer = None
    if found is not None:
        answer = knock(found[1].strip("[]"), int(found[2]), TIMEOUT_S)
        if answer != "zenoh":
            return RouterFacts(endpoint, named, answer, entered=False, user=user), None
        settings = where.zenoh.model_copy(update={"connect_timeout_s": _ENTER_S})
        where = replace(where, zenoh=settings)
    try:
        with listening(where, TOPICS | _STAMPED, _LISTEN_S, alive=True, quiet=True) as bus:
            told = _listen(bus)
            versions = _versions(bus)
    except HeelError as error:
        return RouterFacts(
            endpoint, named, answer, False, user, str(error), uncertified=_uncertified(where)
        ), None  # fmt: skip
    return RouterFacts(endpoint, named, answer, True, user, versions=versions), told


def _uncertified(where: Where) -> str:
    from heel.services.runtime.session import without_certificates, zenoh_config

    with suppress(HeelError):
        return without_certificates(where.zenoh.connect, zenoh_config(where.zenoh))
    return ""


def certificate_days(file: Path | None) -> float | None:
    """How long the certificate in a Zenoh file of `heel security` is still valid, in days."""
    until = valid_until(file)
    return None if until is None else days_left(until)


def _listen(bus: Listening) -> BusFacts:
    heard, clocks_s = Observed(), dict[str, float]()
    camera = None
    with suppress(HeelError):
        answer = ask(bus.session, keys.TOPICS["info"], CameraInfo)
        camera = answer if isinstance(answer, CameraInfo) else None
    for arrival in bus.turns():
        if arrival is None:
            continue
        with suppress(MessageError):
            _note_clock(arrival, clocks_s)
        if arrival.topic not in _STAMPED:
            heard.take(arrival)
    now_s = time.monotonic()
    return BusFacts(
        tuple(part.health for part, state in heard.watch.rows(now_s) if state == "ok"),
        tuple(problem.words for problem in heard.problems(bus.where, now_s)), clocks_s, camera,
    )  # fmt: skip


def _note_clock(arrival: Arrival, clocks_s: dict[str, float]) -> None:
    """By how much a sender's clock is ahead at least: the quickest of its messages tells best.

    Raises:
        MessageError: its stamp is none.
    """
    if (attached := arrival.attachment) is None:
        return
    stamp = decode(Stamp, attached)
    arrived_s = time.time() - (time.monotonic() - arrival.arrived_s)
    ahead_s = stamp.t_sent_ns / 1e9 - arrived_s
    clocks_s[stamp.producer] = max(clocks_s.get(stamp.producer, -float("inf")), ahead_s)


def _versions(bus: Listening) -> dict[str, str]:
    """Of the router's software; none where it does not say."""
    from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY

    for reply in bus.session.get(
        keys.ROUTER_VERSION, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=TIMEOUT_S
    ):
        if reply.ok is None:
            continue
        with suppress(ValueError, AttributeError):
            told = json.loads(reply.ok.payload.to_bytes()[:1024])
            return {str(name)[:20]: str(one)[:40] for name, one in told.items() if name != "host"}
    return {}


def look_at_machine(where: Where) -> MachineFacts:
    """This computer, as far as Heel depends on it."""
    from heel.services.models.store import models_folder
    from heel.services.runtime.process import may_lock_memory, software_version
    from heel.services.runtime.session import why_no_shared_memory
    from heel.services.runtime.shared_memory import SHARED_MEMORY, full_share

    may_lock = may_lock_memory()
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    shared = None
    with suppress(OSError):
        shared = shutil.disk_usage(SHARED_MEMORY).total
    own = {where.router.rpartition(":")[2]}
    if where.run is not None and where.run.page:
        own.add(where.run.page.rstrip("/").rpartition(":")[2])
    return MachineFacts(
        cores=len(os.sched_getaffinity(0)),
        load=os.getloadavg()[0],
        may_lock=may_lock,
        locked_bytes=None if limit == resource.RLIM_INFINITY else limit,
        shared_bytes=shared,
        shared_share=full_share(),
        shared_problem=why_no_shared_memory() if may_lock and shared else None,
        missing={
            extra: tuple(one for one in modules if find_spec(one) is None)
            for extra, modules in _EXTRAS.items()
        },
        free_bytes=_free_bytes(Path(tempfile.gettempdir()), Path.cwd(), models_folder()),
        ports={port: _is_free(port) for port in _PORTS if str(port) not in own},
        run_folder=_run_folder_problem(),
        version=software_version(),
    )


def _run_folder_problem() -> str | None:
    """What is wrong with the folder in which runs are noted; None: nothing."""
    from heel.services.runtime.places import run_folder

    try:
        run_folder()
    except HeelError as error:
        return str(error)
    return None


def _free_bytes(*folders: Path) -> dict[str, int]:
    """Of every disk that the folders are on; one that is yet to be made counts as its parent."""
    free: dict[int, tuple[str, int]] = {}
    for folder in folders:
        there = next((one for one in (folder, *folder.parents) if one.is_dir()), None)
        if there is not None:
            with suppress(OSError):
                usage = shutil.disk_usage(there)
                free.setdefault(there.stat().st_dev, (str(there), usage.free))
    return dict(free.values())


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def devices() -> tuple[str, ...]:
    """Cameras of this computer."""
    return tuple(sorted(str(one) for one in Path("/dev").glob("video[0-9]*")))


def try_camera(source: str) -> CameraFacts:
    """Open a camera and count its pictures for a while."""
    from heel.services.capture.sources import open_source
    from heel.services.runtime.passwords import without_passwords

    name = without_passwords(source)
    stop = threading.Event()
    # A camera that opens and gives nothing must not hold the command up.
    watchdog = threading.Timer(_CAMERA_START_S, stop.set)
    watchdog.daemon = True
    watchdog.start()
    try:
        with open_source(source, stop=stop) as opened:
            first = opened.read()
            if first is None:
                return CameraFacts(name, f"no picture within {_CAMERA_START_S:.0f} s")
            count, begun_s = 0, time.monotonic()
            while (took_s := time.monotonic() - begun_s) < _CAMERA_S and not stop.is_set():
                if opened.read() is None:
                    break
                count += 1
            height, width = first.image.shape[:2]
            rate_hz = count / took_s if took_s > 0 else 0.0
            return CameraFacts(name, None, rate_hz, opened.fps, width, height)
    except HeelError as error:
        return CameraFacts(name, without_passwords(str(error)))
    finally:
        watchdog.cancel()


def try_model() -> ModelFacts | None:
    """The network that detectors use without a flag, and how long it takes here; None: there is
    none."""
    from heel.services.models import store

    model = store.first_there()
    if model is None:
        return None
    try:
        file = store.whole_file(model)
        return _time_model(model.name, file)
    except HeelError as error:
        return ModelFacts(model.name, str(error))


def _time_model(name: str, file: Path) -> ModelFacts:
    import numpy as np

    from heel.services.networks.person_model import PersonModel

    network = PersonModel(file)
    # Nobody is in it: how long a look takes does not depend on that.
    picture = np.full((480, 640, 3), 128, np.uint8)
    network.detect(picture, 0.3)
    begun_s = time.monotonic()
    for _ in range(_LOOKS):
        network.detect(picture, 0.3)
    look_ms = (time.monotonic() - begun_s) * 1e3 / _LOOKS
    engine = re.search(r", by ([^;]+);", network.description)
    return ModelFacts(name, None, look_ms, engine[1] if engine else "")
