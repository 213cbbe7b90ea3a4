"""Which rows of a MOTChallenge file are people, where a column says what each row is.

From MOT16 on, ground truth has nine columns, the eighth being the class of MOT16's table 3 (Milan
et al., "MOT16: A Benchmark for Multi-Object Tracking", arXiv:1603.00831): 1 is a pedestrian, 2 a
person on a vehicle, 7 a static person, 8 a distractor, 12 a reflection, the rest are things.
MOT15's ten columns end in a place in the world, or in -1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.rows import RowKind
from heel.schemas.errors import HeelError

PEDESTRIAN = 1
"""MOTChallenge's number of the class that is scored."""
_NOT_SCORED = (2, 7, 8, 12)
"""Ignored by the protocol: what looks like a pedestrian and is not evaluated."""
_MOST_CLASS = 13
"""Largest class of MOTChallenge: 13 is a crowd."""
_VISDRONE_MOST = 11
"""Largest category of VisDrone: 11 is `others`."""
_VISDRONE_PEOPLE = (1, 2)
"""VisDrone's `pedestrian` and `people`, who sit, ride or lie."""


@dataclass(frozen=True)
class PeopleRows:
    """What the classes say.

    Attributes:
        kept: (N,) rows that stay.
        unscored: (N,) rows of ground truth that count as flag 0.
    """

    kept: NDArray[np.bool_]
    unscored: NDArray[np.bool_]


def people_by_class(
    columns: int, more: NDArray[np.float64], places: NDArray[np.int64], kind: RowKind, where: str
) -> PeopleRows:
    """Judge the columns behind the flag or confidence.

    Args:
        columns: how many there are in every row, 0 where rows differ.
        more: (N, 3) columns 8 to 10, NaN where there is none or no number.
        places: (N,) line of each row, for messages.
        kind: what the rows are; tracks are of people whatever stands there.
        where: what `places` counts.

    Raises:
        HeelError: classes that nothing explains, or none of a pedestrian.
    """
    everybody = np.ones(len(more), np.bool_)
    classes = more[:, 0]
    whole = bool(len(more)) and bool((classes == np.floor(classes)).all())
    if kind == "tracks" or not whole:
        return PeopleRows(everybody, ~everybody)
    if columns >= 10:
        if not _is_visdrone(more):
            return PeopleRows(everybody, ~everybody)
        kept = np.isin(classes, _VISDRONE_PEOPLE)
    elif columns in (8, 9):
        if (classes == classes[0]).all() and classes[0] in (-1, 0, PEDESTRIAN):
            return PeopleRows(everybody, ~everybody)
        _check_codes(classes, places, where)
        others = _NOT_SCORED if kind == "ground truth" else ()
        kept = np.isin(classes, (PEDESTRIAN, *others))
    else:
        return PeopleRows(everybody, ~everybody)
    if not (kept & (classes == PEDESTRIAN)).any():
        raise HeelError(
            f"{where} {places[0]}: class {classes[0]:g} in column 8, and no row is of class "
            f"{PEDESTRIAN}, a pedestrian: write {PEDESTRIAN} there where these are people"
        )
    return PeopleRows(kept, np.isin(classes, _NOT_SCORED) & (columns < 10))


def _check_codes(classes: NDArray[np.float64], places: NDArray[np.int64], where: str) -> None:
    bad = (classes < PEDESTRIAN) | (classes > _MOST_CLASS)
    if bad.any():
        row = int(np.argmax(bad))
        found = ", ".join(f"{value:g}" for value in np.unique(classes)[:8])
        raise HeelError(
            f"{where} {places[row]}: class {classes[row]:g} in column 8 (there are {found}) is "
            f"none of MOTChallenge's, 1 to {_MOST_CLASS} with {PEDESTRIAN} for a pedestrian: keep "
            f"the rows of people and write {PEDESTRIAN} there"
        )


def _is_visdrone(more: NDArray[np.float64]) -> bool:
    """VisDrone's ten columns: category 0 to 11, truncation 0 or 1, occlusion 0 to 2."""
    if not (np.isfinite(more).all() and (more == np.floor(more)).all() and (more >= 0).all()):
        return False
    category, truncation, occlusion = more.max(axis=0)
    return bool(0 < category <= _VISDRONE_MOST and truncation <= 1 and occlusion <= 2)
