"""What all pictures of the evaluation share: size, ink, titles and legends."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from heel.schemas.errors import HeelError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED = "#1f2933", "#7b8794"
_DPI = 150
"""Pixels an inch of a picture file; chosen by hand: 1,650 pixels across, sharp on a page."""
_WIDTH_IN = 11.0
"""Of a figure; chosen by hand: a landscape page."""


def new_figure(height_in: float, width_in: float = _WIDTH_IN) -> tuple[Figure, Axes]:
    """A figure of its own: no pyplot, so no window system and no global state.

    Raises:
        HeelError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise HeelError(
            f"matplotlib cannot be imported ({error}); run `pip install matplotlib` to plot"
        ) from error
    figure = Figure(figsize=(width_in, height_in), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(MUTED)
    axes.tick_params(colors=MUTED, labelcolor=INK, labelsize=9)
    axes.xaxis.label.set_color(INK)
    axes.yaxis.label.set_color(INK)
    return figure, axes


def set_title(axes: Axes, title: str, subtitle: str) -> None:
    """What is shown, and its figures, above the axes."""
    axes.set_title(title, loc="left", fontsize=12, fontweight="bold", color=INK)
    axes.set_title(subtitle, loc="right", fontsize=9, color=MUTED)


def set_legend(axes: Axes, columns: int, handles: list[Artist] | None = None) -> None:
    """A legend below the axes, so that it never covers data."""
    axes.figure.legend(
        handles=handles if handles is not None else axes.get_legend_handles_labels()[0],
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )


def save(figure: Figure, path: Path) -> None:
    """Write a picture that is the same bytes every time."""
    figure.savefig(path, metadata={"Software": None})
