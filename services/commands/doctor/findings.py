"""What the facts mean: each finding with its cause and the next command. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from heel.services.commands.doctor.facts import (
    BusFacts,
    CameraFacts,
    Facts,
    MachineFacts,
    ModelFacts,
    RouterFacts,
)
from heel.services.runtime.certificate import CERTIFICATES_REMEDY, SOON_DAYS
from heel.services.runtime.chain import CERTIFICATE

Level = Literal["ok", "note", "wrong"]
"""`note`: nothing is broken, and something could be better or is not there."""

_MOST_SKEW_S = 0.05
"""Difference of wall clocks that is told; a clock that is set over the network is closer. Chosen by
hand."""
_LEAST_DISK_BYTES = 1 << 30
"""Room below which it is said; a minute of a run's results and logs is some 10 MB. Chosen by
hand."""
_NO_DISK_BYTES = 50 << 20
"""Room below which results and logs will fail; chosen by hand."""
_FULL_SHARE = 0.9
"""Of shared memory, from which on services complain."""
_LEAST_SHARED_BYTES = 64 << 20
"""Docker's usual size: a camera of 1080p takes 40 MB of pools, and what restarts as much again."""
_RENEW = "heel security renew DIR, and start router and services again"
_BUSY_LOAD = 1.5
"""Processes that want a core, per core, from which on frames wait; chosen by hand."""
_SLOW_SHARE = 0.7
"""Of the rate that a camera says to give, below which it is told; chosen by hand."""
_FEW_LOOKS_HZ = 8.0
"""Pictures per second that a network looks at below which a person that turns is lost more often;
chosen by hand."""
_FOV_DEG = (25.0, 150.0)
"""Horizontal field of view of cameras that robots carry; chosen by hand."""
_HEIGHT_M = (0.05, 3.0)
"""Mounting height of one; chosen by hand."""
_PITCH_DEG = (-60.0, 60.0)
"""Its pitch; chosen by hand."""
_EXTRAS = {
    "neural": "networks run in half the time with it",
    "sim": "heel demo and heel scenarios --pixels draw with it",
    "eval": "plots of heel eval",
    "metrics": "Prometheus reads services with it",
    "secure": "heel security makes certificates with it",
}
"""What each extra is for."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        level: how it is.
        about: what was looked at, in a word or two.
        words: what was found, and the cause.
        remedy: the next command or step; empty where there is nothing to do.
    """

    level: Level
    about: str
    words: str
    remedy: str = ""


def findings(facts: Facts) -> list[Finding]:
    """Everything that was looked at, in the order in which it is put right."""
    found = [_router(facts.router), *_certificate(facts.router.certificate_days)]
    if facts.bus is not None:
        found += _bus(facts.bus, facts.machine.version)
    found += _shared_memory(facts.machine, facts.bus)
    found += _camera(facts)
    found += [_model(facts.model)]
    found += _machine(facts.machine)
    return found


def _router(router: RouterFacts) -> Finding:
    where, about = router.endpoint, "router"
    if router.entered:
        told = ", ".join(f"{name} {version}" for name, version in router.versions.items())
        return Finding("ok", about, f"{where} answers ({told or 'it does not tell its version'})")
    if router.answer == "zenoh" and router.user is None:
        return Finding("wrong", about, f"{where} answers and asks for a user",
                       "give --user NAME --password-file FILE")  # fmt: skip
    if router.answer == "zenoh":
        return Finding(
            "wrong", about, f"{where} answers and does not let user {router.user!r} in: no such "
            "user, or another password", "compare them with the router's users file (heel router "
            "--users-file); its log says which of the two it is",
        )  # fmt: skip
    if router.answer == "other":
        return Finding("wrong", about, f"what listens at {where} is no Zenoh router",
                       "name the router with --connect, or choose another port for it")  # fmt: skip
    if router.answer == "silent":
        return Finding("wrong", about, f"{where} takes the connection and says nothing: the router "
                       "hangs, or it is another server", "start the router anew")  # fmt: skip
    if router.answer == "unknown host":
        return Finding("wrong", about, f"the host of {where} is not known",
                       "check the name, or give an address of numbers")  # fmt: skip
    if router.answer == "unreachable":
        return Finding("wrong", about, f"no way to {where}: the host is off, on another network, "
                       "or a firewall drops the port", "ping the host")  # fmt: skip
    if router.uncertified:
        return Finding("wrong", about, f"{where}: {router.uncertified}", CERTIFICATES_REMEDY)
    if router.answer is None:
        return Finding("wrong", about, f"{where}: {router.reason}", "check --connect")
    if router.named:
        return Finding("wrong", about, f"the host answers and nothing listens at {where}",
                       "start heel router there, with --listen beyond loopback")  # fmt: skip
    return Finding("note", about, f"nothing runs here: no heel demo, no heel run, no router at "
                   f"{where}", "heel demo")  # fmt: skip


def _certificate(days: float | None) -> Iterator[Finding]:
    if days is None:
        return
    about, remedy = "certificate", _RENEW
    if days <= 0:
        yield Finding("wrong", about, f"this one ended {-days:.0f} days ago: no router lets it in",
                      remedy)  # fmt: skip
    elif days < SOON_DAYS:
        yield Finding("note", about, f"this one ends in {days:.0f} days: nothing connects from "
                      "then on", remedy)  # fmt: skip
    else:
        yield Finding("ok", about, f"valid for {days:.0f} days")


def _bus(bus: BusFacts, version: str) -> Iterator[Finding]:
    if not bus.services:
        yield Finding("note", "services", "none is heard", "heel status")
        return
    for words in bus.problems:
        yield Finding("wrong", "services", words, "heel status; then start or stop what it names")
    sick = [one for one in bus.services if one.state == "error"]
    for one in sick:
        yield Finding("wrong", "services", f"{one.service}/{one.instance}: {one.reason}",
                      "its log says more")  # fmt: skip
    if not bus.problems and not sick:
        names = ", ".join(sorted({one.service for one in bus.services}))
        yield Finding("ok", "services", f"{names}; none is missing, silent or there twice")
    twice = [one for one in bus.services if "two producers on" in one.reason]
    for one in twice:
        yield Finding("wrong", "producers", f"{one.service}/{one.instance}: {one.reason}",
                      "stop one of the two")  # fmt: skip
    others = {f"{one.service}/{one.instance} {one.software_version}" for one in bus.services
              if one.software_version != version}  # fmt: skip
    if others:
        yield Finding("wrong", "versions", f"here {version}; {', '.join(sorted(others))}",
                      "install one version everywhere: there are no readers for two")  # fmt: skip
    else:
        yield Finding("ok", "versions", f"all have {version}")
    for one in bus.services:
        if CERTIFICATE in one.details:
            yield Finding("note", "certificates", f"{one.service}/{one.instance}: "
                          f"{one.details[CERTIFICATE]}", _RENEW)  # fmt: skip
    yield from _clocks(bus)


def _clocks(bus: BusFacts) -> Iterator[Finding]:
    if not bus.clocks_s:
        return
    off = {name: s for name, s in bus.clocks_s.items() if abs(s) > _MOST_SKEW_S}
    for name, ahead_s in off.items():
        side = "ahead of" if ahead_s > 0 else "behind"
        also = "" if ahead_s > 0 else ", or its messages take as long"
        yield Finding("note", "clocks", f"{name} is {abs(ahead_s):.2f} s {side} this clock{also}: "
                      "times in files do not agree; no motion depends on it",
                      "timedatectl set-ntp true, on both hosts")  # fmt: skip
    if not off:
        worst_ms = max(map(abs, bus.clocks_s.values())) * 1e3
        yield Finding("ok", "clocks", f"agree within {max(1.0, worst_ms):.0f} ms")


def _shared_memory(machine: MachineFacts, bus: BusFacts | None) -> Iterator[Finding]:
    about = "shared memory"
    if machine.shared_bytes is None:
        yield Finding("note", about, "there is no /dev/shm: frames go through sockets",
                      "mount -t tmpfs tmpfs /dev/shm")  # fmt: skip
        return
    size_mb = machine.shared_bytes / 1e6
    if machine.shared_problem is not None and machine.may_lock:
        yield Finding("wrong", about, machine.shared_problem,
                      "mount -o remount,size=512M /dev/shm; Docker: --shm-size")  # fmt: skip
    elif machine.shared_share is not None and machine.shared_share > _FULL_SHARE:
        yield Finding("wrong", about, f"/dev/shm is {machine.shared_share:.0%} full",
                      "ls -l /dev/shm; mount -o remount,size=512M /dev/shm")  # fmt: skip
    elif not machine.may_lock:
        limit = "unlimited" if machine.locked_bytes is None else f"{machine.locked_bytes >> 20} MiB"
        yield Finding("note", about, f"this user may lock {limit} of 256 MiB that it takes: "
                      "frames go through sockets, which costs some milliseconds a frame",
                      "ulimit -l unlimited (limits.conf, LimitMEMLOCK of systemd; Docker: "
                      "--cap-add IPC_LOCK)")  # fmt: skip
    elif machine.shared_bytes < _LEAST_SHARED_BYTES:
        yield Finding("note", about, f"/dev/shm has {size_mb:.0f} MB, which one large camera fills",
                      "mount -o remount,size=512M /dev/shm; Docker: --shm-size")  # fmt: skip
    else:
        yield Finding("ok", about, f"{size_mb:.0f} MB, {machine.shared_share or 0:.0%} used, and "
                      "as much of it as is needed may be locked")  # fmt: skip
    by_socket = [f"{one.service}/{one.instance}" for one in (bus.services if bus else ())
                 if one.shared_memory is False]  # fmt: skip
    if by_socket:
        yield Finding("note", about, f"{', '.join(sorted(by_socket))}: frames come through "
                      "sockets, as they do from another host or container",
                      "on one host: the same /dev/shm and --shared-memory for all")  # fmt: skip


def _camera(facts: Facts) -> Iterator[Finding]:
    about, camera = "camera", facts.camera
    senders = [one for one in (facts.bus.services if facts.bus else ())
               if one.service in ("capture", "simulator")]  # fmt: skip
    for one in senders:
        level: Level = "ok" if one.rate_out_hz > 0 else "wrong"
        yield Finding(level, about, f"{one.service}/{one.instance} sends {one.rate_out_hz:.1f} "
                      "frames/s", "" if level == "ok" else "heel echo health; its log")  # fmt: skip
    if camera is not None:
        yield _tried(camera)
    elif not senders and facts.devices:
        yield Finding("note", about, f"not tried: {', '.join(facts.devices)}",
                      f"heel doctor --camera {facts.devices[0]}")  # fmt: skip
    elif not senders:
        yield Finding("note", about, "no capture runs, and this computer has no camera",
                      "heel capture scene:demo, or the address of a network camera")  # fmt: skip
    if facts.bus is not None and senders:
        yield from _calibration(facts.bus)


def _tried(camera: CameraFacts) -> Finding:
    if camera.problem is not None:
        return Finding("wrong", "camera", f"{camera.source}: {camera.problem}",
                       "fuser -v /dev/video*: another program may have it")  # fmt: skip
    told = f"{camera.source}: {camera.width}x{camera.height}, {camera.rate_hz:.1f} frames/s"
    if camera.rate_hz < _SLOW_SHARE * camera.nominal_hz:
        return Finding("note", "camera", f"{told}, of {camera.nominal_hz:.0f} that it states: "
                       "little light, or a USB bus that is full",
                       "more light; heel capture --camera-fourcc MJPG")  # fmt: skip
    return Finding("ok", "camera", told)


def _calibration(bus: BusFacts) -> Iterator[Finding]:
    about, camera = "calibration", bus.camera
    if camera is None:
        return
    if camera.horizontal_fov_rad is None or camera.mount_height_m is None:
        yield Finding("note", about, "the camera tells neither field of view nor height: distances "
                      "are estimated from people's size alone",
                      "heel calibrate person RECORDING --out camera.toml; heel capture "
                      "--calibration camera.toml")  # fmt: skip
        return
    fov_deg, height_m = math.degrees(camera.horizontal_fov_rad), camera.mount_height_m
    pitch_deg = math.degrees(camera.mount_pitch_rad or 0.0)
    told = f"field of view {fov_deg:.0f} degrees, {height_m:.2f} m high, pitch {pitch_deg:.0f}"
    odd = [name for name, value, (low, high) in (
        ("field of view", fov_deg, _FOV_DEG), ("height", height_m, _HEIGHT_M),
        ("pitch", pitch_deg, _PITCH_DEG),
    ) if not low <= value <= high]  # fmt: skip
    if odd:
        yield Finding("wrong", about, f"{told}: no robot's camera has this {' and '.join(odd)}; "
                      "degrees and radians, or metres and centimetres, may be mixed up",
                      "heel calibrate person RECORDING --out camera.toml")  # fmt: skip
    else:
        yield Finding("ok", about, told)


def _model(model: ModelFacts | None) -> Finding:
    if model is None:
        return Finding(
            "note", "network", "none is here: people are found by what moves, which needs a camera "
            "that mostly stands still", "heel models get yolox-nano",
        )  # fmt: skip
    if model.problem is not None:
        return Finding("wrong", "network", f"{model.name}: {model.problem}",
                       f"heel models get {model.name}")  # fmt: skip
    looks_hz = 1e3 / model.look_ms if model.look_ms > 0 else math.inf
    told = f"{model.name}: {model.look_ms:.0f} ms a picture here ({model.engine})"
    if looks_hz < _FEW_LOOKS_HZ:
        return Finding("note", "network", f"{told}: {looks_hz:.0f} pictures/s are looked at",
                       "heel models get person-192; --profile pi")  # fmt: skip
    return Finding("ok", "network", told)


def _machine(machine: MachineFacts) -> Iterator[Finding]:
    for extra, modules in machine.missing.items():
        if modules:
            yield Finding("note", "extras", f"{extra} is not installed ({', '.join(modules)}): "
                          f"{_EXTRAS.get(extra, '')}",
                          f"pip install {' '.join(modules).replace('_', '-')}")  # fmt: skip
    if not any(machine.missing.values()):
        yield Finding("ok", "extras", f"{', '.join(machine.missing)} are installed")
    taken = [port for port, free in machine.ports.items() if not free]
    if taken:
        yield Finding("note", "ports", f"taken by other processes: {', '.join(map(str, taken))}",
                      "ss -ltnp; heel demo --port 0, heel router --listen")  # fmt: skip
    elif machine.ports:
        yield Finding("ok", "ports", f"{', '.join(map(str, machine.ports))}: free")
    for folder, free in machine.free_bytes.items():
        if free < _LEAST_DISK_BYTES:
            level: Level = "wrong" if free < _NO_DISK_BYTES else "note"
            yield Finding(level, "disk", f"{folder}: {free / 1e6:.0f} MB free",
                          "df -h; make room, or give --out on another disk")  # fmt: skip
    if all(free >= _LEAST_DISK_BYTES for free in machine.free_bytes.values()):
        least = min(machine.free_bytes.values(), default=0)
        yield Finding("ok", "disk", f"{least / 1e9:.0f} GB free")
    if machine.run_folder is not None:
        yield Finding("wrong", "runs", machine.run_folder, "chmod 700 it, or name another")
    if machine.load > _BUSY_LOAD * machine.cores:
        yield Finding("note", "processor", f"{machine.load:.0f} processes want {machine.cores} "
                      "cores: frames wait", "top; stop what is not needed")  # fmt: skip
    else:
        yield Finding("ok", "processor", f"{machine.cores} cores, load {machine.load:.1f}")
