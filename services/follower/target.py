"""Who is chosen, by whom the id was given out, and what is waited for."""

from __future__ import annotations

from collections.abc import Iterable

from schemas import HeelError, Target, TargetRequest, Track, Tracks
from services.follower.choosing import Imprinting, at_point, nearest
from services.follower.people import Person
from services.follower.settings import FollowerSettings


class TargetError(HeelError):
    """A target that cannot be chosen."""


class NobodyThereError(TargetError):
    """A point at which nobody is tracked."""


class TargetChoice:
    """Keeps the target; a chosen id changes only on request or when its tracker is replaced."""

    def __init__(self, settings: FollowerSettings) -> None:
        self._imprinting = Imprinting(
            settings.imprint_s, settings.imprint_distance_m, settings.imprint_half_angle_rad
        )
        self._waiting = {
            "nearest": "waiting for the first person",
            "imprint": f"waiting for one person to stand before the robot "
            f"for {settings.imprint_s:g} s",
            "none": "no target",
        }
        self._tracker: str | None = None
        self.target = Target(seq=0, mode=settings.target, reason=self._waiting[settings.target])

    def tracker_is(self, tracker: str) -> bool:
        """Note who tracks now; True if that is another one than before."""
        replaced = self._tracker not in (None, tracker)
        self._tracker = tracker
        if replaced:
            self._imprinting.reset()
            if self.target.track_id is not None:
                self._set("none", None, "the tracker was replaced: choose again")
        return replaced

    def request(self, request: TargetRequest, tracks: Tracks | None) -> bool:
        """Choose or clear; returns whether another person, or nobody, is chosen now.

        Raises:
            TargetError: nobody is there, or the id is unknown or another tracker's.
        """
        before = self.target.track_id
        if request.mode == "none":
            self._set("none", None, "cleared")
        elif request.mode == "imprint":
            self._imprinting.reset()
            self._set("imprint", None, self._waiting["imprint"])
        else:
            track = self._requested(request, tracks)
            if track is None and request.mode != "nearest":
                raise _not_found(request)
            reason = self._waiting["nearest"] if track is None else "chosen"
            self._set(request.mode, None if track is None else track.id, reason)
        return self.target.track_id is None or self.target.track_id != before

    def settle(self, tracks: Tracks, seen: Iterable[Person], t_s: float) -> bool:
        """Pick who is waited for, if there; returns whether somebody was picked.

        Args:
            tracks: the newest frame.
            seen: people seen well in it, with their places.
            t_s: its time.
        """
        if self.target.track_id is not None:
            return False
        if self.target.mode == "nearest" and (first := nearest(tracks)) is not None:
            self._set("nearest", first.id, "the nearest person")
        elif self.target.mode == "imprint":
            found = self._imprinting.update(seen, t_s)
            if found is None:
                return False
            self._set("imprint", found, "stood before the robot")
        return self.target.track_id is not None

    def interrupted(self) -> None:
        """Nothing fresh is seen: whoever stood before the robot has to do so anew."""
        self._imprinting.reset()

    def _requested(self, request: TargetRequest, tracks: Tracks | None) -> Track | None:
        if tracks is None:
            return None
        if request.mode == "nearest":
            return nearest(tracks)
        if request.mode == "point" and request.x_px is not None and request.y_px is not None:
            return at_point(tracks, request.x_px, request.y_px)
        if request.tracker not in (None, self._tracker):
            raise TargetError(
                f"id {request.track_id} was given out by {request.tracker}, but {self._tracker} "
                "is tracking now: choose again"
            )
        return next((track for track in tracks.tracks if track.id == request.track_id), None)

    def _set(self, mode: str, track_id: int | None, reason: str) -> None:
        self.target = Target.model_validate(
            {"seq": self.target.seq + 1, "mode": mode, "track_id": track_id, "reason": reason,
             "tracker": self._tracker if track_id is not None else None}
        )  # fmt: skip


def _not_found(request: TargetRequest) -> TargetError:
    if request.mode == "id":
        return TargetError(
            f"nobody has id {request.track_id} now: see `heel status` for the ids in sight"
        )
    return NobodyThereError(
        f"nobody is tracked at ({request.x_px:g}, {request.y_px:g}): click on a person's box, or "
        "again when the person there has got one"
    )
