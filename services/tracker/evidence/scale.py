"""How high a person is at each foot row of the image, learned while running.

For a level ground plane and a camera without roll the height in pixels is close to linear in the
foot row: h(y) = a (y - horizon); D. Hoiem, A. Efros & M. Hebert, "Putting objects in perspective",
2008, give the exact form. Candidate lines come from clean blobs and tracked people; the one whose
people explain most of the evidence is taken, and it is used only once it explains enough.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.evidence.arrays import FloatMap, Floats
from heel.services.tracker.evidence.coverage import explained_share, reduce, reduction
from heel.services.tracker.evidence.line import STEEPEST, WIDTH_RATIO, Line, refined
from heel.services.tracker.evidence.runs import Runs

_TOLERANCE = 0.12
"""Relative deviation of a height from a line up to which the sample agrees with it: twice the
deviation of people's heights; chosen by hand."""
_FLATTEST = 0.05
"""Slope below which a drawn line is left out: that of a camera 35 m high, and lines through two
samples of equal height; chosen by hand."""
_SAMPLES = 150
"""Pairs of samples drawn at a refit: enough that some are of two whole people; chosen by hand."""
_CANDIDATES = 6
"""Lines compared on the evidence at a refit, for each costs a search for people; chosen by hand."""
_HORIZONS = (-0.45, -0.15, 0.1, 0.3, 0.5)
"""Image heights below the upper edge: tried when two samples stand too near each other to give a
slope; chosen by hand for cameras that look down to level."""
_APART = 0.1
"""Image heights between the feet of two samples below which they give no slope; chosen by hand."""
_ENOUGH = 0.35
"""Share of the evidence that a line has to explain before it is used; chosen by hand."""
_NEAR = 0.3
"""Image heights from which the samples show near people, of whom there are few: a line through them
may have any slope, so that more is asked of it; chosen by hand, below TUD-Campus with 0.35 and
above cameras on posts with 0.2."""
_LEAST_VOTES = 6
"""Samples of near people below which no line is used; chosen by hand."""
_UNDECIDED = 0.05
"""Share of the evidence by which a line has to explain more than any of a low camera before it is
used; chosen by hand."""
_OVERLONG_SHARE = 0.2
"""Share of the foreground in runs too high for one person, above which a line is not used: with the
right line it is 0.01 to 0.12 on the recordings, with people half as high 0.21 to 0.65."""
_STEEPEST_USED = 0.6
"""Slope from which a line is not used. It is a person's height by the camera's: the lower the
camera, the less a foot row says of the height. TUD-Campus has 1.4 and is better off without a line,
high cameras have 0.2 to 0.4."""
_BLOB_VOTES = 300
"""Blobs kept as samples, the last ones; chosen by hand."""
_PERSON_VOTES = 40
"""Heights kept of one person, the last ones, so that no person outvotes the others; chosen by
hand."""
_PEOPLE = 200
"""People whose heights are kept, the last ones; bounds memory and time, chosen by hand."""
_SETTLED_PEOPLE = 5
"""People from which the line comes from tracked people alone: fewer may all be tall; chosen by
hand."""
_SETTLED_VOTES = 80
"""Heights of people that this takes besides; chosen by hand."""
_FIRST_FRAMES = (2, 3, 4, 5, 7, 9, 12, 16)
"""Frames, from 1, of the first refits: often at first, so that a line is known soon; chosen by
hand."""
_EVERY = 10
"""Frames between refits after those; chosen by hand for time."""
_EVERY_SETTLED = 25
"""Frames between refits of a settled line, which changes slowly; chosen by hand for time."""
_TALLEST_ROWS = 50
"""Reduced pixels: highest person for which lines are compared; more costs time. Chosen by hand."""
_REFINED_AT_ONCE = 8
"""Lines refined in one step of a refit: a step takes a millisecond or two; chosen by hand."""


@dataclass(eq=False)
class Refit:
    """A refit on its way.

    Attributes:
        shift: of the rows when it began, working pixels.
        typical: median height of the samples, working pixels.
        foot, height: of the samples, (N,).
        evidence: (H, W) of the frame it began with.
        drawn: lines through samples, those that most samples agree with first.
        agreeing: (len(drawn), N), which samples agree.
        place: of the next drawn line to be refined.
        candidates: lines to be compared on the evidence, the present one first.
        scores: of those that have been.
        searching: whether candidates are still looked for.
    """

    shift: float
    typical: float
    foot: Floats
    height: Floats
    evidence: FloatMap
    drawn: list[Line] = field(default_factory=list)
    agreeing: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))
    place: int = 0
    candidates: list[Line] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    searching: bool = True
    reduced: dict[int, FloatMap] = field(default_factory=dict)
    """Of the evidence, by factor; computed when it is needed."""


class SceneScale:
    """Height line and whether it may be used.

    Rows are kept as they were in the first frame: a camera that tilts moves all of them at once.

    Attributes:
        known: it may be used.
        refused: it was tried and may not; neither while none has been tried.
        refuted: how many lines were used and then seen to be wrong.
        typical: height of a person, working pixels.
    """

    def __init__(
        self, image_height: int, smallest: float, seed: int = 0, given: Line | None = None
    ) -> None:
        """Start without a line, or with one that stays.

        Args:
            image_height: rows of the working image.
            smallest: lowest person considered, working pixels.
            seed: of the sampling, so that equal input gives equal output.
            given: a line known from elsewhere.
        """
        self.rows = image_height
        self.ratio = WIDTH_RATIO
        self._line = self._anchor = Line(0.0, 0.0)
        self._shift = 0.0
        self.known = False
        self.refused = False
        self.typical = 0.15 * image_height
        self._smallest = smallest
        self.refuted = 0
        self._believed = False
        self._runs = Runs(smallest)
        self._random = np.random.default_rng(seed)
        self._blobs: deque[tuple[float, float]] = deque(maxlen=_BLOB_VOTES)
        self._people: dict[int, deque[tuple[float, float]]] = {}
        self._frame = 0
        self._refit: Refit | None = None
        self._given = given is not None
        if given is not None:
            self._line = self._anchor = given
            self.typical = given.height(0.6 * image_height)
            self.known = given.slope < _STEEPEST_USED
            self.refused = not self.known

    @property
    def line(self) -> Line:
        """The best so far, by the rows of the present frame."""
        return self._line.moved(self._shift)

    @property
    def settled(self) -> bool:
        """True once the line comes from tracked people, or was given, instead of from blobs."""
        if self._given:
            return self.known
        votes = sum(map(len, self._people.values()))
        return len(self._people) >= _SETTLED_PEOPLE and votes >= _SETTLED_VOTES

    def height(self, foot_row: float) -> float:
        """Expected height at a foot row, working pixels; never below 4."""
        return self._line.height(foot_row - self._shift)

    def move(self, shift: float) -> None:
        """The camera has moved everything down by `shift` working pixels."""
        self._shift += shift

    def spread(self) -> float:
        """Standard deviation of ln(height) around the line."""
        return float(np.hypot(0.06, 0.035 * self._line.slope))

    def add_blob(self, foot_row: float, height: float) -> None:
        """A clean person-shaped blob."""
        self._blobs.append((foot_row - self._shift, height))

    def add_person(self, person: int, foot_row: float, height: float) -> None:
        """A tracked person whose height was measured in the open."""
        votes = self._people.setdefault(person, deque(maxlen=_PERSON_VOTES))
        votes.append((foot_row - self._shift, height))
        if len(self._people) > _PEOPLE:
            self._people.pop(next(iter(self._people)))

    def update(self, evidence: FloatMap, believed: bool = True) -> None:
        """Call once a frame with the evidence in [0, 1]: refits when it is time.

        A settled line is refitted a little every frame: all at once it would hold up one frame.

        Args:
            evidence: (H, W) of one frame.
            believed: whether its background is known; before that no line of near people is used.
        """
        if self._given:
            return
        self._believed = believed
        self._frame += 1
        if self._refit is None and self._is_due():
            self._refit = self._begun(evidence)
        if self._refit is None:
            return
        finished = self._step(self._refit)
        while not finished and not self.settled:
            finished = self._step(self._refit)
        if finished:
            self._refit = None

    def _begun(self, evidence: FloatMap) -> Refit | None:
        """A refit to the samples there are, if there are any."""
        votes = [vote for votes in self._people.values() for vote in votes]
        data = np.array(votes if self.settled else [*self._blobs, *votes])
        if len(data) == 0:
            return None
        typical = float(np.median(data[:, 1]))
        refit = Refit(self._shift, typical, data[:, 0], data[:, 1], evidence)
        lines = self._drawn(refit.foot, refit.height)
        if self.known:
            refit.candidates.append(self._polished(refit.foot, refit.height))
        if lines:
            # MSAC, Torr & Zisserman 2000.
            table = np.array(lines)
            predicted = np.maximum(table[:, :1] * refit.foot + table[:, 1:], 0.03 * self.rows)
            error2 = np.minimum((refit.height / predicted - 1.0) ** 2, _TOLERANCE**2)
            order = np.argsort(error2.sum(axis=1), kind="stable")
            refit.drawn = [Line(float(slope), float(offset)) for slope, offset in table[order]]
            refit.agreeing = error2[order] < _TOLERANCE**2
        return refit

    def _step(self, refit: Refit) -> bool:
        """A millisecond or two of a refit; whether it is finished."""
        if refit.searching:
            if self._refine(refit):
                return False
            refit.searching = False
            too_little = float(refit.evidence.sum()) < 0.1 * self._smallest**2
            if not refit.candidates or too_little:
                return True
            if self._believed:  # before, what moves is seen twice
                self._runs.add(refit.evidence, refit.shift)
        if len(refit.scores) < len(refit.candidates):
            self._compare(refit)
            return False
        self._choose(refit.candidates, refit.scores, refit.typical, len(refit.foot))
        return True

    def _refine(self, refit: Refit) -> bool:
        """Refine the next few drawn lines into candidates; whether there may be more."""
        best = slice(refit.place, refit.place + _REFINED_AT_ONCE)
        refit.place = best.stop
        drawn, rows = refit.drawn[best], np.percentile(refit.foot, [5, 95])
        rows = rows + np.array([-0.1, 0.1]) * self.rows
        if not drawn:
            return False
        agreeing = refit.agreeing[best]
        for line in refined(drawn, refit.foot, refit.height, agreeing, self.rows):
            if all(_differ(line, other, rows) for other in refit.candidates):
                refit.candidates.append(line)
            if len(refit.candidates) >= _CANDIDATES:
                return False
        return len(drawn) == _REFINED_AT_ONCE

    def _compare(self, refit: Refit) -> None:
        """Score the next candidate by the evidence that its people explain."""
        line = refit.candidates[len(refit.scores)]
        # Samples may be parts of people that are far higher, whose templates take long.
        step = max(reduction(refit.typical), math.ceil(line.height(self.rows) / _TALLEST_ROWS))
        if step not in refit.reduced:
            refit.reduced[step] = reduce(refit.evidence, 1.0 - refit.evidence, step)
        moved = line.moved(refit.shift)
        share = explained_share(refit.reduced[step], step, moved, self._smallest)
        overlong = self._runs.overlong(line)
        refit.scores.append(share - (overlong if overlong > _OVERLONG_SHARE else 0.0))

    def _is_due(self) -> bool:
        if self.settled:
            return self._frame % _EVERY_SETTLED == 0
        return self._frame in _FIRST_FRAMES or self._frame % _EVERY == 0

    def _choose(
        self, candidates: list[Line], scores: list[float], typical: float, votes: int
    ) -> None:
        was_known = self.known
        if was_known:  # in doubt the present line stays
            scores[0] = 1.1 * scores[0] + 0.02
        best = int(np.argmax(scores))
        ranked = zip(scores, candidates, strict=True)
        steep = max((score for score, line in ranked if line.slope >= _STEEPEST_USED), default=0.0)
        self._line = candidates[best]
        if best > 0 or not self.known:
            self._anchor = self._line
        self.typical = typical
        # A line once good stays, a better one of a low camera does not.
        told = scores[best] > _ENOUGH
        if typical > _NEAR * self.rows:
            told &= self._believed and votes >= _LEAST_VOTES and scores[best] > steep + _UNDECIDED
        enough = was_known or told
        fits = self._runs.overlong(self._line) < _OVERLONG_SHARE
        self.known = enough and fits and self._line.slope < _STEEPEST_USED
        self.refused = not self.known
        if was_known and self.refused:
            # The heights of people that were placed by a wrong line say nothing.
            self.refuted += 1
            self._people.clear()

    def _drawn(self, foot: Floats, height: Floats) -> list[tuple[float, float]]:
        """Slope and offset of lines through two samples each, or one sample and a horizon."""
        lines: list[tuple[float, float]] = []
        for i, j in self._random.integers(0, len(foot), (_SAMPLES, 2)):
            if abs(foot[i] - foot[j]) < _APART * self.rows:
                horizon = _HORIZONS[self._random.integers(len(_HORIZONS))] * self.rows
                slope = height[i] / max(foot[i] - horizon, 1.0)
            else:
                slope = (height[i] - height[j]) / (foot[i] - foot[j])
            if _FLATTEST <= slope < STEEPEST:
                lines.append((slope, height[i] - slope * foot[i]))
        return lines

    def _polished(self, foot: Floats, height: Floats) -> Line:
        """The present line refitted to the samples that agree with it."""
        present = np.array([self._line.height(row) for row in foot])
        inliers = np.abs(height / present - 1.0) < 1.5 * _TOLERANCE
        if inliers.sum() < max(6.0, 0.3 * len(foot)):
            return self._line
        return refined([self._anchor], foot, height, inliers[None], self.rows)[0]


def _differ(a: Line, b: Line, rows: Floats) -> bool:
    """Whether two lines differ by more than 5 % somewhere in the rows seen."""
    return any(abs(np.log(a.height(row) / b.height(row))) > 0.05 for row in rows)
