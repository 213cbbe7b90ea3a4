"""Shared memory for frames, as much as the frames in flight need."""

from __future__ import annotations

import logging

import zenoh
from zenoh.shm import GarbageCollect, JustAlloc, ShmProvider, ZShmMut

from heel.services.runtime.shared_memory import OWN

_BOOKKEEPING_BYTES = 4096
"""What Zenoh needs of a pool for itself; without it the last buffer is missing (measured)."""
LIVE_FRAMES = 6
"""Frames that two receivers can hold between them, each at work on one with two waiting."""
MOST_LIVE_FRAMES = 30
"""Frames that receivers can hold, one of which wants all and is held up: more than a second at 25 a
second. Chosen by hand. A recorder that got no processor for 0.4 s had all six above; further ones
went through sockets, which took 0.2 s of them and lost the rest (measured)."""


class FrameMemory:
    """Pools of equal buffers, made to measure of the first frame.

    Zenoh's own pool has room for two 1080p frames; the third goes through the sockets, copied six
    times on its way through the router (7.5 s of processor time for 100 frames in place of 6.8).
    """

    def __init__(self, frames: int, log: logging.Logger, most_frames: int = 0) -> None:
        """Take no memory yet.

        Args:
            frames: buffers in the pool: frames that are sent and not read yet.
            log: told if there is no shared memory to be had.
            most_frames: buffers of all pools of one size: while receivers hold all there are,
                pools as large as the first are added up to that.
        """
        self._frames = frames
        self._most_pools = max(1, most_frames // frames)
        self._log = log
        self._buffer_bytes = 0
        self._pools: list[ShmProvider] = []
        self._outgrown: list[ShmProvider] = []

    def make_room(self, frame_bytes: int) -> None:
        """Take the memory for frames of this size; locking it takes 1 ms per MB.

        Outgrown pools stay: frames in them that are not opened yet would be lost with them
        (measured). Doubling keeps all of them together below twice the newest.
        """
        self._buffer_bytes = max(frame_bytes, 2 * self._buffer_bytes)
        self._outgrown += self._pools
        self._pools = []
        self._add_pool()

    def hold(self, frame: bytes) -> bytes | ZShmMut:
        """The frame in shared memory, or the frame itself while there is no room for it."""
        if len(frame) > self._buffer_bytes:
            self.make_room(len(frame))
        held = self._allocated(len(frame))
        if held is None and 0 < len(self._pools) < self._most_pools and self._add_pool():
            self._log.info(
                "a receiver is behind: shared memory for %d frames by now",
                len(self._pools) * self._frames,
            )
            held = self._allocated(len(frame))
        if held is None:
            return frame
        held[:] = frame
        return held

    def _add_pool(self) -> bool:
        """One more pool; False if there is no memory, and then none is asked for again."""
        size = self._frames * self._buffer_bytes + _BOOKKEEPING_BYTES
        try:
            with OWN.claiming():
                self._pools.append(ShmProvider.default_backend(size))
        except zenoh.ZError as error:
            self._most_pools = len(self._pools)
            self._log.warning(
                "no %d bytes of shared memory for frames: they go through sockets; raise the limit "
                "on locked memory or the size of /dev/shm (%s)",
                size, " ".join(str(error).split())[:200],
            )  # fmt: skip
            return False
        return True

    def _allocated(self, size: int) -> ZShmMut | None:
        for pool in self._pools:
            try:
                return pool.alloc(size, GarbageCollect(JustAlloc()))
            except zenoh.ZError:
                continue
        return None
