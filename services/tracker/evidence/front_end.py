"""The evidence map as measurements of people: silhouettes at a height line, fitted jointly.

Every track is a template at its predicted foot point. Each frame all templates are fitted jointly
to the evidence, so that each pixel is explained once: merged regions fall into people, broken ones
belong to one. What is left unexplained gives birth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from heel.schemas import Blobs
from heel.schemas.blobs import FOREGROUND
from heel.schemas.tracks import MAX_TRACKS
from heel.services.geometry.boxes import cover_of_smaller
from heel.services.geometry.calibration_file import Calibration
from heel.services.tracker.evidence.arrays import FloatMap, Image
from heel.services.tracker.evidence.canvas import Canvas, Fit
from heel.services.tracker.evidence.fitting import (
    births,
    births_without_scale,
    fit_people,
    measure_height,
    shares_in_view,
)
from heel.services.tracker.evidence.lifecycle import (
    CLUTTER_HEIGHT,
    EARLY_S,
    is_alive,
    is_person,
    is_torn,
    missed_near,
    observe_motion,
    without_duplicates,
)
from heel.services.tracker.evidence.line import line_of
from heel.services.tracker.evidence.pixels import painted
from heel.services.tracker.evidence.samples import Sample, samples_of
from heel.services.tracker.evidence.scale import SceneScale
from heel.services.tracker.evidence.silhouette import Silhouette, Working
from heel.services.tracker.people import kalman
from heel.services.tracker.people.appearance import cut_out, describe
from heel.services.tracker.people.front_end import UNSEEN, Scene
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.track import Track
from heel.services.tracker.settings import Reporting

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
"""Gain from which a height is measured, or a descriptor taken: the person is hardly hidden; chosen
by hand."""
_MEASURE_VISIBILITY = 0.5
"""Mean evidence under the silhouette from which this is so; chosen by hand."""
_HEIGHT_DEVIATION = 0.1
"""Standard deviation of the logarithm of a measured height: two steps between the heights that are
tried; chosen by hand."""
_ASPECT_DEVIATION = 0.05
"""Standard deviation of ln(width / height) of a silhouette, whose width follows its height; chosen
by hand."""
_LINE_DEVIATION = 0.09
"""Standard deviation of ln(height) about the scene's line in one second; chosen by hand."""
_LIMIT_DEVIATIONS = 5.0
"""Deviations around the scene's line beyond which no height may be: wide, for it only stops a
height that runs away; chosen by hand."""
_LOOK_EVERY = 2
"""Frames from one appearance descriptor of a person to the next, for time; chosen by hand."""
_BIRTH_GAIN = 0.35
"""Least gain of a new person; chosen by hand."""
_MIN_IN_VIEW = 0.25
"""Share of a person that no nearer one covers, below which nothing is measured; chosen by hand."""
_FREE_VIEW = 0.8
"""The same above which the person counts as covered by no other one; chosen by hand."""
_ALONE_VIEW = 0.5
"""The same from which the person is measured alone: as `Report.alone` says."""
_OPEN_INSIDE = 0.9
"""Share of the silhouette inside the image from which a person is in the open; chosen by hand."""
_CONTACT = 0.25
"""Share of the smaller overlap of two silhouettes from which two people are in contact; chosen by
hand."""
_MIXED_S = 5.0
"""Seconds of occlusion after which two tracks are exchanged with a probability of one half but for
1/e of it: crossings of half a second seldom exchange them, long ones leave nothing to tell by;
chosen by hand."""
_CUT_STANDING = 0.05
"""Share of a far person's height that the upper edge may cut off for a standing camera, which sees
the far end of the scene there: more of it costs MOTA on Town Centre."""
_CUT_MOVING = 0.4
"""The same for a moving camera, which sees anything there when it tilts: less of it costs MOTA on a
panned window of PETS09-S2L1."""


@dataclass(frozen=True, eq=False)
class EvidenceFrame:
    """One frame.

    Attributes:
        blobs: the message.
        evidence: its evidence map, (H, W) uint8, of the same size in all frames; without one
            people are only predicted.
    """

    blobs: Blobs
    evidence: Image | None


class EvidenceFrontEnd:
    """Fits silhouettes to evidence, and learns how high people are in this scene."""

    detection_rate = 0.0
    """Births and deaths rest on the fit, not on a detector's misses."""

    def __init__(
        self, reporting: Reporting, identify: bool = True, calibration: Calibration | None = None
    ) -> None:
        """Start without people.

        Args:
            reporting: from which height a person is looked for and shown, and for how long unseen.
            identify: whether descriptors are taken.
            calibration: how the camera is mounted; None to learn the scene's scale.
        """
        self.pictures = identify
        self._reporting = reporting
        self._calibration = calibration
        self._of: dict[Track, Silhouette] = {}
        self._scale: SceneScale | None = None
        self._canvas: Canvas | None = None
        self._working = Working(1, 1, 1.0, 1.0)
        self._evidence: Image | None = None
        self._unsettled: FloatMap | None = None
        self._believed = False
        self._may_be_cut = _CUT_STANDING
        self._births = self._frame = 0
        self._now_s = self._elapsed_s = 0.0

    def settle(self) -> None:
        """Take in the scene's scale of the frame before; no tracks of that frame depend on it."""
        weighted, self._unsettled = self._unsettled, None
        if weighted is None or self._scale is None:
            return
        refuted = self._scale.refuted
        self._scale.update(weighted, self._believed)
        if self._scale.refuted > refuted:  # those whom a wrong line has placed are none
            self._of = {}

    def measure(self, frame: EvidenceFrame, scene: Scene) -> Measured:
        """Fit the silhouettes of all tracks to a frame's evidence."""
        self.settle()
        self._frame += 1
        self._now_s, self._elapsed_s = scene.t_s, scene.elapsed_s
        self._may_be_cut = _CUT_STANDING if frame.blobs.camera_motion is None else _CUT_MOVING
        scale = self._scale = self._scale or self._new_scale(frame)
        self._evidence = frame.evidence
        if scale is None:
            return Measured()
        self._predict(scene, scale)
        if frame.evidence is None:
            for silhouette in self._of.values():
                silhouette.missed_frames += 1
            return Measured()
        self._unsettled = np.asarray(cv2.LUT(frame.evidence, _WEIGHT), np.float32)
        self._believed = frame.blobs.background == "valid"
        people = list(self._of.values())
        canvas = self._canvas = self._loaded(self._unsettled, scale)
        fits = fit_people(canvas, people, scale.ratio)
        in_view = shares_in_view(canvas, people, fits)
        measured = Measured()
        for track, silhouette in self._of.items():
            silhouette.in_view = in_view[silhouette.id]
            fit = fits.get(silhouette.id)
            if self._sees(silhouette, fit, canvas) and fit is not None:
                measured.singles.append(self._measurement(track, silhouette, fit, canvas, scale))
            else:
                silhouette.missed_frames += 1
        self._meet(measured, scale.ratio)
        self._describe(measured, frame.blobs, frame.evidence)
        return measured

    def _new_scale(self, frame: EvidenceFrame) -> SceneScale | None:
        if frame.evidence is None:
            return None
        rows, columns = frame.evidence.shape
        blobs = frame.blobs
        self._working = Working(columns, rows, blobs.width / columns, blobs.height / rows)
        given = line_of(self._calibration, (rows, columns)) if self._calibration else None
        return SceneScale(rows, self._smallest(), given=given)

    def _smallest(self) -> float:
        return CLUTTER_HEIGHT * self._reporting.min_height * self._working.rows

    def _predict(self, scene: Scene, scale: SceneScale) -> None:
        """Place silhouettes where tracks are predicted; heights keep to the line."""
        before = {track: scale.height(each.foot[1]) for track, each in self._of.items()}
        if scene.camera is not None and scene.camera.quality > 0.0:
            matrix, working = scene.camera.matrix, self._working
            middle = np.array([0.5 * working.columns, 0.5 * working.rows])
            across = matrix[1, 0] * middle[0] * working.scale_x / working.scale_y
            moved = across + matrix[1, 1] * middle[1] + matrix[1, 2] / working.scale_y
            scale.move(float(moved - middle[1]))
        self._of = {track: self._of[track] for track in scene.tracks if track in self._of}
        for track, silhouette in self._of.items():
            silhouette.confirmed = track.confirmed
            silhouette.foot, silhouette.height = self._working.place(track.mean)
            silhouette.moved = silhouette.moved_from(track.birthplace, self._working)
            if scale.known:
                expected = scale.height(silhouette.foot[1])
                self._hold(track, silhouette, math.log(expected / before[track]), scale)

    def _hold(self, track: Track, silhouette: Silhouette, growth: float, scale: SceneScale) -> None:
        """Let the height follow the scene's line, the foot point staying where it is.

        Args:
            growth: of the line's height since the frame before, as a logarithm.
        """
        height = silhouette.height * math.exp(growth)
        away = math.log(height / scale.height(silhouette.foot[1]))
        limit = _LIMIT_DEVIATIONS * scale.spread()
        row = track.covariance[2]
        variance = _LINE_DEVIATION**2 / max(self._elapsed_s, 1e-3)
        gain = row[:, 0] / (row[0, 0] + variance)
        beyond = away - min(max(away, -limit), limit)
        track.mean[2] += np.array([growth - beyond, 0.0]) - gain * (away - beyond)
        track.covariance[2] = row - np.outer(gain, row[0])
        self._stand(track, silhouette)

    def _stand(self, track: Track, silhouette: Silhouette) -> None:
        """Bring the track's centre to where its height puts it above the foot point."""
        _, silhouette.height = self._working.place(track.mean)
        value = self._working.measurement(silhouette.foot, silhouette.height, 1.0)
        track.mean[1, 0] = value[1]

    def _loaded(self, evidence: FloatMap, scale: SceneScale) -> Canvas:
        lowest = scale.height(evidence.shape[0] * 1.1)
        tallest = max([lowest, *(person.height for person in self._of.values())])
        step = max(1, round(scale.typical / _CANVAS_HEIGHT))
        canvas = self._canvas
        if canvas is None or canvas.step != step or not tallest <= canvas.tallest <= 2 * tallest:
            size = (evidence.shape[0], evidence.shape[1])
            canvas = Canvas(size, 1.2 * tallest, step, scale.ratio)
        canvas.load(evidence)
        return canvas

    def _sees(self, silhouette: Silhouette, fit: Fit | None, canvas: Canvas) -> bool:
        silhouette.fitted_foot = silhouette.foot if fit is None else fit.foot
        shape = canvas.template(silhouette.height)
        silhouette.visibility, silhouette.inside = canvas.visibility(shape, silhouette.fitted_foot)
        silhouette.gain = 0.0 if fit is None else fit.gain
        visible = silhouette.visibility > _SEEN_VISIBILITY and silhouette.inside > _SEEN_INSIDE
        return visible and silhouette.in_view > _MIN_IN_VIEW and silhouette.gain > 0.0

    def _measurement(
        self, track: Track, silhouette: Silhouette, fit: Fit, canvas: Canvas, scale: SceneScale
    ) -> Measurement:
        silhouette.hits += 1
        silhouette.missed_frames = 0
        silhouette.best_gain = max(silhouette.best_gain, silhouette.gain)
        if silhouette.in_view > _FREE_VIEW:
            silhouette.gains.append(silhouette.gain)
        clear = silhouette.gain > _MEASURE_GAIN and silhouette.visibility > _MEASURE_VISIBILITY
        height, log_variance = silhouette.height, kalman.UNKNOWN
        if clear and (self._frame + silhouette.id) % _MEASURE_EVERY == 0:
            found = measure_height(canvas, silhouette, fit)
            if found is not None:
                if track.confirmed:
                    scale.add_person(silhouette.id, found[1], found[0])
                row = track.covariance[2, :, 0]
                gain = row / (row[0] + _HEIGHT_DEVIATION**2)
                # Taken in at once, so that the centre is measured for the height that results.
                track.mean[2] += gain * math.log(found[0] / height)
                track.covariance[2] -= np.outer(gain, track.covariance[2, 0])
                self._stand(track, silhouette)
                height = silhouette.height
        hidden = float(np.clip((_CLEAR_GAIN - silhouette.gain) / _CLEAR_GAIN, 0.0, 1.0))
        noise = (_NOISE + _NOISE_HIDDEN * hidden**2) * height
        working = self._working
        variance = [
            (noise * working.scale_x) ** 2, (noise * working.scale_y) ** 2, log_variance,
            _ASPECT_DEVIATION**2,
        ]  # fmt: skip
        return Measurement(
            track,
            np.array(working.measurement(fit.foot, height, scale.ratio)),
            np.array(variance),
            alone=silhouette.in_view >= _ALONE_VIEW,
            clear=clear and silhouette.in_view > _FREE_VIEW and silhouette.inside > _OPEN_INSIDE,
        )

    def _meet(self, measured: Measured, ratio: float) -> None:
        """Note contacts; while one hides the other, the tracks may be exchanged."""
        confirmed = [(t, s, s.box(ratio)) for t, s in self._of.items() if t.confirmed]
        rivals: dict[Track, list[Track]] = {}
        for first, (track, own, box) in enumerate(confirmed):
            for other, theirs, others_box in confirmed[:first]:
                if cover_of_smaller(box, others_box) <= _CONTACT:
                    continue
                measured.met.append((other, track))
                if min(own.in_view, theirs.in_view) < _FREE_VIEW:
                    rivals.setdefault(track, []).append(other)
                    rivals.setdefault(other, []).append(track)
        exchanged = 0.5 * (1.0 - math.exp(-self._elapsed_s / _MIXED_S))
        for one in measured.singles:
            others = rivals.get(one.track, [])
            if others:
                one.rivals, one.best, one.rival = exchanged * len(others), exchanged, others[0]

    def _describe(self, measured: Measured, blobs: Blobs, evidence: Image) -> None:
        """Take descriptors of people in the open, of each in every other frame."""
        due = [
            one
            for one in measured.singles
            if one.clear and (self._frame + self._of[one.track].id) % _LOOK_EVERY == 0
        ]
        if not (self.pictures and due):
            return
        ratio = self._scale.ratio if self._scale else 1.0
        boxes = np.array([self._of[one.track].box(ratio) for one in due])
        masks = cut_out(evidence >= FOREGROUND, boxes)
        looks = describe(cut_out(painted(blobs, evidence), boxes), masks)
        for one, look in zip(due, looks, strict=True):
            one.look = look

    def take_stock(self, tracks: list[Track], measured: Measured, t_s: float) -> list[Track]:
        """Drop doubles and those gone out of the picture; give birth where evidence is left."""
        scale, canvas, evidence = self._scale, self._canvas, self._evidence
        if scale is None or canvas is None or evidence is None:
            return tracks
        for track, silhouette in self._of.items():
            silhouette.foot, silhouette.height = self._working.place(track.mean)
            silhouette.moved = silhouette.moved_from(track.birthplace, self._working)
            if silhouette.missed_frames == 0:
                observe_motion(silhouette, evidence, scale.ratio, self._elapsed_s)
        people = without_duplicates(list(self._of.values()), scale.ratio, self._elapsed_s)
        alive = {
            person.id for person in people if is_alive(person, canvas, scale.ratio, self._reporting)
        }
        self._of = {track: each for track, each in self._of.items() if each.id in alive}
        samples = [] if scale.known and scale.settled else samples_of(evidence)
        born = self._born(canvas, scale, samples, t_s)
        for sample in samples:
            scale.add_blob(sample.foot[1], sample.height)
        return [track for track in tracks if track in self._of] + born

    def _born(
        self, canvas: Canvas, scale: SceneScale, samples: Sequence[Sample], t_s: float
    ) -> list[Track]:
        """New people, unless a person that has just been missed is within reach."""
        found: list[tuple[Fit, float]] = []
        people = list(self._of.values())
        if scale.known:
            found = births(canvas, people, scale, self._smallest(), _BIRTH_GAIN)
        elif scale.refused:
            large = [sample for sample in samples if sample.height > self._smallest()]
            found = births_without_scale(canvas, people, large, _BIRTH_GAIN)
        born = []
        for fit, height in found:
            value = np.array(self._working.measurement(fit.foot, height, scale.ratio))
            missed = missed_near(self._of, fit, height, t_s)
            if missed is not None:
                self._jump(missed, value, fit, height, t_s)
            elif len(self._of) < MAX_TRACKS:
                mean, covariance = kalman.initial_state(value[None])
                track = Track.born(mean[0], covariance[0], 1.0, t_s)
                self._births += 1
                silhouette = Silhouette(self._births, fit.foot, height, fit.gain)
                silhouette.born_early = self._now_s < EARLY_S
                silhouette.birth_height = height
                self._of[track] = silhouette
                born.append(track)
        return born

    def _jump(self, track: Track, value: np.ndarray, fit: Fit, height: float, t_s: float) -> None:
        """Seen again a little away from the prediction: keep the velocity, go there."""
        silhouette = self._of[track]
        track.jump(value, t_s)
        silhouette.foot, silhouette.height, silhouette.gain = fit.foot, height, fit.gain
        silhouette.missed_frames = 0
        silhouette.hits += 1

    def ready(self, tracks: Sequence[Track]) -> list[Track]:
        """New tracks seen several times and moving: ghosts and lamps never move."""
        return [
            track
            for track in tracks
            if not track.confirmed and track in self._of and is_person(self._of[track])
        ]

    def parted(self, newcomer: Track, tracks: Sequence[Track]) -> list[Track]:
        """Known tracks that lose much evidence to a newcomer: they were two people in one box."""
        if not self.pictures:
            return []
        fresh = self._of[newcomer]
        return [
            track
            for track in tracks
            if track.confirmed and track in self._of and is_torn(self._of[track], fresh)
        ]

    @property
    def doubt(self) -> str:
        """Nobody is born before the sizes of people are known, or known not to fit a line."""
        if self._scale is None or self._scale.known or self._scale.refused:
            return ""
        return "the sizes of people in this picture are not known yet: somebody has to walk"

    def hides(self, track: Track, t_s: float, at_side: bool) -> str:
        """A person is shown that is large enough, the head in view, and not unseen for long.

        Hidden people are shown longer than people that are simply not where they should be.
        """
        silhouette = self._of.get(track)
        if silhouette is None:
            return UNSEEN
        if not track.confirmed:
            return "has not moved enough yet"
        hidden = silhouette.in_view < _ALONE_VIEW
        patience_s = self._reporting.show_missed_s * (1.0 if hidden else 0.5)
        rows, height = self._working.rows, silhouette.height
        head = silhouette.foot[1] - height
        whole = head > -self._may_be_cut * height or height > 0.5 * rows
        large = height > self._reporting.min_height * rows
        if t_s - track.seen_s > patience_s:
            return UNSEEN
        if not whole:
            return "the head is out of the picture"
        return "" if large else "too small, or smaller than tracker.min_height"
