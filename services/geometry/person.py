"""Where a person stands, from the box alone: feet on the ground, head at an assumed height.

A ray that falls by `s` per metre along the ground meets a point `f` metres below the camera at
`d = f / s`. Feet are the mounting height below the camera and the head the mounting height less
the person's, so each edge of the box that is seen says something of `q = 1 / d`:

    s_feet = mount * q        s_head = (mount - person) * q

Where both agree they are combined by generalised least squares in `q`. Their errors: edges of
boxes, the person's height (head only), and the pitch of a rocking robot, which moves both alike.
Where the mounting is not known the difference tells, `s_feet - s_head = person * q`, and a
`GroundLine` that was learned from people who stood upright says where their feet are seen.

All of these are mistaken to the same side: who sits, bends or is small, whose feet a table hides
or the picture's border cuts off, is nearer than an upright adult with such a box would be. So
where they disagree the nearer one counts, and the width of the box bounds the distance, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from heel.services.geometry.camera import GroundCamera, Pinhole
from heel.services.geometry.ground_line import GroundLine
from heel.services.geometry.person_box import PersonBox, PersonModel

__all__ = ["Evidence", "PersonModel", "PersonPosition", "locate_person", "locate_raised"]

Evidence = Literal["feet and head", "feet", "head", "height", "cut height", "width", "bound"]
_AGREE_SIGMAS = 3.0
"""Two judgements of a distance agree that differ by no more of their standard deviations: 99.7 % of
what chance does."""
_AGREE_SHARE = 0.12
"""So much of the distance apart, two judgements of it agree, besides what edges of boxes err."""
_STRIDE = 1.6
"""A stride seen from the side widens a box by that; it does not bring anybody nearer."""
_SEATED = 1.25
"""So much wider than a narrow adult is who sits."""
_WIDER = 1.1
"""Boxes of the same person vary so much in width; chosen by hand."""
_DOUBTFULLY_WIDER = 1.3
"""From so much wider on, something about the distance is wrong; chosen by hand."""
_WIDEST_M = 1.0
"""No person is wider, in a stride seen from the side or in a wheelchair seen from the front."""
_DOUBTFUL_SHARE = 0.25
"""Standard deviation of a distance that rests on one doubtful edge, share of the distance; chosen
by hand, wide enough that any other evidence counts for more."""
_SUNK_M = 1.0
"""Somebody low right before a camera of unknown mounting: within `personal_space_m`, not nearer."""


@dataclass(frozen=True, slots=True)
class PersonPosition:
    """Where a person stands, from the camera.

    Attributes:
        distance_m: along the ground.
        bearing_rad: left is positive.
        distance_sigma_m, bearing_sigma_rad: standard deviations.
        evidence: what the distance rests on. `bound`: neither feet nor head are seen, or what is
            taken for them is not; the person is anywhere from touching to twice `distance_m`.
            `cut height`: one of them is cut off and the mounting is unknown; the person may be
            nearer.
        certain: whether all that is seen fits somebody who stands there. Otherwise `distance_m` is
            the nearest of several judgements, and a box that shrinks means nothing.
    """

    distance_m: float
    bearing_rad: float
    distance_sigma_m: float
    bearing_sigma_rad: float
    evidence: Evidence
    certain: bool


def locate_person(
    box_xyxy: Sequence[float], camera: Pinhole, model: PersonModel | None = None,
    ground: GroundLine | None = None,
) -> PersonPosition | None:  # fmt: skip
    """Bearing and distance of a person.

    Args:
        box_xyxy: left, top, right, bottom in pixels of the camera's picture.
        camera: a `GroundCamera` where the mounting is known, else a `Pinhole`.
        model: what is assumed of people, or known of this one.
        ground: where feet were seen so far, for a camera of unknown mounting.

    Returns:
        None for a box without area, one outside the picture, or one that nobody can have who
        stands on the ground (feet above the horizon): see `locate_raised`.
    """
    box = PersonBox.of(box_xyxy, camera, model or PersonModel())
    if box is None:
        return None
    seen = _by_ground(box) if isinstance(camera, GroundCamera) else _by_height(box, ground)
    return None if seen is None else _position(box, seen)


def locate_raised(
    box_xyxy: Sequence[float], camera: Pinhole, model: PersonModel | None = None
) -> PersonPosition | None:
    """Somebody whose lower edge is above the horizon of flat ground.

    They stand on a kerb or a ramp, or a table as high as the camera hides their feet: never
    certain.

    Args:
        box_xyxy, camera, model: as for `locate_person`.
    """
    box = PersonBox.of(box_xyxy, camera, model or PersonModel())
    if box is None:
        return None
    distance_m = min(box.height_m(), box.width_m())
    return _position(box, (distance_m, _DOUBTFUL_SHARE * distance_m, "width", False))


_Seen = tuple[float, float, Evidence, bool]


def _position(box: PersonBox, seen: _Seen) -> PersonPosition:
    distance_m, distance_sigma_m, evidence, certain = seen
    return PersonPosition(
        distance_m, box.bearing_rad(), distance_sigma_m, box.bearing_sigma_rad(), evidence, certain
    )


def _by_ground(box: PersonBox) -> _Seen | None:
    """The mounting is known."""
    if box.head_seen and box.feet_seen:
        return _by_feet_and_head(box)
    if box.feet_seen:
        return _by_feet(box)
    if box.head_seen:
        return _by_head(box)
    return _cut_at_both_ends(box, box.farthest_m())


def _by_feet_and_head(box: PersonBox) -> _Seen | None:
    both = box.least_squares(feet=True, head=True)
    if not box.feet_m() < math.inf or both is None:
        return None
    shorter_by, sigma = box.shorter_by()
    if 0 < shorter_by <= _AGREE_SIGMAS * sigma:
        # Somebody short, or who begins to bend: in doubt the nearer one.
        feet = box.least_squares(feet=True, head=False)
        both = both if feet is None else min(both, feet)
    if abs(shorter_by) <= _AGREE_SIGMAS * sigma:
        return _within_stride(box, (*both, "feet and head", True))
    if shorter_by > 0:
        # A child, or somebody who sits or bends: the ground tells, not the head.
        feet = box.least_squares(feet=True, head=False)
        share = 1.0 if box.model.width_known else _SEATED
        return None if feet is None else _not_wider(box, (*feet, "feet", True), share)
    head = box.least_squares(feet=False, head=True)
    distance_m = min(box.height_m(), math.inf if head is None else head[0])
    return _not_wider(box, (distance_m, _DOUBTFUL_SHARE * distance_m, "head", False))


def _by_feet(box: PersonBox) -> _Seen | None:
    """The head is cut off. Whoever is farther away would show it.

    A network's boxes of rendered people 1 m away ended at the hips: 3.8 m, said the "feet".
    """
    feet = box.least_squares(feet=True, head=False)
    if feet is None:
        return None
    (distance_m, sigma_m), farthest_m = feet, box.farthest_m()
    if distance_m - 2 * sigma_m > farthest_m:
        return _cut_at_both_ends(box, farthest_m)
    return _by_one_end(box, min(distance_m, farthest_m), sigma_m, "feet")


def _by_head(box: PersonBox) -> _Seen:
    """The feet are cut off: no farther away than where they would come into the picture."""
    farthest_m, head = box.farthest_m(), box.least_squares(feet=False, head=True)
    if head is None or head[0] - 2 * head[1] > farthest_m:
        return _cut_at_both_ends(box, farthest_m)
    return _by_one_end(box, min(head[0], farthest_m), head[1], "head")


def _by_one_end(box: PersonBox, distance_m: float, sigma_m: float, evidence: Evidence) -> _Seen:
    """Nothing but the width can contradict a single end.

    A head alone is that of an adult who stands, or of somebody less than half as far away who sits.
    """
    if not box.model.width_known:
        seen = distance_m, sigma_m, evidence, True
        doubtful = evidence == "head" and distance_m > _DOUBTFULLY_WIDER * _SEATED * box.width_m()
        return _not_wider(box, seen, _SEATED) if doubtful else _no_giant(box, seen)
    certain = distance_m <= _DOUBTFULLY_WIDER * box.width_m()
    return _not_wider(box, (distance_m, sigma_m, evidence, certain), _WIDER)


def _cut_at_both_ends(box: PersonBox, farthest_m: float) -> _Seen:
    """No end that is seen tells the distance: the width does, or it is anywhere up to a bound."""
    if box.model.width_known:
        distance_m = min(farthest_m, box.height_m(), box.width_m())
        return distance_m, _DOUBTFUL_SHARE * distance_m, "width", False
    farthest_m = min(farthest_m, box.height_m())
    distance_m = min(farthest_m / 2, box.width_m())
    return distance_m, farthest_m / math.sqrt(12), "bound", False


def _by_height(box: PersonBox, ground: GroundLine | None) -> _Seen | None:
    """The mounting is unknown. Apparent distance: who looks half as tall is twice as far away."""
    distance_m = box.height_m()
    if not distance_m < math.inf:
        return None
    feet_m = math.inf if ground is None else ground.distance_m(box.lower_slope)
    sigma_m = distance_m * box.height_share()
    if not (box.head_seen and box.feet_seen):
        if not (box.head_seen or box.feet_seen):
            return _cut_at_both_ends(box, feet_m)
        distance_m = min(distance_m, feet_m, box.width_m())
        if box.sunk:
            distance_m = min(distance_m, _SUNK_M)
        return distance_m, distance_m * math.hypot(box.height_share(), 0.25), "cut height", False
    if ground is None:
        return _no_giant(box, (distance_m, sigma_m, "height", True))
    apart, agree = distance_m / feet_m - 1.0, _AGREE_SHARE + 2 * box.height_noise()
    if abs(apart) <= agree:
        return _no_giant(box, _by_one_end(box, distance_m, sigma_m, "height"))
    distance_m = min(distance_m, feet_m)
    return _not_wider(box, (distance_m, _DOUBTFUL_SHARE * distance_m, "feet", False))


def _within_stride(box: PersonBox, seen: _Seen) -> _Seen:
    """What fits an upright adult, unless the box is far too wide for where they would stand.

    To a camera as high as a chest, who sits behind a table has the ends of an adult far away.
    """
    if not box.model.width_known:
        return _no_giant(box, seen)
    return seen if seen[0] <= _STRIDE * box.width_m() else _not_wider(box, seen, _WIDER)


def _no_giant(box: PersonBox, seen: _Seen) -> _Seen:
    """What would make a person wider than any is not where they are."""
    return seen if box.wide_m(seen[0]) <= _WIDEST_M else _not_wider(box, seen)


def _not_wider(box: PersonBox, seen: _Seen, share: float = 1.0) -> _Seen:
    """No farther away than the width of the box lets be."""
    most_m = share * box.width_m()
    if seen[0] <= most_m:
        return seen
    return most_m, _DOUBTFUL_SHARE * most_m, "width", False
