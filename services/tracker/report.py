"""From what a tracker knows of its people to the tracks of a message: the only maker of `Track`.

What the fields mean is said once, at `heel.schemas.Track`; here it is made so for every tracker.
The values come from the two that make a `Report`: paper/report.py and people/track.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from heel.schemas import Track
from heel.schemas.base import BoxXyxy, Point
from heel.schemas.tracks import MAX_TRACKS, TrackState

_UNSEEN_DOUBT_S = 4.0
"""Time unseen in which the reported confidence falls to 1/e [s]: a track is predicted for seconds,
and may be found on somebody else; chosen by hand."""


def faded(confidence: float, unseen_s: float) -> float:
    """Confidence in an identity, in [0, 1], after time unseen; as before once seen again."""
    return confidence * math.exp(-unseen_s / _UNSEEN_DOUBT_S)


@dataclass(frozen=True, slots=True)
class Report:
    """What a tracker knows of one track in one frame.

    Attributes:
        id: never used again for another person, from 1; 0 where none is given out yet.
        box_xyxy: estimated, pixels of the frame.
        velocity_pxps: of the box's centre.
        confirmed: whether it is taken for a person.
        alone: whether it was measured on its own in this frame: by a box or region of its own, or
            with at least half of it in view.
        missed_frames: frames in a row, up to this one, in which nothing of it was measured.
        in_front: ids of the tracks that hide it, or that stand before it in one measurement.
        identity_confidence: estimated probability, 0 to 1, that the id is on the same person.
        runner_up_confidence: the same for the best other known person.
        shown: whether a confirmed track is shown.
        proven: whether it is known to be a person and no thing.
    """

    id: int
    box_xyxy: BoxXyxy
    velocity_pxps: Point
    confirmed: bool
    alone: bool
    missed_frames: int
    in_front: tuple[int, ...]
    identity_confidence: float
    runner_up_confidence: float
    shown: bool
    proven: bool = True

    @property
    def state(self) -> TrackState:
        """As `heel.schemas.Track` defines it."""
        if not self.confirmed:
            return "new"
        if self.missed_frames == 0:
            return "tracked" if self.alone else "occluded"
        return "occluded" if self.in_front else "lost"


def tracks_of(reports: Sequence[Report]) -> list[Track]:
    """The tracks of a message, by id; those without an id are left out.

    Args:
        reports: of one frame, in any order, at most `MAX_TRACKS` with an id.
    """
    known = {report.id: report for report in reports if report.id}
    return [_track(known[key], known) for key in sorted(known)]


def _track(report: Report, known: dict[int, Report]) -> Track:
    left, top, right, bottom = report.box_xyxy
    return Track(
        id=report.id,
        state=report.state,
        box_xyxy=report.box_xyxy,
        velocity_pxps=report.velocity_pxps,
        area_px=(right - left) * (bottom - top),
        span_px=right - left,
        identity_confidence=report.identity_confidence,
        runner_up_confidence=min(report.runner_up_confidence, 1.0 - report.identity_confidence),
        occluded_by=_nearest_first(report, known) if report.state == "occluded" else (),
        missed_frames=report.missed_frames,
        shown=report.confirmed and report.shown,
        proven=report.proven,
    )


def _nearest_first(report: Report, known: dict[int, Report]) -> tuple[int, ...]:
    """Occluders of a track; feet that are lower in the picture are nearer."""
    others = [key for key in report.in_front if key in known and key != report.id]
    return tuple(sorted(others, key=lambda key: (-known[key].box_xyxy[3], key))[:MAX_TRACKS])
