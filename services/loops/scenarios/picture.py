"""The picture of an episode: everybody's path seen from above, the robot's coloured by state."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.figures import INK, MUTED, new_figure, save, set_legend, set_title
from heel.evaluation.following.episode_scores import EpisodeScores
from heel.evaluation.following.log import NOBODY, EpisodeLog
from heel.services.simulator.state import Scenery

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

STATE_COLOURS = {
    "following": "#2a9d4a",
    "occluded": "#8bc34a",
    "acquiring": "#2f6db5",
    "unsure": "#e6a700",
    "searching": "#f26a1b",
    "lost": "#d11149",
    "idle": "#7b8794",
    "stopped": "#1f2933",
}
_TARGET, _OTHER, _WRONG, _SOLID = "#6a3fb5", "#b8c1cc", "#d11149", "#c9ced6"
_MARK_EVERY_S = 5.0
"""Marks along a way; chosen by hand."""
_LONGEST_IN = 9.0
"""Longer side of a picture; chosen by hand."""


def draw_episode(
    log: EpisodeLog, scores: EpisodeScores, scenery: Scenery, title: str, path: Path
) -> None:
    """Draw one episode; dots with numbers are where robot and target are every 5 s.

    Raises:
        HeelError: matplotlib is not installed.
    """
    left, bottom, right, top = _extent(log)
    scale = _LONGEST_IN / max(right - left, top - bottom)
    height_in, width_in = (top - bottom) * scale + 1.6, (right - left) * scale + 1.0
    figure, axes = new_figure(max(height_in, 4.0), max(width_in, 7.0))
    _draw_scenery(axes, scenery)
    for person in range(log.people_xy_m.shape[1]):
        if person != log.target:
            axes.plot(*log.people_xy_m[:, person].T, color=_OTHER, linewidth=1.0)
    axes.plot(*log.people_xy_m[:, log.target].T, color=_TARGET, linewidth=1.6)
    _draw_robot(axes, log)
    _draw_marks(axes, log)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    # One below the other: a path may be narrow.
    set_title(axes, f"{title}\n{_figures(scores)}", "")
    _draw_legend(axes, log)
    save(figure, path)


def _figures(scores: EpisodeScores) -> str:
    outcome = "contact" if scores.evt.collision else "ok" if scores.evt.success else "lost"
    return (
        f"{outcome}, {scores.duration_s:.0f} s: F {scores.habitat.following_rate:.2f}, "
        f"wrong {100 * scores.wrong_time:.1f} %, longest loss {scores.longest_loss_s:.1f} s, "
        f"nearest {scores.min_distance_m:.2f} m"
    )


def _extent(log: EpisodeLog) -> tuple[float, float, float, float]:
    """The robot's and the target's paths, and 2 m around them."""
    points = np.concatenate([log.robot_xy_m, log.people_xy_m[:, log.target]])
    (left, bottom), (right, top) = points.min(axis=0) - 2.0, points.max(axis=0) + 2.0
    return float(left), float(bottom), float(right), float(top)


def _draw_scenery(axes: Axes, scenery: Scenery) -> None:
    from matplotlib.patches import Rectangle

    for solid in scenery.obstacles:
        axes.add_patch(
            Rectangle(
                (solid.x_m - solid.length_m / 2, solid.y_m - solid.width_m / 2),
                solid.length_m,
                solid.width_m,
                angle=math.degrees(solid.heading_rad),
                rotation_point="center",
                facecolor=_SOLID,
                edgecolor=MUTED,
                linewidth=0.6,
            )
        )


def _draw_robot(axes: Axes, log: EpisodeLog) -> None:
    from matplotlib.collections import LineCollection

    segments = np.stack([log.robot_xy_m[:-1], log.robot_xy_m[1:]], axis=1)
    colours = [STATE_COLOURS.get(str(name), INK) for name in log.state[:-1]]
    wrong = (log.followed != NOBODY) & (log.followed != log.target)
    axes.add_collection(
        LineCollection(list(segments[wrong[:-1]]), colors=_WRONG, linewidths=7.0, alpha=0.35)
    )
    axes.add_collection(LineCollection(list(segments), colors=colours, linewidths=2.4, zorder=3))


def _draw_marks(axes: Axes, log: EpisodeLog) -> None:
    stride = max(1, round(_MARK_EVERY_S / log.period_s))
    for index in range(0, len(log.t_s), stride):
        for points, colour in (
            (log.robot_xy_m, INK),
            (log.people_xy_m[:, log.target], _TARGET),
        ):
            x_m, y_m = points[index]
            axes.plot(x_m, y_m, "o", color=colour, markersize=3.5, zorder=4)
            axes.annotate(
                f"{log.t_s[index]:.0f}", (x_m, y_m), xytext=(3, 3), textcoords="offset points",
                fontsize=7, color=colour, zorder=4,
            )  # fmt: skip


def _draw_legend(axes: Axes, log: EpisodeLog) -> None:
    from matplotlib.lines import Line2D

    shown: NDArray[np.str_] = np.unique(log.state)
    handles: list[Artist] = [
        Line2D([], [], color=colour, linewidth=2.4, label=f"robot, {state}")
        for state, colour in STATE_COLOURS.items()
        if state in shown
    ]
    handles += [
        Line2D([], [], color=_TARGET, linewidth=1.6, label="target"),
        Line2D([], [], color=_OTHER, linewidth=1.0, label="others"),
        Line2D([], [], color=_WRONG, linewidth=7.0, alpha=0.35, label="acts upon somebody else"),
    ]
    set_legend(axes, columns=6, handles=handles)
