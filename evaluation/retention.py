"""keep% and wrong%: does the identity that was chosen stay on the person it was chosen for?

The follower's question, asked of every person in turn:

1. In each frame, people and output boxes are paired one to one at the highest total IoU; pairs
   below the threshold do not count (Kuhn-Munkres; identities play no part in it).
2. A person is chosen in the first frame in which an output box is paired with them. That box's
   identity is held from then on and never chosen again.
3. Counted are the person's *remaining* frames: those after the frame of the choice in which the
   person is in the ground truth.
   *keep*: the box paired with the person bears the held identity.
   *wrong*: the held identity is paired with another person of the ground truth.
   The rest is *lost*: the held identity is not shown, or its box is paired with nobody.
4. Frames are summed over all people before dividing, so a person seen for long weighs more. People
   on whom no box ever was were never chosen and do not count here (they are misses, FN).

"Chosen at first sight" allows other readings. This is the only one of 32 that reproduces all of 15
earlier measurements (SORT, ByteTrack, OC-SORT, BoT-SORT and C-BIoU on the public Faster R-CNN boxes
of PETS09-S2L1 and TUD-Campus; SORT on PETS09-S2L1: keep 13.4, wrong 2.2) to the printed digit. The
others count the frame of the choice too, start at the person's first true frame, average over
people, or pair as CLEAR does, which prefers the pair of the frame before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heel.evaluation.alignment import AlignedSequence, best_pairs, check_iou_threshold

APART_IOU = 0.3
"""IoU with every other person below which a box is on one person alone; chosen by hand. Boxes on
two who stand in line have 0.6 with both, those on one of two side by side 0.1."""


@dataclass(frozen=True, slots=True)
class Retention:
    """What became of the identities chosen at first sight.

    Attributes:
        people: people who were chosen, that is, had an output box on them in any frame.
        remaining: their true boxes after the frame of the choice.
        kept: those with the held identity on them.
        wrong: those in which the held identity was on another person.
    """

    people: int
    remaining: int
    kept: int
    wrong: int

    @property
    def keep_percent(self) -> float:
        """``kept`` of ``remaining``; 0 when nothing remains."""
        return 100.0 * self.kept / max(self.remaining, 1)

    @property
    def wrong_percent(self) -> float:
        """``wrong`` of ``remaining``; 0 when nothing remains."""
        return 100.0 * self.wrong / max(self.remaining, 1)


def retention(
    sequence: AlignedSequence, iou_threshold: float = 0.5, apart_iou: float = math.inf
) -> Retention:
    """Follows every person of ``sequence`` by the identity first seen on them.

    Args:
        sequence: people and output boxes.
        iou_threshold: from this IoU on a pair counts.
        apart_iou: nobody is chosen while the box has this IoU or more with another person, as a
            follower decides between two only once they are apart; inf chooses at first sight.

    Raises:
        HeelError: the threshold is outside (0, 1].
    """
    check_iou_threshold(iou_threshold)
    nobody = -1
    held = np.full(len(sequence.gt_identities), nobody)
    remaining = kept = wrong = 0
    for frame in sequence.frames:
        rows, columns = best_pairs(frame.iou, iou_threshold)
        partner = np.full(len(frame.gt), nobody)
        partner[rows] = frame.tracks[columns]
        chosen = held[frame.gt] != nobody
        keeps = chosen & (partner == held[frame.gt])
        taken = np.isin(held[frame.gt], frame.tracks[columns])
        remaining += int(chosen.sum())
        kept += int(keeps.sum())
        wrong += int((chosen & ~keeps & taken).sum())
        others = frame.iou[:, columns]
        others[rows, np.arange(len(rows))] = 0.0
        partner[rows[(others >= apart_iou).any(axis=0)]] = nobody
        held[frame.gt] = np.where(chosen, held[frame.gt], partner)
    return Retention(int((held != nobody).sum()), remaining, kept, wrong)
