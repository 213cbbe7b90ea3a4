"""What waits for one viewer: the newest picture and the newest note of each kind, nothing else.

A viewer acknowledges each picture it has drawn. Without that, several seconds of old pictures
pile up in the kernel's socket buffers before a slow viewer is noticed.
"""

from __future__ import annotations

from heel.services.web.frames import ViewFrame


class ViewerQueue:
    """Newest-wins slots of one viewer.

    Args:
        max_in_flight: pictures sent but not acknowledged at most.
    """

    def __init__(self, max_in_flight: int = 2) -> None:
        self._max_in_flight = max_in_flight
        self._frame: ViewFrame | None = None
        self._notes: dict[str, str] = {}
        self._sent = 0
        self._acknowledged = 0
        self.dropped = 0
        """Pictures that gave way to newer ones because the viewer was behind."""

    def offer_frame(self, frame: ViewFrame) -> None:
        """Put a picture in, in place of one that still waits."""
        if self._frame is not None:
            self.dropped += 1
        self._frame = frame

    def offer_note(self, kind: str, text: str) -> None:
        """Put a text in, in place of one of its kind that still waits."""
        self._notes[kind] = text

    def take_note(self) -> str | None:
        """The text to send now, if there is one."""
        if not self._notes:
            return None
        return self._notes.pop(next(iter(self._notes)))

    def take_frame(self) -> tuple[int, ViewFrame] | None:
        """The picture to send now with its number, None if none waits or the viewer is behind."""
        if self._frame is None or self._sent - self._acknowledged >= self._max_in_flight:
            return None
        frame, self._frame = self._frame, None
        self._sent += 1
        return self._sent, frame

    def acknowledge(self, number: int) -> bool:
        """Note that the viewer has drawn picture `number`; False if it was never sent."""
        if not 0 < number <= self._sent:
            return False
        self._acknowledged = max(self._acknowledged, number)
        return True
