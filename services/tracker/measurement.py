"""What a blob says of the people under it: one person's box, or the places within a group."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.base import BoxXyxy, Point
from services.tracker import boxes
from services.tracker.lifecycle import Person
from services.tracker.occlusion import aspect_ratio
from services.tracker.settings import TrackerSettings
from services.tracker.view import View

SETTLED_HITS = 5
"""Sightings after which a person's size is known well enough to doubt a blob's."""

MAX_WIDTH_RATIO = 1.6
SIZE_DOUBT, POSITION_DOUBT = 6.0, 2.0
SWEEPS = 3
BODY_FILL = 0.5
"""Share of a person's box that is body, about."""
VISIBLE_SHARE = 0.3


def take_in_one(person: Person, blob: BoxXyxy, settings: TrackerSettings) -> bool:
    """Correct somebody who is alone under `blob`; whether all of the person was seen.

    A blob much smaller than the person shows a part (a pole, self-occlusion): the known size is
    laid along its top or its foot, whichever agrees with the prediction. A much wider one, too
    wide for one person (eq. 4), holds a shadow or a stranger: the known size is kept inside it.
    The size follows slowly, so that a wrong one is not kept for ever.
    """
    expected = person.box
    if person.hits < SETTLED_HITS or settings.partial_height_ratio == 0.0:
        person.filter.correct(blob)
        return True
    height_ratio = boxes.height(blob) / boxes.height(expected)
    width_ratio = boxes.width(blob) / boxes.width(expected)
    if height_ratio < settings.partial_height_ratio:
        place = _aligned(expected, blob)
    elif width_ratio > MAX_WIDTH_RATIO and aspect_ratio(blob) > settings.aspect_ratio:
        place = boxes.kept_inside(expected, blob)
    else:
        person.filter.correct(blob)
        return True
    person.filter.correct_size(blob, SIZE_DOUBT)
    person.filter.correct_centre(boxes.centre(place), POSITION_DOUBT)
    return False


def _aligned(expected: BoxXyxy, blob: BoxXyxy) -> BoxXyxy:
    dx = boxes.centre(blob)[0] - boxes.centre(expected)[0]
    shifts = (blob[1] - expected[1], blob[3] - expected[3])
    return boxes.moved(expected, dx, min(shifts, key=abs))


@dataclass(frozen=True, slots=True)
class Place:
    """Where a member of a group is, and the share of the body that is visible, 0 to 1."""

    centre: Point
    visible: float


def in_group(people: Sequence[Person], blob: BoxXyxy, view: View) -> list[Place] | None:
    """Places of several people within one blob, by sharing out its foreground pixels.

    Each pixel goes to the person whose predicted box it is nearest to, in units of the box; each
    person moves to the mean of the pixels given (k-means with sizes, S. Lloyd 1982).

    Returns:
        A place per person, None when the message carries no evidence.
    """
    points = view.foreground_points(blob)
    if points is None or len(points) == 0:
        return None
    kept = [boxes.kept_inside(person.box, blob) for person in people]
    centres = np.array([boxes.centre(box) for box in kept])
    half_sizes = np.array([[boxes.width(box) / 2, boxes.height(box) / 2] for box in kept])
    owners = np.zeros(len(points), np.intp)
    for _ in range(SWEEPS):
        offsets = (points[:, None] - centres[None]) / half_sizes[None]
        owners = np.argmin((offsets**2).sum(axis=2), axis=1)
        for index in range(len(people)):
            own = points[owners == index]
            if len(own):
                centres[index] = own.mean(axis=0)
    shares = _visible_shares(points, kept, view.pixel_area_px)
    _align(centres, half_sizes, blob, [share > VISIBLE_SHARE for share in shares])
    return [
        Place((float(centre[0]), float(centre[1])), share)
        for centre, share in zip(centres, shares, strict=True)
    ]


def _visible_shares(
    points: NDArray[np.float64], people: Sequence[BoxXyxy], pixel_area_px: float
) -> list[float]:
    """Share of each body that is seen when those nearer the camera (lower feet) are given first."""
    shares = [0.0] * len(people)
    free = np.ones(len(points), np.bool_)
    for index in sorted(range(len(people)), key=lambda index: (-people[index][3], index)):
        left, top, right, bottom = people[index]
        inside = free & (points[:, 0] >= left) & (points[:, 0] <= right)
        inside &= (points[:, 1] >= top) & (points[:, 1] <= bottom)
        free &= ~inside
        body_px = BODY_FILL * boxes.area(people[index])
        shares[index] = min(1.0, float(inside.sum()) * pixel_area_px / body_px)
    return shares


def _align(
    centres: NDArray[np.float64],
    half_sizes: NDArray[np.float64],
    blob: BoxXyxy,
    visible: Sequence[bool],
) -> None:
    """Lay the outermost visible people along the edges of the blob, in place.

    An edge of the blob is an edge of a person: it places that person better than any mean.
    """
    seen = np.flatnonzero(visible)
    if len(seen) < 2:
        return
    for axis in (0, 1):
        low = int(seen[np.argmin((centres - half_sizes)[seen, axis])])
        high = int(seen[np.argmax((centres + half_sizes)[seen, axis])])
        if low != high:
            centres[low, axis] = blob[axis] + half_sizes[low, axis]
            centres[high, axis] = blob[axis + 2] - half_sizes[high, axis]
