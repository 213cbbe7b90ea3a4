"""Two hosts on one machine, joined by a link with a delay, a rate, a queue and losses.

A host is a network namespace with a boot id and shared memory of its own. The link is two TAP
devices, one in each namespace, and a process that passes packets on: kernels need not have netem.
TCP over it is the kernel's own. Wants root, iproute2 and /dev/net/tun.

Run as a process: python -m benchmarks.links.hosts MODEL_JSON (NAMESPACE ADDRESS) twice
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import json
import os
import random
import secrets
import selectors
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.common import REPOSITORY
from heel.services.runtime.process import die_with_parent

_DEVICE = "heel0"
_MTU_BYTES = 1500
_TUNSETIFF = 0x400454CA
"""Of Linux, linux/if_tun.h."""
_TAP_WITHOUT_INFO = 0x0002 | 0x1000
_CLONE_NEWNET = 0x40000000
_BOOT_ID = "/proc/sys/kernel/random/boot_id"
_SHARED_MEMORY_BYTES = 256 << 20
_PACKETS_AT_ONCE = 64
_LONGEST_WAIT_S = 0.2
_IP_TIMEOUT_S = 60.0


@dataclass(frozen=True)
class LinkModel:
    """What a link does to every packet, the same in both directions.

    Attributes:
        delay_ms: from one end to the other.
        loss: share of the packets that never arrive, 0 to 1.
        rate_mbit: what passes in a second; 0 is no limit.
        queue_ms: packets that would wait longer for the rate are dropped, as a full buffer does.
    """

    delay_ms: float = 0.0
    loss: float = 0.0
    rate_mbit: float = 0.0
    queue_ms: float = 250.0


@dataclass(frozen=True)
class Host:
    """One end of the link."""

    namespace: str
    address: str
    boot_id: Path
    """A file with what the host takes for its boot id."""

    def command(self, *words: str) -> list[str]:
        """What runs these words on this host."""
        shell = (
            f"mount -t tmpfs -o size={_SHARED_MEMORY_BYTES} tmpfs /dev/shm && "
            f'mount --bind {self.boot_id} {_BOOT_ID} && exec "$@"'
        )
        # `ip netns exec` gives the process a mount namespace of its own, too.
        return ["ip", "netns", "exec", self.namespace, "sh", "-c", shell, "sh", *words]


class Hosts:
    """The two hosts and the process between them."""

    def __init__(self, here: Host, there: Host, emulator: subprocess.Popen[str]) -> None:
        self.here, self.there = here, there
        self._emulator = emulator

    def change(self, model: LinkModel) -> None:
        """Make the link another one."""
        assert self._emulator.stdin is not None
        self._emulator.stdin.write(json.dumps(asdict(model)) + "\n")
        self._emulator.stdin.flush()

    def passed_bytes(self) -> tuple[int, int]:
        """What has left the link so far at the end there, and at the end here."""
        return _received(self.there.namespace), _received(self.here.namespace)


@contextmanager
def two_hosts(model: LinkModel) -> Iterator[Hosts]:
    """Make both hosts, run the link, and take everything away again.

    Raises:
        PermissionError: this process may not make namespaces or TAP devices.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="heel-hosts-")))
        subnet = f"10.214.{secrets.randbelow(256)}"
        hosts = [
            _make_host(f"heel{secrets.token_hex(3)}", f"{subnet}.{number}", folder, stack)
            for number in (1, 2)
        ]
        words = [word for host in hosts for word in (host.namespace, host.address)]
        emulator = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.links.hosts", json.dumps(asdict(model)), *words],
            cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        stack.callback(_end, emulator)
        assert emulator.stdout is not None
        if emulator.stdout.readline().strip() != "up":
            raise PermissionError("no TAP devices: /dev/net/tun and CAP_NET_ADMIN are needed")
        yield Hosts(hosts[0], hosts[1], emulator)


def _end(emulator: subprocess.Popen[str]) -> None:
    emulator.kill()
    emulator.communicate(timeout=_IP_TIMEOUT_S)


def _make_host(namespace: str, address: str, folder: Path, stack: ExitStack) -> Host:
    if shutil.which("ip") is None or not _ip("netns", "add", namespace):
        raise PermissionError("no network namespaces: root and iproute2 are needed")
    stack.callback(_ip, "netns", "del", namespace)
    _ip("-n", namespace, "link", "set", "lo", "up")
    # The one that makes least of a link that loses packets, whatever this kernel's own is.
    _ip("netns", "exec", namespace, "sh", "-c",
        "echo reno > /proc/sys/net/ipv4/tcp_congestion_control")  # fmt: skip
    boot_id = folder / namespace
    boot_id.write_text(f"{secrets.token_hex(4)}-0000-4000-8000-{secrets.token_hex(6)}\n", "ascii")
    return Host(namespace, address, boot_id)


def _ip(*words: str) -> bool:
    done = subprocess.run(["ip", *words], capture_output=True, timeout=_IP_TIMEOUT_S, check=False)
    return done.returncode == 0


def _received(namespace: str) -> int:
    shown = subprocess.run(
        ["ip", "netns", "exec", namespace, "cat", "/proc/net/dev"],
        capture_output=True, text=True, timeout=_IP_TIMEOUT_S, check=True,
    ).stdout  # fmt: skip
    (line,) = (line for line in shown.splitlines() if line.strip().startswith(_DEVICE))
    return int(line.partition(":")[2].split()[0])


# --- The process between the two


class _Direction:
    """Packets on their way to one end, in order."""

    def __init__(self, model: LinkModel, seed: int) -> None:
        self.model = model
        self._random = random.Random(seed)
        self._free_s = 0.0

    def leaves_s(self, now_s: float, size: int) -> float | None:
        """When a packet comes out at the other end; None if it is lost."""
        model = self.model
        if self._random.random() < model.loss:
            return None
        sent_s = now_s
        if model.rate_mbit:
            begins_s = max(self._free_s, now_s)
            if begins_s - now_s > model.queue_ms / 1e3:
                return None
            sent_s = self._free_s = begins_s + size * 8 / (model.rate_mbit * 1e6)
        return sent_s + model.delay_ms / 1e3


def _tap(namespace: str, address: str) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    own = os.open("/proc/self/ns/net", os.O_RDONLY)
    other = os.open(f"/var/run/netns/{namespace}", os.O_RDONLY)
    _enter(libc, other)
    try:
        device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        flags = struct.pack("16sH22x", _DEVICE.encode(), _TAP_WITHOUT_INFO)
        fcntl.ioctl(device, _TUNSETIFF, flags)
    finally:
        _enter(libc, own)
        os.close(own)
        os.close(other)
    for words in (f"link set {_DEVICE} mtu {_MTU_BYTES}", f"addr add {address}/30 dev {_DEVICE}",
                  f"link set {_DEVICE} up"):  # fmt: skip
        subprocess.run(["ip", "-n", namespace, *words.split()], check=True, timeout=_IP_TIMEOUT_S)
    return device


def _enter(libc: ctypes.CDLL, namespace: int) -> None:
    if libc.setns(namespace, _CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns")


def _pass_on(devices: tuple[int, int], model: LinkModel) -> None:
    """Pass packets between two devices until standard input ends; a line there is a new model."""
    directions = [_Direction(model, seed) for seed in (1, 2)]
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    with selectors.DefaultSelector() as selector:
        for side, device in enumerate(devices):
            selector.register(device, selectors.EVENT_READ, side)
        selector.register(sys.stdin, selectors.EVENT_READ, None)
        while True:
            wait_s = waiting[0][0] - time.monotonic() if waiting else _LONGEST_WAIT_S
            for key, _ in selector.select(min(max(wait_s, 0.0), _LONGEST_WAIT_S)):
                if key.data is None:
                    if not (line := sys.stdin.readline()):
                        return
                    for direction in directions:
                        direction.model = LinkModel(**json.loads(line))
                    continue
                for packet in _packets(devices[key.data]):
                    now_s = time.monotonic()
                    leaves_s = directions[key.data].leaves_s(now_s, len(packet))
                    if leaves_s is not None:
                        count += 1
                        heapq.heappush(waiting, (leaves_s, count, 1 - key.data, packet))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, side, packet = heapq.heappop(waiting)
                try:
                    os.write(devices[side], packet)
                except OSError:
                    continue  # a device with a full queue drops, and so does the link


def _packets(device: int) -> Iterator[bytes]:
    for _ in range(_PACKETS_AT_ONCE):
        try:
            yield os.read(device, 1 << 16)
        except BlockingIOError:
            return


def _main() -> None:
    die_with_parent()
    model = LinkModel(**json.loads(sys.argv[1]))
    first, second = (_tap(sys.argv[k], sys.argv[k + 1]) for k in (2, 4))
    print("up", flush=True)
    _pass_on((first, second), model)


if __name__ == "__main__":
    _main()
