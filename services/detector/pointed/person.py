"""One person, found again in each frame by the colours of the clothes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.colours import Exposure, StripColours, colour_bins
from heel.services.detector.pointed.distance import Doubt, Stance
from heel.services.detector.pointed.fitting import (
    End,
    Found,
    SilhouetteFit,
    alike,
    best_fit,
    clearest,
    elsewhere,
    extent,
    likeness_at,
    share_inside,
)
from heel.services.detector.pointed.silhouette import (
    ASPECT,
    PERSON_PX,
    FloatMap,
    PersonView,
    Place,
    silhouette,
    view_around,
)
from heel.services.geometry import boxes
from heel.services.geometry.picture_motion import Affine, moved_box

_VIEW = (134, 112)  # columns and rows of what is looked at around the person, view pixels
_LEAST_IN_VIEW = 0.35  # share of the body in the picture; chosen by hand
_SEEN = 0.55  # share of the usual likeness at which the person is seen at all; chosen by hand
_GOOD = 0.8  # share at which it is seen well enough to learn from; chosen by hand
_FOUND = 0.75  # share at which it is found after a time out of sight; chosen by hand
_MISFIT_SLACK = 2.0
"""A size may change so much more readily while the person is seen less well than `_GOOD`: it is
likely to be the size that does not fit; chosen by hand."""
_LEAST_LIKENESS = 0.12  # the usual likeness is taken for no less: nothing stands out from its like
_PERSON_RATE = 0.02  # share of the person's colours that is learned a frame: clothes change slowly
_BESIDE_RATE = 0.2  # share of the colours beside it: what one walks past changes at once
_USUAL_RATE = 0.03  # share of the likeness that is learned a frame; chosen by hand
_HEIGHT_GAIN = 0.25  # share of a change of size that is believed at once; chosen by hand
_GROWTH_GAIN = 0.1  # share of a growth that goes on; chosen by hand
_GROWTH_MEMORY_S = 0.5  # time in which growth fades; chosen by hand
_SPEED_MEMORY_S = 0.2  # time over which speed is averaged; chosen by hand
_UNSEEN_MEMORY_S = 0.5
"""Time out of sight in which the speed is believed less and less; chosen by hand."""
_FIRST_FRAMES = 15  # in which the person's first appearance is learned
_BOX_WIDTH = 0.8  # of the box that is reported, templates' widths: these leave room for arms
_EXTENT_GAIN = 0.4
"""Share of a difference to where the colours end by which the height is corrected a frame."""
_LARGEST_CORRECTION = 0.06  # of the height in a frame, ln; chosen by hand
_LOST_S = 0.4  # a person missed for longer is looked for in the whole picture
_GAP_S = 0.3  # and so is one that was not looked for because there was no picture for so long


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where the person is seen.

    Attributes:
        box_xyxy: working pixels.
        likeness: share of the usual likeness, 1 as ever.
        in_view: share of the body inside the picture.
        doubted: whether it may be another person that looks alike.
        proven: whether it is known to be a person.
    """

    box_xyxy: BoxXyxy
    likeness: float
    in_view: float
    doubted: bool = False
    proven: bool = False


class PointedPerson:
    """A person, known since the frame in which it was pointed at."""

    def __init__(self, box: BoxXyxy, rows: int) -> None:
        """Begin with a box, and pictures of so many rows, working pixels."""
        self._x, self._y = boxes.centre(box)
        self._expected_x = self._x
        self._height = boxes.height(box)
        self._stance = Stance(rows, box[1], box[3])
        self._exposure = Exposure()
        self._speed_px_s = 0.0
        self._growth = 0.0
        self._colours = StripColours()
        self._doubt = Doubt()
        self._usual: float | None = None
        self._share = 1.0
        self._frames = 0
        self.missed_s = 0.0

    @property
    def box_xyxy(self) -> BoxXyxy:
        """Where the person should be, working pixels."""
        return boxes.around((self._x, self._y), ASPECT * self._height, self._height)

    def interrupt(self) -> None:
        """Time has passed in which nobody looked: the person may be anywhere in the picture."""
        self.missed_s = max(self.missed_s, 2.0 * _LOST_S)
        self._speed_px_s = self._growth = 0.0

    def look(self, image: NDArray[np.uint8], camera: Affine, dt_s: float) -> Sighting | None:
        """Where the person is in the next frame; None if it is not seen.

        Args:
            image: (H, W, 3) uint8 BGR at working size.
            camera: its motion since the frame before.
            dt_s: since then.
        """
        image = self._exposure.level(image, dt_s)
        unseen_s = self.missed_s + dt_s
        if dt_s > _GAP_S:
            self.missed_s = unseen_s
        self._predict(camera, dt_s)
        if self.missed_s > _LOST_S and not self._search(image):
            self.missed_s = unseen_s
            return None
        view = view_around(image, self._x, self._y, self._height, _VIEW)
        bins = colour_bins(view.image)
        if self._usual is None:
            self._begin(bins, view)
        likeness = [layer * view.inside for layer in self._colours.likeness(bins)]
        slack = 1.0 + 2.0 * min(self.missed_s, 1.0)
        size_slack = slack if self._share > _GOOD else max(slack, _MISFIT_SLACK)
        fit = best_fit(likeness, self._aim(view), slack, size_slack)
        if (sighting := self._judge(bins, likeness, fit, view, dt_s)) is None:
            self.missed_s = unseen_s
        elif self._doubt.raised(self._height / image.shape[0], dt_s):
            self._go_back(image)
            return replace(sighting, doubted=True)
        return sighting

    def _judge(
        self,
        bins: NDArray[np.int32],
        likeness: list[FloatMap],
        fit: SilhouetteFit,
        view: PersonView,
        dt_s: float,
    ) -> Sighting | None:
        within = share_inside(view.inside, fit.place)
        like = likeness_at(likeness, fit.place) / max(within, _LEAST_IN_VIEW)
        if self._usual is None:
            self._usual = like
        self._share = share = like / max(self._usual, _LEAST_LIKENESS)
        needed = _FOUND if self.missed_s > _LOST_S else _SEEN
        if within < _LEAST_IN_VIEW or share < needed:
            return None
        self._move_to(fit.place, view, dt_s)
        self._stance.correct(self._y, self._height)
        self._correct_height(likeness, fit.place, view, share > _GOOD)
        if self.missed_s == 0.0:
            rate = max(_PERSON_RATE, 1.0 / (self._frames + 1.0)) if share > _GOOD else 0.0
            self._learn(bins, view.inside, fit.place, rate, _BESIDE_RATE)
            if self._frames < _FIRST_FRAMES:
                self._colours.keep()
            self._usual += max(_USUAL_RATE, rate) * (like - self._usual)
        self._frames += 1
        self.missed_s = 0.0
        return Sighting(self._shown(view), share, within)

    def _shown(self, view: PersonView) -> BoxXyxy:
        """The box that is reported: without room for arms, and never farther than it may be.

        Close to the camera head and feet are both beyond the border, and the feet at times believed
        to be above it, which makes the person farther: there is no room for both inside.
        """
        left, top, right, bottom = self.box_xyxy
        narrower = 0.5 * (right - left) * (1.0 - _BOX_WIDTH)
        if top <= 0.0:
            bottom = max(bottom, view.picture_rows)
        return (left + narrower, top, right - narrower, bottom)

    def _predict(self, camera: Affine, dt_s: float) -> None:
        box = moved_box(self.box_xyxy, camera)
        damping = math.exp(-self.missed_s / _UNSEEN_MEMORY_S)
        self._x = boxes.centre(box)[0] + self._speed_px_s * dt_s * damping
        self._growth *= math.exp(-dt_s / _GROWTH_MEMORY_S)
        if self.missed_s == 0.0:
            self._height = boxes.height(box) * math.exp(self._growth * dt_s)
        self._y = self._stance.centre(self._height)
        self._expected_x = self._x

    def _aim(self, view: PersonView) -> tuple[float, float, float]:
        """Expected column and row of the middle, and the horizon's row, in the view."""
        horizon = (self._stance.horizon - view.top) * view.scale
        return 0.5 * _VIEW[0], 0.5 * _VIEW[1], horizon

    def _search(self, image: NDArray[np.uint8]) -> bool:
        """Begin where something looks like the person, if there is one such place, and only one."""
        found = clearest(self._alike(image), self._least(_FOUND))
        if found is not None:
            self._be_at(found)
        return found is not None

    def _go_back(self, image: NDArray[np.uint8]) -> None:
        """Be where something alike is as near as the person was: another one is in front."""
        places = [
            place
            for place in self._alike(image)
            if self._doubt.as_before(place.height / image.shape[0])
            and place.likeness >= self._least(_FOUND)
            and elsewhere(place, self._x, self._height)
        ]
        if places:
            self._be_at(max(places, key=lambda place: place.score))

    def _alike(self, image: NDArray[np.uint8]) -> list[Found]:
        return alike(image, self._colours, self._stance, self._height)

    def _least(self, share: float) -> float:
        return share * max(self._usual or 0.0, _LEAST_LIKENESS)

    def _be_at(self, place: Found) -> None:
        self._x = self._expected_x = place.x
        self._height = place.height
        self._y = self._stance.centre(self._height)
        self._speed_px_s = self._growth = 0.0

    def _begin(self, bins: NDArray[np.int32], view: PersonView) -> None:
        centre = silhouette(PERSON_PX).centre
        place = Place(_VIEW[1] // 2 - centre[1], _VIEW[0] // 2 - centre[0], PERSON_PX)
        self._learn(bins, view.inside, place, 1.0, 1.0)
        self._colours.keep()

    def _move_to(self, place: Place, view: PersonView, dt_s: float) -> None:
        column, row = place.middle
        x, y = view.to_picture(column, row)
        grown = math.log(place.height / PERSON_PX)
        if dt_s > 0.0 and self.missed_s == 0.0:
            surprise = (x - self._expected_x) / dt_s
            self._speed_px_s += min(1.0, dt_s / _SPEED_MEMORY_S) * surprise
            self._growth += _GROWTH_GAIN * grown / dt_s
        self._x, self._y = x, y
        self._height *= math.exp(_HEIGHT_GAIN * grown)

    def _correct_height(
        self, likeness: list[FloatMap], place: Place, view: PersonView, trusted: bool
    ) -> None:
        """Let the box end where the colours do: strips alone let its size drift.

        Where the colours are not trusted only what the picture's border says counts: those behind
        the head would hold the size of a person that walks away.
        """
        head, feet = extent(likeness, view.inside, place)
        least = self._stance.least_height(_row(head, view, cut=True), _row(feet, view, cut=True))
        told = None
        if trusted:
            ends = _row(head, view, cut=False), _row(feet, view, cut=False)
            told = self._stance.height(*ends, self._height)
        if told is None and self._height < least:
            told = least
        if told is not None:
            told = max(told, least)
            change = _EXTENT_GAIN * math.log(told / self._height)
            change = min(max(change, -_LARGEST_CORRECTION), _LARGEST_CORRECTION)
            self._height *= math.exp(change)

    def _learn(
        self, bins: NDArray[np.int32], inside: FloatMap, place: Place,
        person_rate: float, beside_rate: float,
    ) -> None:  # fmt: skip
        shape = silhouette(place.height)
        cover = np.zeros_like(inside)
        rows, columns = place.span
        cover[rows, columns] = shape.cover
        cover[inside == 0.0] = np.nan
        spans = [
            slice(place.row + strip.first_row,
                  place.row + strip.first_row + strip.weights.shape[0])
            for strip in shape.strips
        ]  # fmt: skip
        self._colours.learn(bins, cover, spans, person_rate, beside_rate)


def _row(end: End | None, view: PersonView, cut: bool) -> float | None:
    """Row in the picture of an end of the body, if it is of this kind."""
    return view.to_picture(0.0, end.row)[1] if end is not None and end.cut == cut else None
