"""Facts as one HTML page that needs nothing else: no network, no script. Pure."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from heel.services.colours import colour_of
from heel.services.commands.report.charts import STATE_COLOURS, Level, bands, chart, legend
from heel.services.commands.report.facts import (
    DOUBTS,
    Curve,
    Event,
    Facts,
    Span,
    joined,
    shares,
    way_m,
)

_MOST_ROWS = 200
"""Of a table; the page says how many more there are. Chosen by hand."""
_LEAST_STOP_S = 0.3
"""Time of standing that is told as a stop: shorter ones are a command at zero speed on the way;
chosen by hand."""
_SENDERS = {"blobs": "detector", "tracks": "tracker", "command": "follower"}
_SHADED = frozenset((*DOUBTS, "stopped"))


@dataclass(frozen=True)
class _Chart:
    title: str
    drawing: Markup
    legend: list[tuple[str, str]]


def as_html(facts: Facts) -> str:
    """The page."""
    environment = Environment(
        loader=PackageLoader("heel.services.commands.report", "."), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["seconds"] = _seconds
    template = environment.get_template("page.html.jinja")
    stops = [one for one in facts.stops if one.length_s >= _LEAST_STOP_S]
    mine, others = _events(facts)
    return template.render(
        facts=facts, figures=_figures(facts, stops), timeline=_timeline(facts),
        state_colours=STATE_COLOURS, shares=shares(facts.states), charts=_charts(facts),
        crops=_crops(facts), ages=_ages(facts), events=mine[:_MOST_ROWS],
        more_events=max(0, len(mine) - _MOST_ROWS), others=others[:_MOST_ROWS],
        more_others=max(0, len(others) - _MOST_ROWS),
        stops=stops[:_MOST_ROWS], more_stops=max(0, len(stops) - _MOST_ROWS),
        settings=[(name, json.dumps(table, indent=2, default=str))
                  for name, table in sorted(facts.settings.items())],
    )  # fmt: skip


def _figures(facts: Facts, stops: list[Span]) -> list[tuple[str, str]]:
    """What stands large at the top."""
    spent = shares(facts.states)
    whole_s = sum(spent.values())
    figures = [("length", f"{facts.duration_s:.1f} s")]
    if whole_s:
        figures.append(("following", f"{spent.get('following', 0.0) / whole_s:.0%}"))
    doubts = sum(one.name in DOUBTS for one in joined(facts.states))
    figures.append(("doubts", str(doubts)))
    figures.append(("stops", str(len(stops))))
    if facts.linear:
        driven = next((one for one in facts.linear if one.name != "commanded"), facts.linear[0])
        figures.append(("driven" if driven.name != "commanded" else "commanded way",
                        f"{way_m(driven):.1f} m"))  # fmt: skip
        if driven.known.size:
            figures.append(("fastest", f"{np.abs(driven.known).max():.2f} m/s"))
    nearest = [one.known.min() for one in facts.distances if "nearest" in one.name
               and one.known.size]  # fmt: skip
    if nearest:
        figures.append(("nearest anybody", f"{min(nearest):.2f} m"))
    if len(facts.targets) == 1:
        figures.append(("target", f"id {next(iter(facts.targets))}"))
    elif facts.targets:
        figures.append(("targets", ", ".join(map(str, sorted(facts.targets)[:6]))))
    return figures


def _timeline(facts: Facts) -> Markup | None:
    rows = [("follower", facts.states), ("wheels", facts.wheels)]
    known = [(name, joined(spans)) for name, spans in rows if spans]
    return bands(known, facts.duration_s) if known else None


def _charts(facts: Facts) -> list[_Chart]:
    shaded = [one for one in joined(facts.states) if one.name in _SHADED]
    linear = _levels(facts, ("max_linear_mps", "speed limit"))
    angular = _levels(facts, ("max_angular_radps", "turn limit"))
    distance = _levels(facts, ("distance_m", "wished distance"), ("min_distance_m", "least"))
    sure = _levels(facts, ("min_identity_confidence", "waits below"),
                   ("resume_identity_confidence", "goes on above"))  # fmt: skip
    stale_s = facts.limit("follower", "max_tracks_age_s")
    ages = [] if stale_s is None else [Level(1e3 * stale_s, "too old for the follower")]
    wanted: list[tuple[str, list[Curve], str, list[Level], tuple[float, float] | None]] = [
        ("Speed ahead", facts.linear, "m/s", linear, None),
        ("Turning, left is positive", facts.angular, "rad/s", angular, None),
        ("Distance", facts.distances, "m", distance, None),
        ("Who it is: probability", facts.confidences, "", sure, (0.0, 1.05)),
        ("Age of the frame at each hop", facts.ages, "ms", ages, None),
    ]
    return [
        _Chart(
            f"{title}, {unit}" if unit else title,
            chart(curves, facts.duration_s, unit, levels, shaded, bounds),
            legend(curves, levels),
        )
        for title, curves, unit, levels, bounds in wanted
        if any(curve.known.size for curve in curves)
    ]


def _levels(facts: Facts, *names: tuple[str, str]) -> list[Level]:
    found = ((facts.limit("follower", name), words) for name, words in names)
    return [Level(value, words) for value, words in found if value is not None]


def _crops(facts: Facts) -> list[dict[str, Any]]:
    return [
        {
            "src": "data:image/jpeg;base64," + base64.b64encode(one.jpeg).decode(),
            "t_s": one.t_s, "id": one.track_id, "state": one.state,
            "colour": STATE_COLOURS.get(one.state, "#b9c3cd"), "id_colour": _css(one.track_id),
        }
        for one in facts.crops
    ]  # fmt: skip


def _css(track_id: int) -> str:
    red, green, blue = (round(255 * part) for part in colour_of(track_id, lightness=0.45))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _ages(facts: Facts) -> list[tuple[str, ...]]:
    """Hop, median, p95, p99 and greatest age, ms."""
    rows: list[tuple[str, ...]] = []
    for one in facts.ages:
        median, p95, p99 = np.percentile(one.known, (50, 95, 99)).tolist()
        rows.append((one.name, *(f"{value:.1f}" for value in (median, p95, p99, one.known.max()))))
    for topic, told in facts.age_table.items():
        rows.append((_SENDERS.get(topic, topic), *(f"{told.get(name, float('nan')):.1f}"
                            for name in ("median", "p95", "p99")), "-"))  # fmt: skip
    return rows


def _events(facts: Facts) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What concerns the target, the follower and the services, and what does not."""
    mine: list[dict[str, Any]] = []
    others: list[dict[str, Any]] = []
    for one in facts.events:
        concerns = not one.ids or bool(facts.targets & set(one.ids))
        (mine if concerns else others).append(_row(one, facts.confidences))
    return mine, others


def _row(event: Event, confidences: list[Curve]) -> dict[str, Any]:
    known = [curve.at(event.t_s) for curve in confidences]
    sure = " / ".join("-" if value is None else f"{value:.2f}" for value in known)
    return {
        "t_s": event.t_s, "frame": event.frame, "source": event.source, "kind": event.kind,
        "text": event.text, "sure": sure if event.source in ("follower", "tracker") else "",
        "colour": STATE_COLOURS.get(event.kind, "transparent"),
    }  # fmt: skip


def _seconds(t_s: float) -> str:
    minutes, seconds = divmod(t_s, 60)
    return f"{minutes:.0f}:{seconds:04.1f}" if minutes else f"{seconds:.1f} s"
