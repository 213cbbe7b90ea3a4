"""When a person counts, when two are the same, and when a person is gone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from heel.schemas.blobs import FOREGROUND, MOVING
from heel.services.geometry.boxes import cover, iou
from heel.services.tracker.evidence.arrays import Box, Image
from heel.services.tracker.evidence.canvas import Canvas, Fit
from heel.services.tracker.evidence.silhouette import Silhouette
from heel.services.tracker.people.track import Track
from heel.services.tracker.settings import Reporting

CONFIRM_HITS = 3
"""Frames in which a person is seen before it can count: clutter seldom lasts as long; chosen by
hand."""
_CONFIRM_MOVED = 0.2
"""Heights from the place of birth from which a person counts: more than the fit wavers; chosen by
hand."""
_CONFIRM_MOVING_HITS = 3
"""Frames with moving foreground from which a person counts on the spot; chosen by hand."""
_MOVING_SHARE = 0.2
"""Share of the foreground in a box that moves, from which the person moves; chosen by hand."""
_MOVING_GAIN = 0.3
"""Gain from which a frame with moving foreground counts for the person; chosen by hand."""
_SAME_AFTER_S = 0.4
"""Seconds without evidence of its own after which a person never seen alone is taken for the double
of an older one on the spot; chosen by hand."""
_HIDDEN_AFTER_S = 1.5
"""The same for a person once seen alone, which is hidden most likely: longer than people take to
pass each other; chosen by hand."""
_SAME_IOU = 0.5
"""IoU of two boxes from which they are on the same spot; chosen by hand."""
_SAME_CONTAINED = 0.7
"""Share of a box inside an older one from which it is on the same spot, unless its person was once
seen alone; chosen by hand."""
_NEVER_CLEAN = 0.7
"""Best gain so far below which a person was never seen alone; a clean one has about 1. Chosen by
hand."""
_LEAST_INSIDE = 0.2
"""Share of the silhouette inside the image below which a person has left it; chosen by hand."""
_DUPLICATE_GAIN = 0.15
"""Gain below which a person may be the double of another one; chosen by hand."""
# A person found soon after the start that never went far and does not move at all is a ghost: the
# place that a person learned as background has left. People that stand there came from somewhere.
EARLY_S = 5.0
"""Seconds from the start in which ghosts appear, while the background is hardly known; chosen by
hand."""
_GHOST_AFTER_S = 1.0
"""Seconds without any motion from which such a person is a ghost; chosen by hand."""
_GHOST_MOVED = 0.7
"""Heights from the place of birth below which such a person never went far; chosen by hand."""
_BESIDE = 0.7
"""Heights between the feet of two people that may have been taken for one; chosen by hand."""
# Two people taken for one lose gain when they part; a single person hardly loses any when another
# one comes into view beside it.
_TORN = 0.85
"""Gain since a newcomer by the median gain before, below which one box held two people: between
pairs that parted and single people as measured."""
_TORN_AT_ONCE = 0.8
"""The same by the gain in the frames just before: between the two as measured."""
_TORN_LEAST = 4
"""Gains from before the newcomer, below which their median says too little; chosen by hand."""
_PARTED_GAIN = 0.5
"""Gain above which both people stand where they were placed once parted; chosen by hand."""
_KNOWN_HEIGHT = 0.7
"""`CLUTTER_HEIGHT` for confirmed people: they may go a little farther away, and come back; chosen
by hand."""
CLUTTER_HEIGHT = 0.85
"""Share of the lowest height that is shown, below which people are not looked for: a little less
than 1, so that a person is known once it is shown; chosen by hand."""


_TENTATIVE_FRAMES = 2
"""Frames unseen in a row after which a person that does not count yet is dropped; chosen by
hand."""
_JUMP = 0.3
"""Heights from the prediction within which a person just missed is found again; chosen by hand."""
_JUMP_SPEED = 0.4
"""Heights per second by which that distance grows; chosen by hand."""
_JUMP_GROWTH = 0.3
"""Difference of ln(height) up to which it is the same person; chosen by hand."""


def observe_motion(person: Silhouette, evidence: Image, ratio: float, dt_s: float) -> None:
    """Note whether the evidence of a person that is seen moves."""
    moves = moving_share(evidence, person.box(ratio)) > _MOVING_SHARE
    person.moving_hits += person.gain > _MOVING_GAIN and moves
    person.still_s = 0.0 if moves else person.still_s + dt_s


def is_person(person: Silhouette) -> bool:
    """Whether it counts: seen several times and moving, for ghosts and lamps never move."""
    moves = person.moved > _CONFIRM_MOVED or person.moving_hits >= _CONFIRM_MOVING_HITS
    return person.hits >= CONFIRM_HITS and moves


def is_torn(person: Silhouette, newcomer: Silhouette) -> bool:
    """Whether the newcomer, just confirmed, explains what the person's box explained before."""
    if person is newcomer:
        return False
    x, y = person.foot
    beside = abs(newcomer.foot[0] - x) < _BESIDE * person.height
    beside = beside and abs(newcomer.foot[1] - y) < _BESIDE * person.height
    before, since = list(person.gains)[: -CONFIRM_HITS - 1], list(person.gains)[-2:]
    if not beside or len(before) < _TORN_LEAST or person.missed_frames > 0:
        return False
    least = min(_TORN * float(np.median(before)), _TORN_AT_ONCE * float(np.mean(before[-3:])))
    return min(newcomer.gain, *since) > _PARTED_GAIN and float(np.mean(since)) < least


def moving_share(evidence: Image, box: Box) -> float:
    """Share of the foreground in a box that moves."""
    left, top, right, bottom = (max(0, round(value)) for value in box)
    part = evidence[top:bottom, left:right]
    moving = np.count_nonzero(part == MOVING)
    return float(moving) / max(float(np.count_nonzero(part >= FOREGROUND)), 1.0)


def without_duplicates(people: Sequence[Silhouette], ratio: float, dt_s: float) -> list[Silhouette]:
    """Leave out people that for a while explained nothing but what an older one there explains."""
    gone: set[int] = set()
    for person in people:
        explains = person.gain >= _DUPLICATE_GAIN
        person.duplicate_s = 0.0 if explains else person.duplicate_s + dt_s
        # A person once seen alone is hidden, most likely, and no double of another one.
        was_clean = person.best_gain >= _NEVER_CLEAN
        if person.duplicate_s < (_HIDDEN_AFTER_S if was_clean else _SAME_AFTER_S):
            continue
        older = (other for other in people if other.id not in gone and other.hits > person.hits)
        if any(_same(person, other, ratio) for other in older):
            gone.add(person.id)
    return [person for person in people if person.id not in gone]


def _same(person: Silhouette, other: Silhouette, ratio: float) -> bool:
    box, older = person.box(ratio), other.box(ratio)
    hidden = cover(box, older) > _SAME_CONTAINED and person.best_gain < _NEVER_CLEAN
    return iou(box, older) > _SAME_IOU or hidden


def is_alive(person: Silhouette, canvas: Canvas, ratio: float, reporting: Reporting) -> bool:
    """Not forgotten, in the image, and not too small to be told from clutter."""
    _, top, _, bottom = person.box(ratio)
    inside = 0 <= person.foot[0] < canvas.columns and top < canvas.rows and bottom > 0
    lowest = _KNOWN_HEIGHT if person.confirmed else CLUTTER_HEIGHT
    large = person.height > lowest * reporting.min_height * canvas.rows
    if person.born_early and person.still_s > _GHOST_AFTER_S and person.moved < _GHOST_MOVED:
        return False
    lasts = person.confirmed or person.missed_frames < _TENTATIVE_FRAMES
    return lasts and inside and person.inside > _LEAST_INSIDE and large


def missed_near(
    people: Mapping[Track, Silhouette], fit: Fit, height: float, t_s: float
) -> Track | None:
    """The nearest confirmed person that has just been missed and can have come to `fit`."""
    missed = [
        (person.distance(fit.foot), person.id, track)
        for track, person in people.items()
        if person.confirmed
        and person.missed_frames > 1
        and person.distance(fit.foot) < _JUMP + _JUMP_SPEED * (t_s - track.seen_s)
        and abs(np.log(height / person.height)) < _JUMP_GROWTH
    ]
    return min(missed, key=lambda found: found[:2])[2] if missed else None
