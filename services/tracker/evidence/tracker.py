"""The fitted tracker: evidence in, people with identities out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from heel.schemas import Blobs, Track
from heel.schemas.tracks import MAX_TRACKS
from heel.services.geometry.calibration_file import Calibration
from heel.services.tracker.evidence.appearance import look_of, painted
from heel.services.tracker.evidence.arrays import FloatMap, Image
from heel.services.tracker.evidence.calibrated import line_of
from heel.services.tracker.evidence.canvas import Canvas, Fit
from heel.services.tracker.evidence.fitting import (
    births,
    births_without_scale,
    fit_people,
    measure_height,
    shares_in_view,
)
from heel.services.tracker.evidence.identity import Identities, Ids
from heel.services.tracker.evidence.kalman import FootFilter
from heel.services.tracker.evidence.lifecycle import (
    CLUTTER_HEIGHT,
    EARLY_S,
    at_border,
    confirm_if_due,
    is_alive,
    is_forgotten,
    is_torn,
    missed_near,
    without_duplicates,
)
from heel.services.tracker.evidence.person import Person
from heel.services.tracker.evidence.report import Reporter
from heel.services.tracker.evidence.samples import Sample, samples_of
from heel.services.tracker.evidence.scale import SceneScale
from heel.services.tracker.report import tracks_of
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace import Trace

_WEIGHT: FloatMap = np.array([0.0, 0.3, 1.0, 1.0, *[0.0] * 252], np.float32)
"""Evidence for a person, 0 to 1, by class of the evidence map, see `heel.schemas.blobs`; chosen by
hand."""
_CANVAS_HEIGHT = 50.0
"""Reduced pixels: height to which people are reduced before they are fitted, for time; chosen by
hand."""
_SEEN_VISIBILITY = 0.35
"""Mean evidence under the silhouette below which a person is missed; chosen by hand."""
_SEEN_INSIDE = 0.3
"""Share of the silhouette inside the image below which a person is missed; chosen by hand."""
_NOISE = 0.03
"""Heights: standard deviation of a fitted foot point in the open; chosen by hand."""
_NOISE_HIDDEN = 0.15
"""Heights: what is added to it for a person of which hardly anything is seen; chosen by hand."""
_CLEAR_GAIN = 0.5
"""Gain from which nothing is added, as the person is in the open; chosen by hand."""
_MEASURE_EVERY = 3
"""Frames from one measurement of a person's height to the next, for time; chosen by hand."""
_MEASURE_GAIN = 0.45
"""Gain from which a height is measured: the person is hardly hidden; chosen by hand."""
_MEASURE_VISIBILITY = 0.5
"""Mean evidence under the silhouette from which a height is measured; chosen by hand."""
_HEIGHT_DEVIATION = 0.12
"""Standard deviation of the logarithm of a measured height: two steps between the heights that are
tried; chosen by hand."""
_LOOK_EVERY = 2
"""Frames from one appearance descriptor of a person to the next, for time; chosen by hand."""
_BIRTH_GAIN = 0.35
"""Least gain of a new person; chosen by hand."""
_MIN_IN_VIEW = 0.25
"""Share of a person that no nearer one covers, below which nothing is measured; chosen by hand."""
_ACCELERATION = 1.2
"""Standard deviation of acceleration [heights/s^2]: people stop and turn within half a second."""


@dataclass(frozen=True, eq=False)
class _Unsettled:
    """What is still to be done of a frame."""

    blobs: Blobs
    evidence: Image
    weighted: FloatMap
    dt_s: float


class FittedTracker:
    """People of one scene.

    Every person is a template at a Kalman-filtered foot point with a height. Each frame all
    templates are fitted jointly to the evidence, so that each pixel is explained once: merged
    blobs fall into people, broken ones belong to one. What is left unexplained gives birth.
    """

    def __init__(
        self, settings: TrackerSettings, next_id: int, calibration: Calibration | None = None,
        trace: Trace | None = None,
    ) -> None:  # fmt: skip
        """Start without people; the first one gets `next_id`."""
        self._trace = trace or Trace()
        self._calibration = calibration
        self._ids = Ids(next_id)
        self._now_s = 0.0
        self._reporting = settings.reporting("foreground")
        self._identifies = settings.identify
        self._people: list[Person] = []
        self._scale: SceneScale | None = None
        self._canvas: Canvas | None = None
        self._shape: tuple[int, ...] = (0, 0)
        self._frame = 0
        self._identities = Identities(self._ids, self._trace)
        self._unsettled: _Unsettled | None = None

    @property
    def next_id(self) -> int:
        """The id of the next person."""
        return self._ids.next

    def update(self, blobs: Blobs, evidence: Image | None, dt_s: float) -> list[Track]:
        """Tracks of one frame, by id.

        Args:
            blobs: the message.
            evidence: its evidence map, (H, W) uint8; without one people are only predicted, and
                with one of another size than before all people are forgotten.
            dt_s: seconds since the frame before.
        """
        self.settle()
        if evidence is not None and evidence.shape != self._shape:
            rows = evidence.shape[0]
            self._shape = evidence.shape
            given = line_of(self._calibration, self._shape) if self._calibration else None
            smallest = CLUTTER_HEIGHT * self._reporting.min_height * rows
            self._scale = SceneScale(rows, smallest, given=given)
            self._people = []
            self._identities = Identities(self._ids, self._trace)
            self._canvas = None
        if self._scale is None:
            return []
        self._frame += 1
        self._now_s += dt_s
        self._carry(blobs, self._scale)
        for person in self._people:
            person.predict(dt_s, self._scale)
        if evidence is None:
            self._people = [person for person in self._people if self._outlasts(person, dt_s)]
        else:
            self._take_in(blobs, evidence, self._scale, dt_s)
        reporter = Reporter(blobs, self._shape, self._scale, self._reporting)
        return tracks_of(reporter.reports(self._people))

    def settle(self) -> None:
        """Take in appearance and the scene's scale of the frame before, unless that is done.

        Nothing of it changes that frame's tracks, so that they need not wait for it.
        """
        frame, self._unsettled = self._unsettled, None
        if frame is not None and self._scale is not None:
            if self._identifies:
                self._identify(frame.blobs, frame.evidence, self._scale.ratio, frame.dt_s)
            self._scale.update(frame.weighted)

    def _carry(self, blobs: Blobs, scale: SceneScale) -> None:
        """Warp people and the scale by the camera's motion, where there is any."""
        motion = blobs.camera_motion
        if motion is None or motion.quality == 0.0:
            return
        rows, columns = self._shape[:2]
        scale_x, scale_y = blobs.width / columns, blobs.height / rows
        affine = np.array(motion.affine).reshape(2, 3)
        affine *= [[1.0, scale_y / scale_x, 1.0 / scale_x], [scale_x / scale_y, 1.0, 1.0 / scale_y]]
        for person in self._people:
            person.carry(affine)
        self._identities.carry(affine)
        centre = np.array([0.5 * columns, 0.5 * rows])
        scale.move(float(affine[1, :2] @ centre + affine[1, 2] - centre[1]))

    def _outlasts(self, person: Person, dt_s: float) -> bool:
        person.miss(dt_s)
        return not is_forgotten(person, self._reporting.forget_s)

    def _take_in(self, blobs: Blobs, evidence: Image, scale: SceneScale, dt_s: float) -> None:
        weighted = np.asarray(cv2.LUT(evidence, _WEIGHT), np.float32)
        canvas = self._loaded(weighted, scale)
        fits = fit_people(canvas, self._people, scale.ratio)
        in_view = shares_in_view(canvas, self._people, fits)
        for person in self._people:
            person.in_view = in_view[person.id]
            self._measure(canvas, person, fits.get(person.id), dt_s, scale)
        self._confirm(evidence, scale.ratio, dt_s)
        people = without_duplicates(self._people, scale.ratio, dt_s)
        self._people = [
            person for person in people if is_alive(person, canvas, scale.ratio, self._reporting)
        ]
        samples = [] if scale.known and scale.settled else samples_of(evidence)
        self._give_birth(canvas, scale, samples)
        for sample in samples:
            scale.add_blob(sample.foot[1], sample.height)
        self._unsettled = _Unsettled(blobs, evidence, weighted, dt_s)

    def _loaded(self, evidence: FloatMap, scale: SceneScale) -> Canvas:
        lowest = scale.height(evidence.shape[0] * 1.1)
        tallest = max([lowest, *(person.height for person in self._people)])
        step = max(1, round(scale.typical / _CANVAS_HEIGHT))
        canvas = self._canvas
        if canvas is None or canvas.step != step or not tallest <= canvas.tallest <= 2 * tallest:
            size = (evidence.shape[0], evidence.shape[1])
            canvas = self._canvas = Canvas(size, 1.2 * tallest, step, scale.ratio)
        canvas.load(evidence)
        return canvas

    def _measure(
        self, canvas: Canvas, person: Person, fit: Fit | None, dt_s: float, scale: SceneScale
    ) -> None:
        person.fitted_foot = person.foot if fit is None else fit.foot
        shape = canvas.template(person.height)
        person.visibility, person.inside = canvas.visibility(shape, person.fitted_foot)
        person.gain = 0.0 if fit is None else fit.gain
        visible = person.visibility > _SEEN_VISIBILITY and person.inside > _SEEN_INSIDE
        in_view = person.in_view > _MIN_IN_VIEW
        if fit is None or not (visible and in_view and person.gain > 0.0):
            person.miss(dt_s)
            return
        hidden = float(np.clip((_CLEAR_GAIN - person.gain) / _CLEAR_GAIN, 0.0, 1.0))
        person.see(fit.foot, (_NOISE + _NOISE_HIDDEN * hidden**2) * person.height)
        clear = person.gain > _MEASURE_GAIN and person.visibility > _MEASURE_VISIBILITY
        if clear and (self._frame + person.id) % _MEASURE_EVERY == 0:
            measured = measure_height(canvas, person, fit)
            if measured is not None:
                height, foot_row = measured
                if person.confirmed:
                    scale.add_person(person.id, foot_row, height)
                person.correct_height(height, _HEIGHT_DEVIATION)

    def _identify(self, blobs: Blobs, evidence: Image, ratio: float, dt_s: float) -> None:
        people = [person for person in self._people if person.confirmed]
        self._identities.meet(people, ratio, dt_s)
        due = [
            person
            for person in people
            if person.is_in_the_open and (self._frame + person.id) % _LOOK_EVERY == 0
        ]
        if due:
            picture = painted(blobs, evidence)
            for person in due:
                look = look_of(picture, evidence, person.box(ratio))
                if look is not None:
                    self._identities.see(person, look)
            self._identities.decide(people, self._now_s)
            self._people = [person for person in self._people if not person.is_replaced]

    def _confirm(self, evidence: Image, ratio: float, dt_s: float) -> None:
        """Confirm people; one that loses much evidence to a newcomer was two people in one box."""
        seen = [person for person in self._people if person.missed_frames == 0]
        for newcomer in [each for each in seen if confirm_if_due(each, evidence, ratio, dt_s)]:
            for person in seen:
                if self._identifies and person.confirmed and is_torn(person, newcomer):
                    self._identities.give_up(person, self._people)

    def _give_birth(self, canvas: Canvas, scale: SceneScale, samples: Sequence[Sample]) -> None:
        """New people, unless a person that has just been missed is within reach."""
        smallest = CLUTTER_HEIGHT * self._reporting.min_height * scale.rows
        born: list[tuple[Fit, float]] = []
        if scale.known:
            born = births(canvas, self._people, scale, smallest, _BIRTH_GAIN)
        elif scale.refused:
            large = [sample for sample in samples if sample.height > smallest]
            born = births_without_scale(canvas, self._people, large, _BIRTH_GAIN)
        for fit, height in born:
            missed = missed_near(self._people, fit, height)
            if missed is not None:
                missed.reacquire(fit.foot, height, fit.gain)
            elif len(self._people) < MAX_TRACKS:
                speed_y = 0.5 / (1.0 + 2.0 * scale.line.slope)
                foot = FootFilter(fit.foot, height, _ACCELERATION, speed_y)
                person = Person(self._ids.take(), foot, height, fit.foot, fit.gain)
                person.born_early = self._now_s < EARLY_S
                person.born_at_border = at_border(person, self._shape, scale.ratio)
                self._people.append(person)
