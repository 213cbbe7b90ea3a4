"""What makes the last seconds worth a file: found in the messages themselves. Pure."""

from __future__ import annotations

from heel.schemas import (
    DriveState,
    EStop,
    FollowState,
    Message,
    MessageError,
    TrackEvent,
    decode,
)
from heel.services.recordings.wire import WireMessage

_KINDS: dict[str, type[Message]] = {
    kind.encoding(): kind for kind in (FollowState, DriveState, EStop, TrackEvent)
}


class EventWatch:
    """Tells of the moments at which something begins that a user may ask about afterwards."""

    def __init__(self) -> None:
        self._stopped: dict[str, bool] = {}
        """Whether an emergency stop holds, by the key that says so."""
        self._engagement: str | None = None
        self._unsure = False
        self._target_id: int | None = None

    def take(self, message: WireMessage) -> str | None:
        """What has just begun, in one word for a file's name; None for most messages."""
        kind = _KINDS.get(message.encoding)
        if kind is None:
            return None
        try:
            said = decode(kind, message.payload, message.encoding)
        except MessageError:
            # The services that work with it say so.
            return None
        match said:
            case FollowState():
                return self._follower(message.key, said)
            case DriveState():
                return self._stop(message.key, said.estop)
            case EStop():
                return self._pressed(said)
            case TrackEvent(kind="contact") if self._target_id in said.ids:
                return "contact"
        return None

    def _follower(self, key: str, said: FollowState) -> str | None:
        self._target_id = said.target.track_id
        unsure = said.state == "unsure"
        begun = unsure and not self._unsure
        self._unsure = unsure
        return self._stop(key, said.estop) or ("unsure" if begun else None)

    def _stop(self, key: str, estop: bool) -> str | None:
        begun = estop and not self._stopped.get(key, False)
        self._stopped[key] = estop
        return "estop" if begun else None

    def _pressed(self, said: EStop) -> str | None:
        # It is said again until the drive confirms.
        begun = said.engaged and said.id != self._engagement
        self._engagement = said.id if said.engaged else None
        return "estop" if begun else None
