"""Which person is chosen, which tracker gave the id, and what is waited for."""

from __future__ import annotations

from collections.abc import Iterable

from heel.schemas import HeelError, Target, TargetRequest, Track, Tracks
from heel.schemas.base import Point
from heel.services.follower.choosing import Imprinting, Newcomers, at_point, companion, nearest
from heel.services.follower.kept import KeptTarget, Scene
from heel.services.follower.pending import PendingPoint
from heel.services.follower.people import Person
from heel.services.follower.provisional import REOPENED_S, Click, Provisional
from heel.services.follower.settings import FollowerSettings
from heel.services.runtime.streams import FORMER_S

_CHOICE_AGE_S = 0.5
"""A person seen no longer ago can still be chosen: a busy machine is late now and then, and nothing
moves before the tracks are fresh."""
_IMPRINT_DISTANCE_M = 2.5
"""How near a person has to stand to be imprinted on: within speaking distance."""
_IMPRINT_HALF_ANGLE_RAD = 0.35
"""How far off straight ahead at most: 20 degrees; chosen by hand."""


class TargetError(HeelError):
    """A target that cannot be chosen."""


class TargetChoice:
    """Keeps the target; a chosen id changes only on request, or when ids mean other people.

    Attributes:
        target: the person chosen or waited for.
        pending: where a person that was pointed at is looked for, if anywhere.
        provisional: the two that were meant, until one of them is; None once that is clear.
    """

    def __init__(self, settings: FollowerSettings) -> None:
        self._imprinting = Imprinting(
            settings.imprint_s, _IMPRINT_DISTANCE_M, _IMPRINT_HALF_ANGLE_RAD
        )
        self._waiting = {
            "nearest": "waiting for the first person",
            "imprint": f"waiting for one person to stand before the robot "
            f"for {settings.imprint_s:g} s",
            "none": "no target",
        }
        self._max_age_s = max(settings.max_tracks_age_s, _CHOICE_AGE_S)
        self._sure_from = settings.resume_identity_confidence
        self._newcomers = Newcomers()
        self._tracker: str | None = None
        self._scene: Scene | None = None
        self._left: KeptTarget | None = None
        self._seen_ns = 0
        self._interrupted: tuple[KeptTarget, int] | None = None
        """The person followed when another tracker took over, and when, by the camera's clock."""
        self.pending: PendingPoint | None = None
        self.provisional: Provisional | None = None
        self._click: Click | None = None
        self.target = Target(seq=0, mode=settings.target, reason=self._waiting[settings.target])

    def restore(self, kept: KeptTarget) -> None:
        """Follow the person of the follower before, if the first tracks are the same tracker's."""
        self._left = kept

    @property
    def kept(self) -> KeptTarget | None:
        """What the next follower has to know to go on; None if no person is chosen."""
        if self.provisional is not None:
            return None
        if self.target.track_id is None or self._scene is None:
            return self._left
        return KeptTarget(target=self.target, scene=self._scene)

    def source_is(self, tracker: str, tracks: Tracks) -> bool:
        """Note the tracker and its pictures; True if all ids mean other people from now on."""
        scene = (tracks.stream, tracks.epoch, tracks.width, tracks.height)
        before_tracker, before_scene = self._tracker, self._scene
        kept, seen_ns = self.kept, self._seen_ns
        self._tracker, self._scene, self._seen_ns = tracker, scene, tracks.t_capture_ns
        if (before_tracker, before_scene) != (tracker, scene):
            self._newcomers.clear()
        self._newcomers.observe(tracks)
        if before_tracker is None or before_scene is None:
            self._go_on()
            return False
        if before_tracker != tracker:
            self._void("the tracker was replaced: choose again")
            if kept is not None:
                self._interrupted = kept, seen_ns
            elif self._interrupted is not None:
                self._back_again(*self._interrupted)
        elif before_scene[:2] != scene[:2]:
            self._void("the camera was restarted: choose again")
        elif before_scene != scene:
            self._void("the picture has another size: choose again")
        else:
            return False
        return True

    def hand_over(self, tracks: Tracks, tracker: str, track_id: int, words: str) -> None:
        """Call the chosen person by the id that another camera's tracker gave it."""
        self._newcomers.clear()
        self._newcomers.observe(tracks)
        self._tracker, self._seen_ns = tracker, tracks.t_capture_ns
        self._scene = (tracks.stream, tracks.epoch, tracks.width, tracks.height)
        self._set(self.target.mode, track_id, words)

    def request(
        self, request: TargetRequest, tracks: Tracks | None, age_s: float, now_s: float
    ) -> bool:
        """Choose or clear; returns whether another person, or none, is chosen now.

        A point without a track is chosen too, and a person is looked for there.

        Args:
            request: which person is meant.
            tracks: the newest frame, None before the first.
            age_s: how old it is.
            now_s: the present.

        Raises:
            TargetError: the id is unknown or another tracker's, or what is seen is too old to
                choose from.
        """
        before = self.target.track_id
        if request.mode == "id":
            self._requested(request, tracks)  # that no track has this id is the better reason
        if request.mode != "none":
            self._refuse_stale(tracks, age_s)
        if request.mode == "none":
            self._set("none", None, "cleared")
        elif request.mode == "imprint":
            self._imprinting.reset()
            self._set("imprint", None, self._waiting["imprint"])
        else:
            self._choose(request, tracks, now_s)
        return self.target.track_id is None or self.target.track_id != before

    def settle(self, tracks: Tracks, seen: Iterable[Person], t_s: float) -> bool:
        """Pick the person waited for, if there; returns whether another one, or none, is chosen.

        Args:
            tracks: the newest frame.
            seen: people seen well in it, with their places.
            t_s: its time.
        """
        if self.provisional is not None:
            return self._decide(self.provisional, tracks, t_s)
        if self.target.track_id is not None:
            self._reopen(tracks, t_s)
            return False
        if self.pending is not None and (found := self.pending.found(tracks, t_s)) is not None:
            self._choose_track("point", found, tracks, t_s, "found where you pointed",
                               self.pending.place_px)  # fmt: skip
        elif self.target.mode == "nearest" and (first := nearest(tracks)) is not None:
            self._choose_nearest(first, tracks, "the nearest person")
        elif self.target.mode == "imprint":
            stood = self._imprinting.update(seen, t_s)
            if stood is not None:
                self._set("imprint", stood, "stood before the robot")
        return self.target.track_id is not None

    def carry(self, tracks: Tracks, turned_rad: float, focal_px: float) -> None:
        """Let points go along with the picture; arguments as of `CarriedPoint.carry`."""
        for point in (self.pending, self._click):
            if point is not None:
                point.carry(tracks, turned_rad, focal_px)

    def _reopen(self, tracks: Tracks, t_s: float) -> None:
        """Somebody who comes forth from the box soon after the choice may be the one meant."""
        click = self._click
        chosen = next((t for t in tracks.tracks if t.id == self.target.track_id), None)
        if click is None or chosen is None:
            return
        if t_s - click.since_s > REOPENED_S:
            self._click = None
        elif (other := self._newcomers.of(chosen, tracks)) is not None:
            between = Provisional(chosen, other, click.place_px, t_s, parted=True)
            self._leave_open(self.target.mode, between)
        elif self._newcomers.of(chosen, tracks, shown=False) is None and not chosen.missed_frames:
            click.go_along(chosen)

    def _leave_open(self, mode: str, choice: Provisional) -> None:
        self._set(mode, choice.ids[0], choice.words)
        self.provisional = choice

    def _decide(self, open_choice: Provisional, tracks: Tracks, t_s: float) -> bool:
        meant, before, mode = open_choice.decided(tracks, t_s), open_choice.ids[0], self.target.mode
        if meant is None:
            return False
        first, second = open_choice.ids
        if not meant:
            self._set("none", None, f"not clear which of {first} and {second} was meant: choose "
                      "again")  # fmt: skip
            return True
        other = second if meant == first else first
        self._set(mode, meant, f"chosen: the one pointed at, now that {other} is apart")
        return meant != before

    def give_up(self, now_s: float) -> None:
        """Look no longer at a point where no person was found for a while."""
        if self.pending is not None and self.pending.for_s(now_s) <= 0.0:
            self._set("none", None, "nobody found there: click on somebody again")

    def ask_again(self, away_s: float) -> None:
        """Nobody vouches for who is back after so long out of sight: a user has to."""
        self._set("none", None, f"back after {away_s:.1f} s out of sight, or somebody alike: "
                  "choose again")  # fmt: skip

    def interrupted(self) -> None:
        """Nothing fresh is seen: a person that stood before the robot has to do so anew."""
        self._imprinting.reset()

    def _refuse_stale(self, tracks: Tracks | None, age_s: float) -> None:
        if tracks is not None and age_s > self._max_age_s:
            raise TargetError(
                f"the newest tracks are {age_s:.1f} s old: choose again when the picture is live "
                "(`heel status` names who is silent)"
            )

    def _choose(self, request: TargetRequest, tracks: Tracks | None, now_s: float) -> None:
        if request.mode == "point":
            assert request.x_px is not None
            assert request.y_px is not None
            self._choose_point(request.x_px, request.y_px, tracks, now_s)
            return
        track = self._requested(request, tracks)
        if track is None or tracks is None:
            self._set(request.mode, None, self._waiting["nearest"])
        elif request.mode == "nearest":
            self._choose_nearest(track, tracks, "chosen")
        else:
            point = None if request.x_px is None or request.y_px is None else (
                request.x_px, request.y_px
            )  # fmt: skip
            self._choose_track("id", track, tracks, now_s, "chosen", point)

    def _choose_point(self, x_px: float, y_px: float, tracks: Tracks | None, now_s: float) -> None:
        if tracks is None:
            raise TargetError("no picture yet: choose again when there is one")
        if not (0 <= x_px <= tracks.width and 0 <= y_px <= tracks.height):
            raise TargetError(
                f"({x_px:.0f}, {y_px:.0f}) is outside the picture of {tracks.width}x"
                f"{tracks.height} pixels: choose a point in it"
            )
        track = at_point(tracks, x_px, y_px)
        if track is None:
            self._set("point", None, "looking for somebody there")
            self.pending = PendingPoint(x_px, y_px, tracks, now_s)
            return
        self._choose_track("point", track, tracks, now_s, "chosen", (x_px, y_px))

    def _choose_track(
        self, mode: str, track: Track, tracks: Tracks, t_s: float, reason: str,
        point_px: Point | None,
    ) -> None:  # fmt: skip
        """Choose a track, for good or until it is clear which of two it is."""
        together = companion(track, tracks)
        other = together or self._newcomers.of(track, tracks)
        if other is not None:
            self._leave_open(mode, Provisional(track, other, point_px, t_s, together is None))
            return
        if track.proven and track.identity_confidence < self._sure_from:
            sure = f"{100 * track.identity_confidence:.0f} % sure"
            self._set(mode, track.id, f"{reason} while only {sure} who it is: the robot waits "
                      "until that is clear")  # fmt: skip
        else:
            self._set(mode, track.id, reason)
        self._click = None if point_px is None else Click(track, point_px, tracks, t_s)

    def _choose_nearest(self, first: Track, tracks: Tracks, reason: str) -> None:
        other = companion(first, tracks)
        if other is None:
            self._set("nearest", first.id, reason)
            return
        waiting = (
            f"the nearest box covers two people, {first.id} and {other.id}: waiting until they part"
        )
        if (self.target.mode, self.target.reason) != ("nearest", waiting):
            self._set("nearest", None, waiting)

    def _requested(self, request: TargetRequest, tracks: Tracks | None) -> Track | None:
        if request.mode == "nearest":
            return None if tracks is None else nearest(tracks)
        if tracks is not None and request.tracker not in (None, self._tracker):
            raise TargetError(
                f"id {request.track_id} was given out by {request.tracker}, but {self._tracker} "
                "is tracking now: choose again"
            )
        for track in () if tracks is None else tracks.tracks:
            if track.id == request.track_id:
                return track
        raise TargetError(
            f"nobody has id {request.track_id} now: see `heel status` for the ids in sight"
        )

    def _go_on(self) -> None:
        left, self._left = self._left, None
        if left is None or self.target.track_id is not None or self.pending is not None:
            return
        if left.scene == self._scene and left.target.tracker == self._tracker:
            self._set(left.target.mode, left.target.track_id, "kept over a restart of the follower")
        elif self.target.mode == "none":
            self._set("none", None, "follower and tracker or camera were restarted: choose again")

    def _back_again(self, kept: KeptTarget, seen_ns: int) -> None:
        """Go on with the person followed before, if the tracker that knows them is heard again."""
        away_s = (self._seen_ns - seen_ns) * 1e-9
        if (
            kept.scene == self._scene
            and kept.target.tracker == self._tracker
            and 0.0 <= away_s <= FORMER_S
        ):
            self._set(kept.target.mode, kept.target.track_id, "kept: its tracker is back")

    def _void(self, reason: str) -> None:
        self._imprinting.reset()
        if self.target.track_id is not None or self.pending is not None:
            self._set("none", None, reason)

    def _set(self, mode: str, track_id: int | None, reason: str) -> None:
        self.pending = self.provisional = self._click = self._left = self._interrupted = None
        self.target = Target.model_validate(
            {"seq": self.target.seq + 1, "mode": mode, "track_id": track_id, "reason": reason,
             "tracker": self._tracker if track_id is not None else None}
        )  # fmt: skip
