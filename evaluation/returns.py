"""Who comes back: the same identity after a person was not seen, and how long a loss lasts.

Two questions of somebody who follows one person:

1. *Absences.* A person on whom no output box is for a while, and then one is again, is in one of
   four classes by the length of the absence: about 1, 3, 5 and 15 s. Compared is the identity of
   the last box before with that of the last box within a second after, time in which a tracker may
   recognise a person. *same*: they are equal. *another's*: the new one has been on somebody else
   before. Neither: a fresh identity, with which a tracker claims nothing.
2. *Losses.* A person is chosen as in `evaluation/retention.py`. A loss begins in the first frame in
   which the person is in the ground truth and the identity is not on them, and ends when it is
   again. Reported are the share of losses that end, and how long those last.

The same question is asked by SOMA (same id after 1, 3 and 5 s of full occlusion) and by roboflow's
reid (association after a gap).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from rich.box import SIMPLE_HEAD
from rich.table import Table

from heel.evaluation.alignment import AlignedSequence, best_pairs, check_iou_threshold
from heel.schemas.errors import HeelError

CLASSES: Mapping[int, tuple[float, float]] = {
    1: (0.5, 2.0),
    3: (2.0, 4.0),
    5: (4.0, 10.0),
    15: (10.0, 30.0),
}
"""Absences of about so many seconds: from, to before [s]."""
_SETTLED_S = 1.0
"""Time after a return within which a tracker may recognise a person [s]; chosen by hand."""


class Absences(BaseModel):
    """Absences of one class."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    count: int = Field(ge=0, description="absences")
    same: int = Field(ge=0, description="of these: the same identity again")
    others: int = Field(ge=0, description="of these: an identity that was on another person before")

    @property
    def claimed(self) -> int:
        """Absences after which somebody known is claimed to be back."""
        return self.same + self.others


class ReturnScores(BaseModel):
    """What became of absences and losses."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    absences: dict[int, Absences] = Field(description="by class, about so many seconds")
    losses: int = Field(ge=0, description="times the chosen identity left its person")
    recovered: int = Field(ge=0, description="of these: times it came back to them")
    delay_p50_s: float | None = Field(description="median time until it did, seconds")
    delay_p95_s: float | None = Field(description="95th percentile of it, seconds")


class SequenceReturns(ReturnScores):
    """The same of one sequence."""

    sequence: str = Field(description="name of the sequence")


class Returns(BaseModel):
    """Absences and losses one by one, as far as they have to be to add up."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    absences: dict[int, Absences] = Field(description="by class, about so many seconds")
    losses: int = Field(ge=0, description="times the chosen identity left its person")
    delays_s: tuple[float, ...] = Field(description="of those that ended: time until then, seconds")


@dataclass
class _Person:
    """One person's story, frame by frame."""

    held: int | None = None
    lost_since: int | None = None
    delays: list[int] = field(default_factory=list)
    losses: int = 0
    seen: list[tuple[int, int]] = field(default_factory=list)  # frame, identity


class Stories:
    """Follows people and identities through frames."""

    def __init__(self) -> None:
        """Nobody was seen yet."""
        self._people: dict[int, _Person] = {}
        self._owners: dict[int, list[tuple[int, int]]] = {}  # of an identity: frame, person

    def note(self, frame: int, identities: Mapping[int, int | None]) -> None:
        """Take a frame.

        Args:
            frame: its number, above all before.
            identities: which identity is on each person that is there, None for none; no
                identity is on two.
        """
        for person, identity in identities.items():
            _note(self._people.setdefault(person, _Person()), frame, identity)
            if identity is not None:
                self._owners.setdefault(identity, []).append((frame, person))

    def losses(self, fps: float) -> tuple[int, tuple[float, ...]]:
        """How often the identity held left its person, and after how many seconds it came back."""
        people = self._people.values()
        delays_s = tuple(delay / fps for one in people for delay in one.delays)
        return sum(one.losses for one in people), delays_s

    def absences(
        self, fps: float, of: Container[int] | None = None, length: GapLength | None = None
    ) -> dict[int, Absences]:
        """What became of absences.

        Args:
            fps: frames per second.
            of: people; None for all.
            length: frames that an absence counts for; None for all between the two sights.
        """
        counts = {about: [0, 0, 0] for about in CLASSES}
        for person, one in self._people.items():
            if of is not None and person not in of:
                continue
            for (gone, before), (back, _) in zip(one.seen, one.seen[1:], strict=False):
                frames = back - gone - 1 if length is None else length(gone, back)
                about = _class_of(frames / fps)
                if about is None:
                    continue
                limit = back + _SETTLED_S * fps
                after = [identity for frame, identity in one.seen if back <= frame <= limit][-1]
                before_back = [who for frame, who in self._owners[after] if frame < back]
                counts[about][0] += 1
                counts[about][1] += after == before
                counts[about][2] += after != before and any(who != person for who in before_back)
        return _classes(counts)


GapLength = Callable[[int, int], float]
"""Frames that an absence between two sights, given by their frames, counts for."""


def _class_of(absent_s: float) -> int | None:
    return next((k for k, (low, high) in CLASSES.items() if low <= absent_s < high), None)


def _classes(counts: Mapping[int, Sequence[int]]) -> dict[int, Absences]:
    made = {}
    for about in CLASSES:
        count, same, others = counts.get(about, (0, 0, 0))
        made[about] = Absences(count=count, same=same, others=others)
    return made


def summed_up(parts: Sequence[Returns]) -> ReturnScores:
    """The scores of several sequences or episodes as one."""
    counts = {
        about: [
            sum(getattr(part.absences[about], name) for part in parts)
            for name in ("count", "same", "others")
        ]
        for about in CLASSES
    }
    delays_s = [delay for part in parts for delay in part.delays_s]
    return ReturnScores(
        absences=_classes(counts),
        losses=sum(part.losses for part in parts),
        recovered=len(delays_s),
        delay_p50_s=float(np.percentile(delays_s, 50)) if delays_s else None,
        delay_p95_s=float(np.percentile(delays_s, 95)) if delays_s else None,
    )


def return_scores(
    sequence: AlignedSequence, fps: float, iou_threshold: float = 0.5
) -> SequenceReturns:
    """Score absences and losses.

    Args:
        sequence: ground truth and tracks.
        fps: frames per second, > 0.
        iou_threshold: from this IoU on a pair matches.

    Raises:
        HeelError: the threshold is outside (0, 1], or the rate is not above 0.
    """
    check_iou_threshold(iou_threshold)
    if not fps > 0:
        raise HeelError(f"fps = {fps}: absences are measured in seconds; give a rate above 0")
    stories = Stories()
    for frame in sequence.frames:
        rows, columns = best_pairs(frame.iou, iou_threshold)
        partner = dict(zip(frame.gt[rows].tolist(), frame.tracks[columns].tolist(), strict=True))
        stories.note(frame.frame, {who: partner.get(who) for who in frame.gt.tolist()})
    losses, delays_s = stories.losses(fps)
    found = Returns(absences=stories.absences(fps), losses=losses, delays_s=delays_s)
    return SequenceReturns(sequence=sequence.name, **dict(summed_up([found])))


def _note(person: _Person, frame: int, identity: int | None) -> None:
    if identity is not None:
        person.seen.append((frame, identity))
    if person.held is None:
        person.held = identity
    elif identity == person.held:
        if person.lost_since is not None:
            person.delays.append(frame - person.lost_since)
            person.lost_since = None
    elif person.lost_since is None:
        person.lost_since = frame
        person.losses += 1


RETURNS_COLUMNS = (*(f"~{about} s" for about in CLASSES), "losses", "found%", "p50 s", "p95 s")
RETURNS_CAPTION = "absences: same identity / somebody known claimed / all"


def returns_table(scores: Sequence[SequenceReturns]) -> Table:
    """A table for the terminal; 7/8/10 are 10 absences, 8 claims, 7 of them right."""
    table = Table(
        box=SIMPLE_HEAD, padding=0, pad_edge=False, caption_justify="left", caption=RETURNS_CAPTION
    )
    table.add_column("sequence", no_wrap=True)
    for title in RETURNS_COLUMNS:
        table.add_column(title, justify="right", no_wrap=True)
    for row in scores:
        table.add_row(row.sequence, *returns_cells(row))
    return table


def returns_cells(row: ReturnScores) -> list[str]:
    """The columns of `RETURNS_COLUMNS`."""
    delays = (row.delay_p50_s, row.delay_p95_s)
    return [
        *(f"{a.same}/{a.claimed}/{a.count}" for a in row.absences.values()),
        str(row.losses),
        f"{100 * row.recovered / row.losses:.0f}" if row.losses else "-",
        *("-" if delay_s is None else f"{delay_s:.1f}" for delay_s in delays),
    ]
