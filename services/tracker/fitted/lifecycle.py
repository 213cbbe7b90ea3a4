"""When a person counts, when two are the same, and when somebody is gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.schemas.blobs import FOREGROUND, MOVING
from heel.services.geometry.boxes import cover, iou
from heel.services.tracker.fitted.arrays import Box, Image
from heel.services.tracker.fitted.canvas import Canvas, Fit
from heel.services.tracker.fitted.person import Person
from heel.services.tracker.settings import Reporting

CONFIRM_HITS = 3
_CONFIRM_MOVED = 0.2
"""Way from the place of birth, heights."""
_CONFIRM_MOVING_HITS, _MOVING_SHARE, _MOVING_GAIN = 3, 0.2, 0.3
_SAME_AFTER_S, _HIDDEN_AFTER_S = 0.4, 1.5
_SAME_IOU, _SAME_CONTAINED, _NEVER_CLEAN = 0.5, 0.7, 0.7
_LEAST_INSIDE = 0.2
_DUPLICATE_GAIN = 0.15
"""Below this gain a person may be another one's double; chosen by hand."""
EARLY_S, _GHOST_AFTER_S, _GHOST_MOVED = 5.0, 1.0, 0.7
"""Who was found soon after the start, never went farther, heights, and does not move at all is what
somebody left behind who was learned as background: people who stand there came from somewhere."""
_BORDER = 0.3
"""Heights from the border of the image within which people come and go."""
_BESIDE = 0.7
"""Heights between the feet of two people who may have been taken for one."""
_TORN, _TORN_AT_ONCE, _TORN_LEAST, _PARTED_GAIN = 0.85, 0.8, 4, 0.5
"""Three pairs taken for one explained 0.7, 0.7 and 0.8 of the median before once parted, and 0.7 of
the frames just before; others beside whom somebody came into view 0.85 and more of either."""
_KNOWN_HEIGHT = 0.7
CLUTTER_HEIGHT = 0.85
"""People lower than this share of the lowest that is shown are not looked for; those who are known
may go a little farther away, and come back."""


def confirm_if_due(person: Person, evidence: Image, ratio: float, dt_s: float) -> bool:
    """A person counts once seen several times and moving: ghosts and lamps never move.

    Returns:
        Whether the person counts since this frame.
    """
    moves = moving_share(evidence, person.box(ratio)) > _MOVING_SHARE
    person.moving_hits += person.gain > _MOVING_GAIN and moves
    person.still_s = 0.0 if moves else person.still_s + dt_s
    if person.confirmed or person.hits < CONFIRM_HITS:
        return False
    moved = person.moved() > _CONFIRM_MOVED
    person.confirmed = moved or person.moving_hits >= _CONFIRM_MOVING_HITS
    return person.confirmed


def is_torn(person: Person, newcomer: Person) -> bool:
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


def at_border(person: Person, shape: tuple[int, ...], ratio: float) -> bool:
    """Whether somebody may just have come into the picture (rows, columns) here."""
    left, top, right, bottom = person.box(ratio)
    margin = _BORDER * person.height
    across = left < margin or right > shape[1] - margin
    return across or top < margin or bottom > shape[0] - margin


def moving_share(evidence: Image, box: Box) -> float:
    """Share of the foreground in a box that moves."""
    left, top, right, bottom = (max(0, round(value)) for value in box)
    part = evidence[top:bottom, left:right]
    moving = np.count_nonzero(part == MOVING)
    return float(moving) / max(float(np.count_nonzero(part >= FOREGROUND)), 1.0)


def without_duplicates(people: Sequence[Person], ratio: float, dt_s: float) -> list[Person]:
    """Leave out those who for a while explained nothing that an older one on the spot does not."""
    gone: set[int] = set()
    for person in people:
        explains = person.gain >= _DUPLICATE_GAIN
        person.duplicate_s = 0.0 if explains else person.duplicate_s + dt_s
        # Who was once seen alone is hidden, most likely, and not somebody's double.
        was_clean = person.best_gain >= _NEVER_CLEAN
        if person.duplicate_s < (_HIDDEN_AFTER_S if was_clean else _SAME_AFTER_S):
            continue
        older = (other for other in people if other.id not in gone and other.hits > person.hits)
        if any(_same(person, other, ratio) for other in older):
            gone.add(person.id)
    return [person for person in people if person.id not in gone]


def _same(person: Person, other: Person, ratio: float) -> bool:
    box, older = person.box(ratio), other.box(ratio)
    hidden = cover(box, older) > _SAME_CONTAINED and person.best_gain < _NEVER_CLEAN
    return iou(box, older) > _SAME_IOU or hidden


def is_alive(person: Person, canvas: Canvas, ratio: float, reporting: Reporting) -> bool:
    """Not forgotten, in the image, and not too small to be told from clutter."""
    _, top, _, bottom = person.box(ratio)
    inside = 0 <= person.foot[0] < canvas.columns and top < canvas.rows and bottom > 0
    lowest = _KNOWN_HEIGHT if person.confirmed else CLUTTER_HEIGHT
    large = person.height > lowest * reporting.min_height * canvas.rows
    if person.born_early and person.still_s > _GHOST_AFTER_S and person.moved() < _GHOST_MOVED:
        return False
    here = inside and person.inside > _LEAST_INSIDE and large
    return here and not is_forgotten(person, reporting.forget_s)


def is_forgotten(person: Person, forget_s: float) -> bool:
    """Missed for too long."""
    if person.confirmed:
        return person.missed_s > forget_s
    return person.missed_frames >= 2


def missed_near(people: Sequence[Person], fit: Fit, height: float) -> Person | None:
    """The nearest confirmed person who has just been missed and can have come to `fit`."""
    missed = [
        person
        for person in people
        if person.confirmed
        and person.missed_frames > 1
        and person.distance(fit.foot) < 0.3 + 0.4 * person.missed_s
        and abs(np.log(height / person.height)) < 0.3
    ]
    return min(missed, key=lambda person: (person.distance(fit.foot), person.id), default=None)
