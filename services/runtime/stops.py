"""Whether the emergency stop holds, as the parts that obey it say: drive and follower.

Each holds it by itself, so that either alone may know of it, and one may have missed what the other
has heard.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

STOP_DETAIL = "estop"
"""Detail of the health of a part that obeys the emergency stop: whether it holds there."""
HOLDS, HOLDS_NOT = "yes", "no"
"""Its two values."""


@dataclass(frozen=True, slots=True)
class Stops:
    """What drive and follower say at this moment; None: nothing."""

    drive: bool | None = None
    follower: bool | None = None

    @property
    def engaged(self) -> bool | None:
        """Whether it holds in any part; None: nobody says."""
        said = [one for one in (self.drive, self.follower) if one is not None]
        return any(said) if said else None

    @property
    def differ(self) -> bool:
        """Whether one part stands and the other does not: one of them has missed something."""
        return None not in (self.drive, self.follower) and self.drive != self.follower

    @property
    def short(self) -> str:
        """For a column of a table: `STOP`, `drive only`, `no`, `-`."""
        if self.differ:
            return f"{'drive' if self.drive else 'follower'} only"
        return {True: "STOP", False: "no", None: "-"}[self.engaged]

    @property
    def words(self) -> str:
        """For a user; empty: it does not hold, or nobody says."""
        if not self.engaged:
            return ""
        if self.differ:
            stands, goes_on = ("drive", "follower") if self.drive else ("follower", "drive")
            return (
                f"EMERGENCY STOP: the {stands} holds it, the {goes_on} does not: `heel stop` stops "
                "both, `heel resume` releases both"
            )
        if self.follower is None:
            return "EMERGENCY STOP: the drive holds it; no follower is heard"
        if self.drive is None:
            return "EMERGENCY STOP: the follower holds it; no drive is heard"
        return "EMERGENCY STOP: drive and follower hold it; `heel resume` releases it"

    def as_json(self) -> dict[str, Any]:
        """The same for machines."""
        return {
            "estop": self.engaged, "estop_of": {"drive": self.drive, "follower": self.follower},
        }  # fmt: skip
