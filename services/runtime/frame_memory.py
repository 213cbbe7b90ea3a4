"""Shared memory for frames, as much as the frames in flight need."""

from __future__ import annotations

import logging

import zenoh
from zenoh.shm import GarbageCollect, JustAlloc, ShmProvider, ZShmMut

from heel.services.runtime.shared_memory import OWN

_BOOKKEEPING_BYTES = 4096
"""What Zenoh needs of a pool for itself; without it the last buffer is missing (measured)."""


class FrameMemory:
    """A pool of equal buffers, made to measure of the first frame.

    Zenoh's own pool has room for two 1080p frames; the third goes through the sockets, copied six
    times on its way through the router (7.5 s of processor time for 100 frames in place of 6.8).
    """

    def __init__(self, frames: int, log: logging.Logger) -> None:
        """Take no memory yet.

        Args:
            frames: buffers in the pool: frames that are sent and not read yet.
            log: told if there is no shared memory to be had.
        """
        self._frames = frames
        self._log = log
        self._buffer_bytes = 0
        self._pools: list[ShmProvider] = []

    def make_room(self, frame_bytes: int) -> None:
        """Take the memory for frames of this size; locking it takes 1 ms per MB.

        Outgrown pools stay: frames in them that are not opened yet would be lost with them
        (measured). Doubling keeps all of them together below twice the newest.
        """
        self._buffer_bytes = max(frame_bytes, 2 * self._buffer_bytes)
        size = self._frames * self._buffer_bytes + _BOOKKEEPING_BYTES
        try:
            with OWN.claiming():
                self._pools.append(ShmProvider.default_backend(size))
        except zenoh.ZError as error:
            self._log.warning(
                "no %d bytes of shared memory for frames: they go through sockets; raise the limit "
                "on locked memory or the size of /dev/shm (%s)",
                size, " ".join(str(error).split())[:200],
            )  # fmt: skip

    def hold(self, frame: bytes) -> bytes | ZShmMut:
        """The frame in shared memory, or the frame itself while there is no room for it."""
        if len(frame) > self._buffer_bytes:
            self.make_room(len(frame))
        if not self._pools:
            return frame
        try:
            held = self._pools[-1].alloc(len(frame), GarbageCollect(JustAlloc()))
        except zenoh.ZError:
            return frame
        held[:] = frame
        return held
