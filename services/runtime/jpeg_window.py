"""How many JPEGs may be on their way to other hosts: what keeps a slow link from filling up.

A link that is full of pictures delays everything else on it, and a picture of which a part finds a
queue full was sent for nothing (measured at 20 Mbit/s: 20 Mbit/s of pieces, no whole frame). So
receivers say which frame has arrived, with the `Progress` of lossless runs, and a frame goes out
only while the slowest of them has room: for two while they arrive soon, else for one. A link that
is slow or lossy then costs frames, and nothing waits anywhere but at the camera, where the newest
frame is.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

WINDOW_FRAMES = 2
"""Frames on their way to the slowest receiver: one that passes the link while the word of the
other's arrival comes back. Three would be no more frames/s at 20 Mbit/s, and each older."""
LATE_S = 0.14
"""Time from sending to the word of arrival above which one frame alone is on its way: whatever else
crosses the link waits as long behind pictures, and commands are to be no older than 0.15 s. With
two frames for two receivers at 20 Mbit/s (0.26 s) commands were 0.23 s old."""
_EARLY_S = 0.5 * LATE_S
"""Below this time of a frame alone, two are on their way again: two take no more than twice as
long."""
PATIENCE_S = 1.0
"""A receiver that says nothing for so long is sent another frame: its word may be lost, as words
are that find a queue full. Chosen by hand."""
FORGET_S = 3.0
"""One that says nothing for so long is gone, as with a session's lease."""
_MOST_RECEIVERS = 16
"""Receivers that are waited for; chosen by hand, a camera has one or two on other hosts."""
_REMEMBERED = 64
"""Frames sent that are remembered; whoever is further behind has missed them."""


@dataclass(slots=True)
class _Receiver:
    seq: int
    """Newest frame that has arrived."""
    heard_s: float
    """When it last said something new, or was let off."""
    alive_s: float
    """When it last said something new."""
    room: int = WINDOW_FRAMES
    """Frames that may be on their way to it."""

    def arrived(self, seq: int, took_s: float, now_s: float) -> None:
        """Take note of the word of an arrival."""
        self.seq, self.heard_s, self.alive_s = seq, now_s, now_s
        if took_s > LATE_S:
            self.room = 1
        elif took_s < _EARLY_S:
            self.room = WINDOW_FRAMES


class JpegWindow:
    """Decides frame by frame; times are monotonic."""

    def __init__(self) -> None:
        self._epoch = -1
        self._sent: deque[tuple[int, float]] = deque(maxlen=_REMEMBERED)
        self._receivers: dict[str, _Receiver] = {}

    def heard(self, receiver: str, epoch: int, seq: int, now_s: float) -> None:
        """A receiver says that a frame has arrived; old news and frames never sent are ignored."""
        if epoch != self._epoch or not self._sent or seq > self._sent[-1][0]:
            return
        known = self._receivers.get(receiver)
        if known is None:
            if len(self._receivers) < _MOST_RECEIVERS:
                self._receivers[receiver] = _Receiver(seq, now_s, now_s)
        elif seq > known.seq:
            sent_s = next((at_s for sent, at_s in self._sent if sent >= seq), now_s)
            known.arrived(seq, now_s - sent_s, now_s)

    def may_send(self, epoch: int, now_s: float) -> bool:
        """Whether a frame may go out; with nobody known it may."""
        if epoch != self._epoch:
            self._epoch = epoch
            self._sent.clear()
            self._receivers.clear()
        self._receivers = {
            name: one for name, one in self._receivers.items() if now_s - one.alive_s < FORGET_S
        }
        full = [one for one in self._receivers.values() if self._on_the_way(one) >= one.room]
        if any(now_s - one.heard_s < PATIENCE_S for one in full):
            return False
        for one in full:
            one.heard_s = now_s
        return True

    def sent(self, seq: int, now_s: float) -> None:
        """A frame went out."""
        for one in self._receivers.values():
            if self._on_the_way(one) == 0:
                # Silent until now because there was nothing to tell.
                one.heard_s = one.alive_s = now_s
        self._sent.append((seq, now_s))

    def _on_the_way(self, receiver: _Receiver) -> int:
        return sum(seq > receiver.seq for seq, _ in self._sent)
