"""Where a person ends above and below, told by their colours row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.detector.pointed.silhouette import ASPECT, STRIPS, FloatMap, Place, silhouette

_BAND, _BODY, _LEAST_BODY = 0.42, 0.2, 0.1
"""Columns looked at on either side, box widths; likeness of a pixel of the body; and how much of
the box's width such pixels have to fill in a row."""
_SHADOW_REACH, _SHADOW = 0.3, 0.8
"""More of the row than this, so many heights to either side, is a shadow on the floor."""
_LOW, _IN_SHADOW = 0.3, 0.06
"""Below the hip where shadows are looked for, and how far feet stand in them, heights."""
_GAP, _SHORTEST, _LONGEST, _LEAST_CUT = 0.04, 0.35, 0.95, 0.2
"""Of a person from the hip up or down, heights."""


@dataclass(frozen=True, slots=True)
class End:
    """Where a person ends: the row, or the picture's last before they do."""

    row: float
    cut: bool


def extent(
    likeness: list[FloatMap], inside: FloatMap, place: Place
) -> tuple[End | None, End | None]:
    """Upper and lower end of the person's colours about the middle of the box, None if not told.

    Args:
        likeness: by strip, (H, W) float32 in [-1, 1].
        inside: (H, W) float32, 1 inside the picture, else 0.
        place: where the template fits best.
    """
    shape = silhouette(place.height)
    body = _body(likeness, place.row + shape.centre[1])
    middle, half = place.column + shape.centre[0], max(2, round(_BAND * ASPECT * place.height))
    columns = slice(max(0, middle - half), middle + half + 1)
    count = (body[:, columns] > _BODY).sum(axis=1)
    solid = count >= max(1.0, _LEAST_BODY * ASPECT * place.height)
    reach = round(_SHADOW_REACH * place.height)
    around = slice(max(0, middle - reach), middle + reach + 1)
    shadow = (body[:, around] > _BODY).mean(axis=1) > _SHADOW
    hip = place.row + shape.centre[1]
    visible = inside[:, min(max(0, middle), inside.shape[1] - 1)] > 0.0
    up = _rows_until_gap(solid[: hip + 1][::-1], visible[: hip + 1][::-1], place.height)
    low = round(_LOW * place.height)
    floor = np.flatnonzero(shadow[hip + low :])
    standing = solid[hip:].copy()
    if floor.size:
        standing[low + int(floor[0]) + round(_IN_SHADOW * place.height) :] = False
    down = _rows_until_gap(standing, visible[hip:], place.height)
    return (
        None if up is None else End(hip - up.row + 1.0, up.cut),
        None if down is None else End(hip + down.row, down.cut),
    )


def _body(likeness: list[FloatMap], hip: int) -> FloatMap:
    """Likeness to any strip of the upper body above the hip, of the lower body below it."""
    upper = np.maximum.reduce(likeness[: STRIPS // 2])[:hip]
    return np.vstack([upper, np.maximum.reduce(likeness[STRIPS // 2 :])[hip:]])


def _rows_until_gap(
    solid: NDArray[np.bool_], visible: NDArray[np.bool_], height: int
) -> End | None:
    """How many rows go on until a gap or the picture's border; None where that is no person's."""
    gap, reach = max(1, round(_GAP * height)), round(_LONGEST * height)
    end = 0
    for row in range(len(solid)):
        if not visible[row]:
            leaves = row - end <= 1 and row > _LEAST_CUT * height
            return End(float(row), cut=True) if leaves else None
        if row > reach:
            return None
        if solid[row]:
            end = row + 1
        elif row >= end + gap:
            break
    return End(float(end), cut=False) if end > _SHORTEST * height else None
