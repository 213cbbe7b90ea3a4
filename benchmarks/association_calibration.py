"""Is an identity confidence of 0.9 right nine times of ten?

An id belongs to the person it is on most often in the first frames that it is on anybody; from then
on it is right while it is on that person.
"""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from heel.evaluation.rows import BoxRows
from heel.services.geometry.assignment import heaviest_pairs
from heel.services.geometry.boxes import iou_matrix

_LEAST_IOU = 0.5
_FIRST_FRAMES = 5
_EDGES = (0.5, 0.6, 0.7, 0.8, 0.88, 1.0)

Claim = tuple[float, bool]
"""Identity confidence in [0, 1] as said, and whether the id was right."""


def claims_of(truth: BoxRows, tracks: BoxRows) -> list[Claim]:
    """What every shown box on a person claimed of its id."""
    truth = truth.select(truth.values != 0)
    first: dict[int, list[int]] = {}
    found: list[Claim] = []
    for frame in np.unique(tracks.frames):
        people = truth.select(truth.frames == frame)
        shown = tracks.select(tracks.frames == frame)
        overlap = iou_matrix(people.boxes_xyxy, shown.boxes_xyxy)
        rows, columns = heaviest_pairs(overlap)
        for i, j in zip(rows, columns, strict=True):
            if overlap[i, j] < _LEAST_IOU:
                continue
            person = int(people.identities[i])
            early = first.setdefault(int(shown.identities[j]), [])
            if len(early) < _FIRST_FRAMES:
                early.append(person)
            owner = Counter(early).most_common(1)[0][0]
            found.append((float(shown.values[j]), owner == person))
    return found


def reliability_table(claims: dict[str, list[Claim]]) -> str:
    """Markdown: per sequence, how often ids were right, by what was said (percent, boxes)."""
    bands = list(pairwise(_EDGES))
    head = ("sequence", *(f"said {low:g} to {high:g}" for low, high in bands))
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    everything = [claim for some in claims.values() for claim in some]
    rows = (*claims.items(), ("all", everything), ("all, fitted without", left_out(claims)))
    for name, some in rows:
        cells = [_cell(some, low, high) for low, high in bands]
        lines.append("| " + " | ".join((name, *cells)) + " |")
    return "\n".join(lines) + "\n"


def left_out(claims: dict[str, list[Claim]]) -> list[Claim]:
    """All claims, each sequence's said anew by a straight line fitted to the other sequences.

    Least squares of right (1) and wrong (0) on what was said, every sequence weighing alike.
    """
    found: list[Claim] = []
    for name, some in claims.items():
        others = [other for key, other in claims.items() if key != name and other]
        if not others:
            continue
        weight = np.concatenate([np.full(len(other), len(other) ** -0.5) for other in others])
        said, right = np.array([claim for other in others for claim in other], float).T
        line = np.polyfit(said, right, 1, w=weight)
        anew = np.clip(np.polyval(line, [claim[0] for claim in some]), 0.0, 1.0)
        found += [(float(one), was) for one, (_, was) in zip(anew, some, strict=True)]
    return found


def _cell(claims: list[Claim], low: float, high: float) -> str:
    right = [was for said, was in claims if low <= said < high or said == high == 1.0]
    return f"{100 * sum(right) / len(right):.0f} ({len(right)})" if right else "-"
