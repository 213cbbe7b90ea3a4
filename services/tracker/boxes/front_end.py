"""Boxes of a detector as measurements of people: one assignment for all tracks at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heel.services.tracker.boxes.frame import FrameBoxes
from heel.services.tracker.boxes.groups import (
    LONGEST_S,
    choose_merges,
    merge_candidates,
)
from heel.services.tracker.boxes.newcomers import WALKER_SCORE, newborn, ready_tracks
from heel.services.tracker.boxes.score_scale import ScoreScale
from heel.services.tracker.people import kalman
from heel.services.tracker.people.association import (
    marginals,
    newcomer_log_density,
    pair_log_odds,
)
from heel.services.tracker.people.front_end import UNSEEN, Scene
from heel.services.tracker.people.geometry import FloatArray, crowding, measurements_to_boxes
from heel.services.tracker.people.identity import CLEAR
from heel.services.tracker.people.looks import MOST_AGAINST
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.merged import Merge
from heel.services.tracker.people.track import Track
from heel.services.tracker.people.tuning import Tuning

_EPSILON_S = 1e-6
"""Slack of comparisons of times [s], below any frame's."""
_KEEP_SCORE = 0.3
"""Least score of a box that is used at all, share of a usual person's; chosen by hand."""
_DETECTION_RATE = 0.75
"""Probability that a visible person gets a box; chosen by hand."""
_HIDING = 0.55
"""Share of the detection rate that is lost where another person covers the whole box; chosen by
hand."""
_CONTACT = 0.02
"""Probability that a box is the other track's from which two tracks are in contact; chosen by
hand."""
_CUT_NOISE = 3.0
"""Factor on the variance of a box that the side of the picture cuts off; chosen by hand."""
_AT_SIDE_PX = 2.0
"""Distance from the side within which a box is cut off [px]; chosen by hand."""
_PRESENT_S = 0.25
"""Time without a box up to which a track counts as present [s]; chosen by hand."""


class BoxFrontEnd:
    """Associates a frame's boxes with the tracks, by motion and appearance.

    Log odds of every pair, merged boxes as further hypotheses, the most probable assignment of all,
    and the probability that each box is another track's after all.
    """

    detection_rate = _DETECTION_RATE
    doubt = ""

    def __init__(self, tuning: Tuning, image_size: tuple[int, int] | None = None) -> None:
        """Start without a scale of scores.

        Args:
            tuning: thresholds.
            image_size: (width, height) in pixels; where it is not known no box is too small, and
                none cut off.
        """
        self.pictures = False
        self._tuning = tuning
        self._columns, self._rows = image_size or (0, 0)
        self._scale = ScoreScale()
        self._frame: FrameBoxes | None = None
        self._free: list[int] = []
        self._raw_of_track: list[tuple[Track, float]] = []

    def settle(self) -> None:
        """Nothing waits."""

    def measure(self, frame: FrameBoxes, scene: Scene) -> Measured:
        """Associate boxes with tracks; boxes of low scores are left out."""
        self.pictures = frame.looks is not None
        frame = replace(frame, scores=self._scale.normalised(frame.raw))
        frame = frame.select(frame.scores >= _KEEP_SCORE)
        self._frame = frame
        pairs, merges, sure = self._associate(frame, scene)
        used = {j for _, j in pairs} | {j for _, j in merges}
        self._free = [j for j in range(len(frame.boxes)) if j not in used]
        self._raw_of_track = [(scene.tracks[i], float(frame.raw[j])) for i, j in pairs]
        tracks = scene.tracks
        met = [
            (tracks[i], tracks[k])
            for i, j in pairs
            for k in np.flatnonzero(sure[:, j] >= _CONTACT).tolist()
            if k != i
        ]
        merged = [Merge((tracks[i], tracks[k]), frame.boxes[j]) for (i, k), j in merges]
        singles = self._singles(frame, scene, pairs, sure)
        return Measured(singles, merged, met + [merge.tracks for merge in merged])

    def _singles(
        self, frame: FrameBoxes, scene: Scene, pairs: list[tuple[int, int]], sure: FloatArray
    ) -> list[Measurement]:
        if not pairs:
            return []
        seen, alone = frame.measurements(), crowding(frame.boxes) <= CLEAR
        noise = self._noise(frame)[[j for _, j in pairs]]
        variance = kalman.measurement_variance(scene.mean[[i for i, _ in pairs], :, 0])
        variance = noise[:, None] * variance
        singles = []
        for k, (i, j) in enumerate(pairs):
            others = np.delete(sure[:, j], i)
            rivals = [index for index in range(len(sure)) if index != i]
            best = float(others.max(initial=0.0))
            singles.append(
                Measurement(
                    scene.tracks[i],
                    seen[j],
                    variance[k],
                    score=float(frame.scores[j]),
                    clear=bool(alone[j]),
                    look=None if frame.looks is None else frame.looks[j],
                    proven=bool(frame.proven[j]),
                    rivals=float(others.sum()),
                    best=best,
                    rival=scene.tracks[rivals[int(np.argmax(others))]] if best > 0 else None,
                )
            )
        return singles

    def _associate(
        self, frame: FrameBoxes, scene: Scene
    ) -> tuple[list[tuple[int, int]], list[tuple[tuple[int, int], int]], FloatArray]:
        """Pairs (track, box), merges ((track, track), box), and probabilities (N, M) of pairs."""
        tracks, boxes, seen = scene.tracks, frame.boxes, frame.measurements()
        if not tracks or len(boxes) == 0:
            return [], [], np.zeros((len(tracks), len(boxes)))
        exist = _DETECTION_RATE * np.array([track.existence for track in tracks])
        rates = exist * (1 - _HIDING * scene.hidden)
        log_odds = pair_log_odds(scene.mean, scene.covariance, rates, seen, self._noise(frame))
        if frame.looks is not None:
            log_odds += self._look_odds(boxes, frame.looks, scene)
        members = [
            k
            for k, track in enumerate(tracks)
            if track.confirmed and scene.t_s - track.alone_s <= LONGEST_S
        ]
        candidates = merge_candidates(
            members,
            measurements_to_boxes(scene.mean[:, :, 0]),
            boxes,
            exist,
            newcomer_log_density(seen),
        )
        pairs, merges, log_odds = choose_merges(log_odds, candidates)
        return pairs, [(merge.tracks, merge.box) for merge in merges], marginals(log_odds)

    def _look_odds(self, boxes: FloatArray, looks: FloatArray, scene: Scene) -> FloatArray:
        """Log odds (N, M) of appearance; they cannot refuse a box to a present, uncovered track."""
        present = np.array(
            [
                track.confirmed
                and scene.t_s - track.seen_s <= _PRESENT_S + _EPSILON_S
                and hidden <= CLEAR
                and not scene.identity.open(track)
                for track, hidden in zip(scene.tracks, scene.hidden, strict=True)
            ]
        )
        against = np.where(present, self._tuning.most_against_present, MOST_AGAINST)
        odds = scene.identity.log_odds(scene.tracks, boxes, looks)
        return np.asarray(np.maximum(odds, -against[:, None]))

    def _noise(self, frame: FrameBoxes) -> FloatArray:
        """Factor (M,) on the variance of boxes: more where the picture's side cuts them off.

        Where place alone tells people apart, those who come and go at the side would be taken for
        one another (wrong 6.9 -> 11.5 % on ETH-Pedcross2): there it is 1.
        """
        boxes = frame.boxes
        if not self._columns or frame.looks is None:
            return np.ones(len(boxes))
        cut = (boxes[:, 0] <= _AT_SIDE_PX) | (boxes[:, 2] >= self._columns - _AT_SIDE_PX)
        return np.where(cut, _CUT_NOISE, 1.0)

    def take_stock(self, tracks: list[Track], measured: Measured, t_s: float) -> list[Track]:
        """Learn the scale of scores; all tracks go on, and free boxes start new ones."""
        continued = [raw for track, raw in self._raw_of_track if track.hits > 2]
        self._scale.learn(np.array(continued))
        if self._frame is None:
            return tracks
        return tracks + newborn(self._frame, self._free, tracks, t_s, self._tuning)

    def ready(self, tracks: Sequence[Track]) -> list[Track]:
        """New tracks with boxes enough, and high enough while nearer people are in sight."""
        return ready_tracks(tracks, self._tuning.near_height * self._rows, self._tuning)

    def parted(self, newcomer: Track, tracks: Sequence[Track]) -> list[Track]:
        """None: descriptors tell, see `people.verification`."""
        return []

    def hides(self, track: Track, t_s: float, at_side: bool) -> str:
        """A track is shown that has had a box lately, of a good score; at the side it has left."""
        coast_s = 0.0 if at_side else self._tuning.show_missed_s
        if t_s - track.seen_s > coast_s + _EPSILON_S:
            return UNSEEN
        if not track.confirmed:
            return "seen too seldom so far, or too far off beside nearer people"
        if track.mean_score < (WALKER_SCORE if track.walked else self._tuning.hidden_score):
            return "the detector is not sure enough"
        small = track.height_px() < self._tuning.min_height * self._rows
        return "smaller than tracker.min_height" if small else ""
