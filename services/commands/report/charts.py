"""Curves and bands over time as SVG. Pure: numbers in, text out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from heel.services.commands.report.facts import Curve, Reals, Span

# Of a drawing, in pixels that the page scales to its width; chosen by hand.
_WIDTH_PX = 1100  # of all of it: what a laptop shows; chosen by hand
_HEIGHT_PX = 170  # of a chart; chosen by hand
_LEFT_PX = 60  # for the names of rows; chosen by hand
_RIGHT_PX = 8  # so that the last label fits; chosen by hand
_TOP_PX = 8  # likewise
_BOTTOM_PX = 22  # for the labels of the time axis, a line of text
_MOST_POINTS = 1000
"""Of a curve: one for each pixel; of more samples the least and the greatest are drawn."""
_GAP_S = 1.0
"""Time without a sample after which a curve is broken: everything here is told twice a second at
least."""
_BAND_PX = 26
"""Height of the bands of a timeline; chosen by hand."""
_LEAST_LABEL_PX = 7
"""Width that a letter takes on a band; chosen by hand."""
COLOURS = ("#1d5fa8", "#d1495b", "#5b8c3e", "#8a5fb0", "#b07d2b")
"""Of curves, in order; told apart by the colour-blind too, by their lightness."""
STATE_COLOURS = {
    "following": "#2f9e6b", "acquiring": "#6f9fd8", "occluded": "#a9bf3f", "unsure": "#f0a32b",
    "searching": "#9a78cc", "lost": "#7b8794", "stopped": "#d64545", "idle": "#cbd5df",
    "driving": "#2f9e6b", "waiting": "#cbd5df", "by hand": "#17a2b8",
}  # fmt: skip
"""Of states of the follower and of the drive."""
_OTHER = "#b9c3cd"


@dataclass(frozen=True)
class Level:
    """A value that a chart has a line at.

    Attributes:
        value: in the chart's unit.
        name: for the legend.
    """

    value: float
    name: str


@dataclass(frozen=True)
class _Frame:
    """From seconds and values to pixels."""

    end_s: float
    low: float
    high: float

    def x(self, t_s: float) -> float:
        share = t_s / self.end_s if self.end_s > 0 else 0.0
        return _LEFT_PX + share * (_WIDTH_PX - _LEFT_PX - _RIGHT_PX)

    def y(self, value: float) -> float:
        share = (value - self.low) / (self.high - self.low)
        return _HEIGHT_PX - _BOTTOM_PX - share * (_HEIGHT_PX - _TOP_PX - _BOTTOM_PX)


def chart(
    curves: Sequence[Curve], end_s: float, unit: str, levels: Sequence[Level] = (),
    shaded: Sequence[Span] = (), bounds: tuple[float, float] | None = None,
) -> Markup:  # fmt: skip
    """Curves over time.

    Args:
        curves: those without a known value are left out.
        end_s: of the time axis, which begins at 0.
        unit: of the values.
        levels: lines across.
        shaded: times that are set off, in the colours of their states.
        bounds: least and greatest value of the axis; None: by the curves and the levels.
    """
    curves = [curve for curve in curves if curve.known.size]
    frame = _Frame(end_s, *(bounds or _bounds(curves, levels)))
    parts = [_shade(one, frame) for one in shaded]
    parts += _grid(frame)
    parts += [_level(one, frame) for one in levels if frame.low <= one.value <= frame.high]
    # The first is the one that counts: it lies on top.
    for index, curve in reversed(list(enumerate(curves))):
        parts.append(
            Markup('<path d="{}" stroke="{}" fill="none" stroke-width="1.6"/>').format(
                _path(curve, frame), COLOURS[index % len(COLOURS)]
            )
        )
    label = ", ".join(curve.name for curve in curves)
    return _svg(parts, _HEIGHT_PX, f"{label} [{unit}]")


def bands(rows: Sequence[tuple[str, Sequence[Span]]], end_s: float) -> Markup:
    """What lasted, one row of bands each, with what it was in the tooltip."""
    height = _BAND_PX * len(rows) + _BOTTOM_PX + 4
    frame = _Frame(end_s, 0.0, 1.0)
    parts = []
    for number, (name, spans) in enumerate(rows):
        top = 2 + number * _BAND_PX
        parts.append(
            Markup('<text x="{}" y="{}" text-anchor="end">{}</text>').format(
                _LEFT_PX - 5, top + 16, name
            )
        )
        parts += [_band(one, frame, top) for one in spans]
    parts += _seconds(frame, height)
    return _svg(parts, height, " and ".join(name for name, _ in rows))


def legend(curves: Sequence[Curve], levels: Sequence[Level] = ()) -> list[tuple[str, str]]:
    """Names and colours of what a chart shows; a level has no colour."""
    known = [curve for curve in curves if curve.known.size]
    named = [(one.name, COLOURS[index % len(COLOURS)]) for index, one in enumerate(known)]
    return named + [(f"{one.name} {one.value:g}", "") for one in levels]


def _band(span: Span, frame: _Frame, top: int) -> Markup:
    left, right = frame.x(span.start_s), frame.x(span.end_s)
    width = max(right - left, 0.6)
    told = f"{span.start_s:.1f} to {span.end_s:.1f} s: {span.name}"
    told += f" ({span.reason})" if span.reason else ""
    text = Markup("")
    if width > _LEAST_LABEL_PX * len(span.name):
        text = Markup('<text class="on" x="{:.1f}" y="{}" text-anchor="middle">{}</text>').format(
            (left + right) / 2, top + 16, span.name
        )
    return Markup(
        '<g><title>{}</title><rect x="{:.2f}" y="{}" width="{:.2f}" height="{}" fill="{}"/>{}</g>'
    ).format(told, left, top, width, _BAND_PX - 4, STATE_COLOURS.get(span.name, _OTHER), text)


def _shade(span: Span, frame: _Frame) -> Markup:
    left, right = frame.x(span.start_s), frame.x(span.end_s)
    return Markup(
        '<rect x="{:.2f}" y="{}" width="{:.2f}" height="{}" fill="{}" opacity="0.16"/>'
    ).format(
        left, _TOP_PX, max(right - left, 0.6), _HEIGHT_PX - _TOP_PX - _BOTTOM_PX,
        STATE_COLOURS.get(span.name, _OTHER),
    )  # fmt: skip


def _grid(frame: _Frame) -> list[Markup]:
    parts = []
    for value in ticks(frame.low, frame.high, 4):
        y = frame.y(value)
        parts.append(
            Markup(
                '<line class="grid" x1="{}" x2="{}" y1="{:.1f}" y2="{:.1f}"/>'
                '<text x="{}" y="{:.1f}" text-anchor="end">{:g}</text>'
            ).format(_LEFT_PX, _WIDTH_PX - _RIGHT_PX, y, y, _LEFT_PX - 5, y + 4, value)
        )
    return parts + _seconds(frame, _HEIGHT_PX)


def _seconds(frame: _Frame, height: int) -> list[Markup]:
    parts = []
    for t_s in ticks(0.0, frame.end_s, 11):
        parts.append(
            Markup('<text x="{:.1f}" y="{}" text-anchor="middle">{:g} s</text>').format(
                min(frame.x(t_s), _WIDTH_PX - 20), height - 6, t_s
            )
        )
    return parts


def _level(level: Level, frame: _Frame) -> Markup:
    y = frame.y(level.value)
    return Markup(
        '<line class="level" x1="{}" x2="{}" y1="{:.1f}" y2="{:.1f}"><title>{}</title></line>'
    ).format(_LEFT_PX, _WIDTH_PX - _RIGHT_PX, y, y, f"{level.name}: {level.value:g}")


def _svg(parts: Sequence[Markup], height: int, label: str) -> Markup:
    return Markup('<svg viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>').format(
        _WIDTH_PX, height, escape(label), Markup("").join(parts)
    )


def _path(curve: Curve, frame: _Frame) -> str:
    words, pen = [], "M"
    before_s = -math.inf
    for t_s, value in thinned(curve):
        if t_s - before_s > max(_GAP_S, 3 * frame.end_s / _MOST_POINTS):
            pen = "M"
        before_s = t_s
        if not math.isfinite(value):
            pen = "M"
            continue
        held = min(max(value, frame.low), frame.high)
        words.append(f"{pen}{frame.x(t_s):.1f} {frame.y(held):.1f}")
        pen = "L"
    return "".join(words)


def thinned(curve: Curve) -> list[tuple[float, float]]:
    """Samples that look the same when drawn: of each stretch the least and the greatest."""
    times_s, values = np.array(curve.times_s, np.float64), np.array(curve.values, np.float64)
    if len(times_s) <= 2 * _MOST_POINTS:
        return list(zip(times_s.tolist(), values.tolist(), strict=True))
    kept: list[int] = []
    for stretch in np.array_split(np.arange(len(times_s)), _MOST_POINTS):
        known = stretch[np.isfinite(values[stretch])]
        if not known.size:
            kept.append(int(stretch[0]))
            continue
        both = {int(known[values[known].argmin()]), int(known[values[known].argmax()])}
        unknown = stretch[~np.isfinite(values[stretch])][:1]
        kept += sorted(both | set(unknown.tolist()))
    return [(float(times_s[index]), float(values[index])) for index in kept]


def _bounds(curves: Sequence[Curve], levels: Sequence[Level]) -> tuple[float, float]:
    known: list[Reals] = [curve.known for curve in curves]
    values = np.concatenate([*known, np.array([0.0, *(one.value for one in levels)])])
    low, high = float(values.min()), float(values.max())
    room = 0.06 * (high - low) or 0.5
    return (low - room if low < 0 else 0.0), high + room


def ticks(low: float, high: float, about: int) -> list[float]:
    """Round numbers from `low` to `high`, roughly so many."""
    if not high > low:
        return [low]
    raw = (high - low) / about
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next(one for one in (1, 2, 5, 10) if one * power >= raw)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(number * step, 9) for number in range(first, last + 1)]
