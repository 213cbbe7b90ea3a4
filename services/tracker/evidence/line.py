"""Height as a line over the foot row: nearest to samples of it, or of a calibrated camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.calibration_file import Calibration
from heel.services.geometry.camera import Pinhole
from heel.services.tracker.evidence.arrays import Floats

WIDTH_RATIO = 0.37
"""Width by height of a walking person's box, on average."""
STEEPEST = 2.5
"""Slope of a height line, pixels by pixels: a person's height by the camera's; a camera lower than
0.7 m sees no line that could be used. Chosen by hand."""
_HELD = 0.5
"""Weight of each held point, in samples, where there are few; chosen by hand."""
_HELD_SHARE = 0.005
"""Weight of each held point for each sample, so that many samples leave it a little; chosen by
hand."""
_LEAST_SAMPLES = 4
"""Samples below which a line is left as it was: two give any line; chosen by hand."""
_SWEEPS = 6
"""Reweighted least-squares fits of each line; more cost time. Chosen by hand."""

_PERSON_M = 1.75
"""Metres: height of a usual adult in shoes; chosen by hand."""
_ROWS = 16
"""Foot rows at which a calibration gives the height, evenly over the picture: two fix a line, more
even out that the height is not quite one; chosen by hand."""
_LOWEST_PX = 8.0
"""Working pixels: lower people stand near the horizon, where nothing can be told from clutter;
chosen by hand."""


@dataclass(frozen=True)
class Line:
    """h(y) = slope * y + offset, working pixels."""

    slope: float
    offset: float
    ratio: float = WIDTH_RATIO

    def height(self, foot_row: float) -> float:
        """Expected height at a foot row; never below 4."""
        return max(self.slope * foot_row + self.offset, 4.0)

    def moved(self, shift: float) -> Line:
        """The same line after everything has moved down by `shift` working pixels."""
        return Line(self.slope, self.offset - self.slope * shift, self.ratio)


def line_of(calibration: Calibration, shape: tuple[int, ...]) -> Line | None:
    """The height line of the middle of the picture; None where no person could stand in it.

    Args:
        calibration: of the camera.
        shape: rows and columns of the working image.
    """
    rows, columns = shape[0], shape[1]
    fov_rad = math.radians(calibration.horizontal_fov_deg)
    camera = Pinhole.from_fov(columns, rows, fov_rad).mounted(
        calibration.mount_height_m, math.radians(calibration.mount_pitch_deg)
    )
    feet = np.linspace(0.0, 1.1 * rows, _ROWS)
    heights = camera.person_height_px(
        np.stack([np.full(_ROWS, columns / 2.0), feet], axis=-1), _PERSON_M
    )
    used = np.isfinite(heights) & (heights > _LOWEST_PX)
    if used.sum() < 2:
        return None
    slope, offset = np.polyfit(feet[used], heights[used], 1, w=1.0 / heights[used])
    return Line(float(slope), float(offset))


def refined(
    lines: Sequence[Line], foot: Floats, height: Floats, agreeing: NDArray[np.bool_], rows: int
) -> list[Line]:
    """Least absolute relative deviation of each line, by reweighted least squares.

    Two points of the line given hold it weakly where there are no samples. All lines are refined
    at once, which is faster than one after the other.

    Args:
        lines: where to start, L of them.
        foot: foot rows of the samples, (N,).
        height: their heights, (N,).
        agreeing: which samples each line is fitted to, (L, N).
        rows: of the image.
    """
    count = agreeing.sum(axis=1)
    ends = _medians(foot, agreeing)[:, None] + np.array([-0.25, 0.25]) * rows
    held = np.array([_held(line, end) for line, end in zip(lines, ends, strict=True)])
    x = np.hstack([np.broadcast_to(foot, agreeing.shape), ends])
    y = np.hstack([np.broadcast_to(height, agreeing.shape), held])
    holding = np.sqrt(_HELD + _HELD_SHARE * (count + 2))[:, None].repeat(2, axis=1)
    base = np.hstack([agreeing.astype(np.float64), holding])
    u, v, weight = x / y, 1.0 / y, base
    slope = offset = np.zeros(len(lines))
    for _ in range(_SWEEPS):
        slope, offset = _least_squares(u, v, weight * weight)
        deviation = np.abs(slope[:, None] * u + offset[:, None] * v - 1.0)
        weight = base / np.sqrt(np.maximum(deviation, 0.01))
        weight[:, -2:] = holding / np.sqrt(0.05)
    fitted = (count >= _LEAST_SAMPLES) & (slope >= 0.0) & (slope < STEEPEST)
    return [
        Line(float(slope[k]), float(offset[k])) if fitted[k] else line
        for k, line in enumerate(lines)
    ]


def _medians(values: Floats, chosen: NDArray[np.bool_]) -> Floats:
    """Median of the chosen values of each row; 0 where none is."""
    return np.array([np.median(values[row]) if row.any() else 0.0 for row in chosen])


def _held(line: Line, ends: Floats) -> list[float]:
    """Heights at the ends, not below a fifth of that in the middle."""
    least = 0.2 * line.height(float(ends.mean()))
    return [max(line.height(float(end)), least) for end in ends]


def _least_squares(u: Floats, v: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """For each row the a and b that bring a u + b v nearest to 1."""
    wu, wv = weight * u, weight * v
    uu, uv, vv = (_dot(wu, u), _dot(wu, v), _dot(wv, v))
    su, sv = wu.sum(axis=1), wv.sum(axis=1)
    determinant = np.maximum(uu * vv - uv * uv, 1e-30)
    return (su * vv - sv * uv) / determinant, (sv * uu - su * uv) / determinant


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ij,ij->i", a, b), np.float64)
