"""Which messages of a stream are new, by their numbers: what is missing, repeated or made up.

Numbers count within a *line*: frames within an epoch of their camera, commands and measurements
within one start of their producer. One message alone can neither lead a line away nor end it.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from dataclasses import dataclass

RESUME_S = 0.5
"""A line that is silent this long may be followed by another."""
_MOST_PER_S = 1000.0
"""The greatest frame rate that a camera may state: no producer counts faster."""
_AT_ONCE = 64
"""Messages that may wait together and come at once: the largest ring of a stream."""
_SMALL_GAP = 8
"""Messages that may be left out without a second thought: waiting for them again takes less than a
second at any rate that is driven by."""
_MOST_CANDIDATES = 16
"""Leaps that may turn out to be a new start; bounds the memory. Chosen by hand."""
_MOST_FORMER = 64
"""Former starts that are remembered; bounds the memory. Chosen by hand."""
_MOST_MISSING = 2**63 - 1
"""Greatest count that a message of health can hold."""

Name = int | str


@dataclass(slots=True)
class _Line:
    """A place in the count."""

    name: Name
    seq: int
    heard_s: float
    proven: bool = False
    """Whether a second message has gone on from the first."""

    def leads_to(self, seq: int, now_s: float) -> bool:
        """Whether a producer can have come so far by now."""
        most = _AT_ONCE + _MOST_PER_S * max(0.0, now_s - self.heard_s)
        return 0 < seq - self.seq <= most


class SequenceWatch:
    """Registers the numbers of one stream.

    A line goes on with any greater number that a producer can have reached since. Whatever else
    comes is a candidate: it is followed once a second message goes on from it and the present line
    is silent or was itself no more than one message. A line that was left comes back only ahead of
    where it was left, so that a recording of it does not.

    Args:
        live: False where nothing may be lost: then another line is followed at once.
    """

    def __init__(self, live: bool = True) -> None:
        self._live = live
        self._line: _Line | None = None
        self._before: _Line | None = None
        self._former: deque[_Line] = deque(maxlen=_MOST_FORMER)
        self._candidates: OrderedDict[Name, _Line] = OrderedDict()
        self.missing = 0
        """Numbers that were left out."""
        self.refusal = ""
        """Why the last message was not new."""

    @property
    def line(self) -> Name | None:
        """Within what is counted now; None before the first message."""
        return None if self._line is None else self._line.name

    @property
    def seq(self) -> int:
        """The newest number; -1 before the first message."""
        return -1 if self._line is None else self._line.seq

    def fresh(self, name: Name, seq: int, now_s: float, replaced: bool = False) -> bool:
        """Register a message; False if it is not to be used.

        Args:
            name: the line it says it belongs to.
            seq: its number.
            now_s: monotonic time of its arrival.
            replaced: whether its producer has just taken over from one that was silent.
        """
        line = self._line
        if line is None:
            self._line = _Line(name, seq, now_s)
            return True
        if name == line.name and line.leads_to(seq, now_s):
            self._go_on(line, seq, now_s)
            return True
        if self._go_back(line, name, seq, now_s, replaced):
            return True
        if self.was_there(name, seq):
            self.refusal = f"seq {seq} was there before, or comes too late"
            return False
        if name != line.name and (replaced or not self._live):
            self._leave(_Line(name, seq, now_s))
            return True
        return self._consider(line, _Line(name, seq, now_s))

    def was_there(self, name: Name, seq: int) -> bool:
        """Whether a message is known to be an old one; takes no note of it."""
        lines = [place.seq for place in self._former if place.name == name]
        if self._line is not None and name == self._line.name and self._line.proven:
            lines.append(self._line.seq)
        return bool(lines) and seq <= min(lines)

    def _go_on(self, line: _Line, seq: int, now_s: float) -> None:
        gap = seq - line.seq - 1
        # What comes next from within a large gap shows that the leap was another sender's.
        self._before = line if gap > _SMALL_GAP else None
        self.missing = min(self.missing + gap, _MOST_MISSING)
        self._line = _Line(line.name, seq, now_s, proven=True)
        self._candidates.clear()

    def _go_back(self, line: _Line, name: Name, seq: int, now_s: float, replaced: bool) -> bool:
        """Return to where the count was before it leapt away, if the message belongs there."""
        before = self._before
        if before is not None and name == before.name and before.leads_to(seq, now_s):
            if seq == line.seq:
                return False
            self.missing -= line.seq - before.seq - 1
            self._go_on(before, seq, now_s)
            self._before = None
            return True
        if line.proven and now_s - line.heard_s <= RESUME_S and not replaced:
            return False
        place = next((p for p in self._former if p.name == name and p.leads_to(seq, now_s)), None)
        if place is None:
            return False
        self._former.remove(place)
        self._leave(_Line(name, seq, now_s, proven=True))
        return True

    def _consider(self, line: _Line, new: _Line) -> bool:
        candidate = self._candidates.pop(new.name, None)
        self._candidates[new.name] = new
        while len(self._candidates) > _MOST_CANDIDATES:
            self._candidates.popitem(last=False)
        goes_on = candidate is not None and candidate.leads_to(new.seq, new.heard_s)
        if goes_on and (not line.proven or new.heard_s - line.heard_s > RESUME_S):
            new.proven = True
            self._leave(new)
            return True
        self.refusal = (
            f"seq {new.seq} does not follow {line.seq}"
            if new.name == line.name
            else f"seq {new.seq} counts within {new.name}, while {line.name} is in use"
        )
        return False

    def _leave(self, new: _Line) -> None:
        # A single message that nothing followed must not keep its line's true messages out.
        if self._line is not None and self._line.proven:
            self._former.append(self._line)
        self._line, self._before = new, None
        self._candidates.clear()
