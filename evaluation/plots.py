"""The pictures of ``heel eval --plot``: accuracy per frame, and a timeline of the tracks."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import AlignedSequence
from heel.evaluation.dice import dice_per_frame
from heel.evaluation.figures import INK, new_figure, save, set_legend, set_title
from heel.evaluation.retention import retention
from heel.evaluation.timeline import ABSENT, MISSED, Timeline, timeline
from heel.schemas.errors import HeelError
from heel.services.colours import colour_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_MISSED, _ACCENT = "#dde2e8", "#2f6db5"
_MEAN = "#d11149"


def write_plots(
    sequence: AlignedSequence, directory: Path, *, iou_threshold: float = 0.5
) -> tuple[Path, Path]:
    """Writes both pictures as ``<sequence>-accuracy.png`` and ``<sequence>-timeline.png``.

    Args:
        sequence: what to draw.
        directory: created when missing.
        iou_threshold: for the timeline; accuracy needs none.

    Returns:
        The two files.

    Raises:
        HeelError: matplotlib is not installed, or a file cannot be written.
    """
    stem = re.sub(r"[^\w.-]+", "_", sequence.name) or "sequence"
    accuracy = directory / f"{stem}-accuracy.png"
    tracks = directory / f"{stem}-timeline.png"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        plot_accuracy(sequence, accuracy)
        plot_timeline(sequence, tracks, iou_threshold=iou_threshold)
    except OSError as error:
        raise HeelError(f"{directory}: cannot be written ({error.strerror})") from error
    return accuracy, tracks


def plot_accuracy(sequence: AlignedSequence, path: Path) -> None:
    """Draws the paper's figure 7: object detection accuracy (equation 7) of every frame.

    Frames without any box, true or detected, are gaps: equation 7 is not defined there.

    Raises:
        HeelError: matplotlib is not installed.
    """
    accuracy = dice_per_frame(sequence)
    frames = np.arange(1, len(accuracy) + 1)
    window = max(5, len(accuracy) // 40)
    figure, axes = new_figure(height_in=4.2)
    axes.fill_between(frames, accuracy, color=_ACCENT, alpha=0.12, linewidth=0)
    axes.plot(frames, accuracy, color=_ACCENT, alpha=0.45, linewidth=0.8, label="each frame")
    label = f"moving mean, {window} frames"
    axes.plot(frames, _moving_mean(accuracy, window), color=_ACCENT, linewidth=2.0, label=label)
    mean = float(np.nanmean(accuracy))
    axes.axhline(mean, color=_MEAN, linewidth=1.2, dashes=(6, 3), label=f"mean {mean:.1f} %")
    axes.set(xlim=(1, max(len(accuracy), 2)), ylim=(0, 102), xlabel="frame", ylabel="accuracy (%)")
    axes.grid(axis="y", color=_MISSED, linewidth=0.8)
    set_title(
        axes, f"{sequence.name}: detection accuracy per frame", "Dice overlap of all boxes, eq. 7"
    )
    set_legend(axes, columns=3)
    save(figure, path)


def plot_timeline(sequence: AlignedSequence, path: Path, *, iou_threshold: float = 0.5) -> None:
    """Draws one row per person of the ground truth, coloured by the output identity on them.

    Grey: the person is there, no output is on them. Empty: the person is not there. A mark: the
    identity differs from the person's previous one (the marks are the IDsw).

    Raises:
        HeelError: matplotlib is not installed.
    """
    table = timeline(sequence, iou_threshold)
    people = len(table.tracks)
    figure, axes = new_figure(height_in=float(np.clip(1.7 + 0.3 * people, 2.6, 40.0)))
    for row in range(people):
        _draw_person(axes, row, table, sequence.track_identities)
    axes.set(xlim=(0.5, sequence.frame_count + 0.5), ylim=(people - 0.4, -0.8), xlabel="frame")
    axes.set_yticks(range(people), [str(identity) for identity in sequence.gt_identities])
    axes.set_ylabel("person (ground truth)")
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    held = retention(sequence, iou_threshold)
    set_title(
        axes,
        f"{sequence.name}: who was tracked as whom",
        f"{int(table.switches.sum())} switches, keep {held.keep_percent:.1f} %, "
        f"wrong {held.wrong_percent:.1f} %, IoU ≥ {iou_threshold:g}",
    )
    _timeline_legend(axes)
    save(figure, path)


def runs(values: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """``(start, stop, value)`` of every stretch of equal numbers in ``(N,)``."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return [(start, stop, int(values[start])) for start, stop in pairwise(edges) if stop > start]


def _draw_person(axes: Axes, row: int, table: Timeline, identities: NDArray[np.int64]) -> None:
    digit_frames = table.tracks.shape[1] / 130  # as wide as one digit of the labels
    stretches = runs(table.tracks[row])
    missed = [(start + 0.5, stop - start) for start, stop, track in stretches if track == MISSED]
    tracked = [stretch for stretch in stretches if stretch[2] not in (ABSENT, MISSED)]
    colours = [_colour(track) for _, _, track in tracked]
    spans = [(start + 0.5, stop - start) for start, stop, _ in tracked]
    # One collection per row: with one per bar, 129 people took 15 s instead of 6 s.
    axes.broken_barh(missed, (row - 0.1, 0.2), facecolors=_MISSED)
    axes.broken_barh(spans, (row - 0.36, 0.72), facecolors=colours)
    for (start, stop, track), colour in zip(tracked, colours, strict=True):
        text = str(identities[track])
        if stop - start >= digit_frames * len(text):
            middle, ink = (start + stop + 1) / 2, "white" if _is_dark(colour) else INK
            axes.text(middle, row, text, color=ink, fontsize=7, ha="center", va="center_baseline")
    at = np.flatnonzero(table.switches[row]) + 0.5
    axes.vlines(at, row - 0.48, row + 0.36, color=INK, linewidth=1.4, zorder=3)
    axes.plot(at, np.full(len(at), row - 0.48), "v", color=INK, markersize=4, zorder=3)


def _timeline_legend(axes: Axes) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Artist] = [
        Patch(facecolor=_colour(0), label="tracked (colour and number: output id)"),
        Patch(facecolor=_MISSED, label="missed"),
        Line2D(
            [],
            [],
            color=INK,
            marker="v",
            markersize=5,
            linestyle="none",
            label="identity switch",
        ),
    ]
    set_legend(axes, columns=3, handles=handles)


def _colour(track: int) -> tuple[float, float, float]:
    """The colour of a track, darker for paper; tracks of like hues differ in lightness."""
    return colour_of(track, lightness=(0.42, 0.62, 0.52)[track % 3], saturation=0.55)


def _is_dark(colour: tuple[float, float, float]) -> bool:
    return float(np.dot(colour, (0.299, 0.587, 0.114))) < 0.58


def _moving_mean(values: NDArray[np.float64], window: int) -> NDArray[np.float64]:
    """Centred mean over the defined values in the window; undefined where the value itself is."""
    defined = np.isfinite(values)
    kernel = np.ones(window)
    total = np.convolve(np.where(defined, values, 0.0), kernel)
    count = np.convolve(defined.astype(np.float64), kernel)
    middle = slice((window - 1) // 2, (window - 1) // 2 + len(values))
    mean: NDArray[np.float64] = np.where(
        defined, total[middle] / np.maximum(count[middle], 1.0), np.nan
    )
    return mean
