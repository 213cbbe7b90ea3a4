"""`heel systemd`: units that start a robot's services at boot, watch them and start them again."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from heel.schemas.errors import HeelError, SettingsError
from heel.services.run.bounds import MOST_STARTS, WITHIN_S

TARGET = "heel.target"
STACK = ("capture", "detector", "tracker", "follower", "drive", "web")
"""Services of a robot whose settings name none."""
RULES = "70-heel.rules"

_WATCHDOG_S = 2
"""Seconds without a sign of life after which a process is killed. The robot stands by then, and is
to go on within five seconds, of which starting takes two; chosen by hand. How long a loop may take
for a turn the service itself knows (`heel.services.runtime.notify`)."""
_FIRST = ("router", "follower", "drive")
"""The stop and the wheels: they come first where the processor or memory is short."""
_MEMORY_MB = {"detector": 1500}
"""Most memory of a service: several times what it takes, so that only a leak reaches it; chosen by
hand, for networks."""
_MEMORY_ELSE_MB = 700
"""The same for all others; chosen by hand."""
_DEVICES = {"capture": "video", "drive": "dialout"}
"""Services that open devices, and the group that may, in Debian and its kin."""

_UNIT = """\
# Written by `heel systemd`; your changes belong in a drop-in: systemctl{user} edit {name}
[Unit]
Description=Heel: {service}
PartOf={target}
{order}# A service that fails again and again stays down, and the robot stands.
StartLimitIntervalSec={within_s:g}
StartLimitBurst={most_starts}

[Service]
Type=notify
ExecStart={command}
Environment=PYTHONUNBUFFERED=1
EnvironmentFile=-{environment_file}
{place}# Silent at once when the process is frozen, a while later when its loop hangs. Such a
# process answers no other signal.
WatchdogSec={watchdog_s}
WatchdogSignal=SIGKILL
TimeoutStartSec=60
TimeoutStopSec=5
KillMode=mixed
Restart=on-failure
RestartSec=0.2
# Wrong settings are as wrong the next time.
RestartPreventExitStatus=2
# Zenoh locks its shared memory.
LimitMEMLOCK=infinity
MemoryMax={memory_mb}M
CPUWeight={cpu_weight}
{hardening}"""

_TARGET = """\
[Unit]
Description=Heel: a robot that follows a person
Wants={names}

[Install]
WantedBy={wanted_by}
"""

_HARDENING = """\
NoNewPrivileges=yes
LockPersonality=yes
RestrictSUIDSGID=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
SystemCallArchitectures=native
UMask=0077
"""
_SYSTEM_HARDENING = """\
CapabilityBoundingSet=
ProtectSystem=strict
ProtectHome=read-only
ProtectClock=yes
ProtectControlGroups=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
PrivateTmp=yes
RestrictNamespaces=yes
RestrictRealtime=yes
SystemCallFilter=@system-service
"""
"""What only the system's own manager may do. Never PrivateIPC: /dev/shm is one for all."""

_SYSTEM_PLACE = """\
User={account}
Group={account}
{groups}RuntimeDirectory=heel
RuntimeDirectoryMode=0700
RuntimeDirectoryPreserve=yes
Environment=HEEL_RUNTIME_DIR=/run/heel HEEL_MODELS=/var/lib/heel/models
"""

_STATE = """\
# What outlives a restart of the machine: the emergency stop.
StateDirectory=heel
StateDirectoryMode=0700
Environment=HEEL_STATE_DIR=%S/heel
"""

_SYSUSERS = """\
u {account} - "Heel" /var/lib/heel
"""

_RULES = """\
# Written by `heel systemd --udev`. For one camera or board only, add its ATTRS{{idVendor}} and
# ATTRS{{idProduct}}; `udevadm info --attribute-walk /dev/video0` names them.
ACTION=="remove", GOTO="heel_end"

# A camera that is plugged in later starts its service, and never falls asleep.
SUBSYSTEM=="video4linux", KERNEL=="video[0-9]*", SUBSYSTEMS=="usb", ATTR{{index}}=="0", \
GROUP="video", MODE="0660", TAG+="systemd"{capture}
ACTION=="add", SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", \
ENV{{ID_USB_INTERFACES}}=="*:0e01*:*", TEST=="power/control", ATTR{{power/control}}="on"

# Motor boards on serial lines: ModemManager would talk to them and so turn wheels.
SUBSYSTEM=="tty", KERNEL=="ttyUSB[0-9]*|ttyACM[0-9]*", SUBSYSTEMS=="usb", \
GROUP="dialout", MODE="0660", ENV{{ID_MM_PORT_IGNORE}}="1", TAG+="systemd"{drive}

LABEL="heel_end"
"""


@dataclass(frozen=True)
class Layout:
    """What the units are made for.

    Attributes:
        program: words that start `heel`, without a service.
        services: to be run, without the router.
        router: whether this machine has the robot's router.
        config: settings file of all of them.
        user: for the manager of the user instead of the system's.
        account: user that the system's units run as.
    """

    program: tuple[str, ...]
    services: tuple[str, ...] = STACK
    router: bool = True
    config: Path | None = None
    user: bool = False
    account: str = "heel"

    @property
    def names(self) -> tuple[str, ...]:
        """Every service with a unit."""
        return (*(("router",) if self.router else ()), *self.services)


def units(layout: Layout) -> dict[str, str]:
    """Every file for systemd, by its name."""
    files = {unit_name(service): _unit(service, layout) for service in layout.names}
    files[TARGET] = _TARGET.format(
        names=" ".join(map(unit_name, layout.names)),
        wanted_by="default.target" if layout.user else "multi-user.target",
    )
    if not layout.user:
        files["heel-sysusers.conf"] = _SYSUSERS.format(account=layout.account)
    return files


def unit_name(service: str) -> str:
    """Name of a service's unit."""
    return f"heel-{service}.service"


def _unit(service: str, layout: Layout) -> str:
    router = unit_name("router")
    follows = layout.router and service != "router"
    config = () if layout.config is None else ("--config", str(layout.config))
    first = service in _FIRST
    hardening, place = _HARDENING, ""
    if not layout.user:
        group = _DEVICES.get(service)
        hardening += _SYSTEM_HARDENING + ("" if group else "PrivateDevices=yes\n")
        hardening += "OOMScoreAdjust=-500\n" if first else ""
        groups = f"SupplementaryGroups={group}\n" if group else ""
        place = _SYSTEM_PLACE.format(account=layout.account, groups=groups)
    return _UNIT.format(
        name=unit_name(service), service=service, target=TARGET,
        user=" --user" if layout.user else "",
        # Wants, not Requires: services outlive a router that is started again.
        order=f"Wants={router}\nAfter={router}\n" if follows else "",
        command=" ".join(map(quoted, (*layout.program, service, *config))),
        environment_file="%h/.config/heel/heel.env" if layout.user else "/etc/heel/heel.env",
        place=place + _STATE, watchdog_s=_WATCHDOG_S, within_s=WITHIN_S, most_starts=MOST_STARTS,
        memory_mb=_MEMORY_MB.get(service, _MEMORY_ELSE_MB), cpu_weight=500 if first else 100,
        hardening=hardening,
    )  # fmt: skip


def rules(layout: Layout) -> str:
    """The file for udev: cameras and serial lines on USB."""
    wants = "SYSTEMD_USER_WANTS" if layout.user else "SYSTEMD_WANTS"
    started = {
        service: f', ENV{{{wants}}}+="{unit_name(service)}"' if service in layout.services else ""
        for service in _DEVICES
    }
    return _RULES.format(**started)


def quoted(word: str) -> str:
    """A word of a command line as systemd reads it: nothing in it is expanded.

    Raises:
        SettingsError: no unit can hold it.
    """
    if any(ord(one) < 32 for one in word):
        raise SettingsError(f"{word[:80]!r} cannot stand in a unit: choose a path without it")
    plain = word.replace("\\", "\\\\").replace("%", "%%").replace("$", "$$").replace('"', '\\"')
    return f'"{plain}"' if set(word) & set(" '\";") else plain


def systemd(
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="folder to write to [default: with --user the user's own units]", metavar="DIR"
        ),
    ] = None,
    user: Annotated[
        bool, typer.Option("--user", help="for this user's services instead of the machine's")
    ] = False,
    udev: Annotated[
        bool, typer.Option("--udev", help=f"write {RULES} as well: cameras and motor boards")
    ] = False,
    account: Annotated[
        str, typer.Option(help="user that the machine's services run as", metavar="NAME")
    ] = "heel",
    config: Annotated[
        Path | None,
        typer.Option(help="settings file (TOML) of the services", metavar="FILE"),
    ] = None,
) -> None:  # fmt: skip
    """Write systemd units for the services of `[robot] stack`, with a watchdog each."""
    if folder is None and not user:
        raise SettingsError("name a folder to write to, or say --user for this user's own units")
    layout = _layout(user, account, config)
    folder = folder or _user_units(os.environ)
    files = units(layout) | ({RULES: rules(layout)} if udev else {})
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8")
    except OSError as error:
        raise HeelError(f"{folder}: {error.strerror}: name a folder that may be written") from None
    for line in (f"wrote {len(files)} files to {folder}", *_next_steps(layout, folder, udev)):
        typer.echo(line)


def _layout(user: bool, account: str, config: Path | None) -> Layout:
    from heel.services.runtime.router import is_loopback
    from heel.services.runtime.settings import SERVICES, RobotSettings, load_settings

    loaded = load_settings("robot", RobotSettings, {}, config)
    services = loaded.service.stack or STACK
    unknown = [name for name in services if name not in SERVICES or name == "router"]
    if unknown:
        raise SettingsError(f"robot.stack: {unknown[0]}: no service of Heel's to write a unit for")
    beside = Path(sys.executable).with_name("heel")
    program = (str(beside),) if beside.is_file() else (sys.executable, "-P", "-m", "heel")
    router = any(map(is_loopback, loaded.zenoh.connect))
    absolute = None if config is None else config.absolute()
    return Layout(program, services, router, absolute, user, account)


def _user_units(environment: Mapping[str, str]) -> Path:
    home = environment.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(home) / "systemd" / "user"


def _next_steps(layout: Layout, folder: Path, udev: bool) -> list[str]:
    """What is left to type."""
    steps = ["next:"]
    if layout.user:
        steps += [f"  systemctl --user daemon-reload && systemctl --user enable --now {TARGET}",
                  "  loginctl enable-linger          # start at boot, without a login"]  # fmt: skip
    else:
        steps += [f"  sudo cp {folder}/heel-sysusers.conf /etc/sysusers.d/",
                  "  sudo systemd-sysusers",
                  f"  sudo cp {folder}/heel-*.service {folder}/{TARGET} /etc/systemd/system/",
                  "  sudo systemctl daemon-reload",
                  f"  sudo systemctl enable --now {TARGET}"]  # fmt: skip
    if udev:
        steps += [f"  sudo cp {folder}/{RULES} /etc/udev/rules.d/ && sudo udevadm control --reload "
                  "&& sudo udevadm trigger"]  # fmt: skip
    return steps
