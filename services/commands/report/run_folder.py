"""The facts of a run, from the folder of `heel run --out`: whole, without a trace, or cut off."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heel.schemas.errors import HeelError
from heel.services.commands.report.facts import Curve, Event, Facts, Sighting, Spans, doubts_of

if TYPE_CHECKING:
    from heel.evaluation.rows import BoxRows

TRACKS, COMMANDS, STATES, SUMMARY = "tracks.txt", "commands.csv", "states.csv", "summary.json"
_ASSUMED_FPS = 25.0
"""Frames a second where nothing says how many there were: the usual rate of recordings."""
_MOST_BYTES = 512 << 20
"""Largest file of a run that is read: days of commands; chosen by hand."""

Row = dict[str, str]


def read_run(folder: Path, trace: Path | None) -> Facts:
    """What a run has left, as far as it got.

    Args:
        folder: of `heel run --out`.
        trace: file of `heel run --trace`, None for none.

    Raises:
        HeelError: it is no such folder, or the trace cannot be read.
    """
    if not any((folder / name).is_file() for name in (TRACKS, COMMANDS, SUMMARY)):
        raise HeelError(
            f"{folder}: no run of `heel run --out` and no recording: give the folder of a run, or "
            "an MCAP file of `heel record`"
        )
    facts = Facts(folder.resolve().name, "run")
    summary = _summary(folder / SUMMARY, facts)
    clock = _Clock(summary, facts)
    commands = list(_rows(folder / COMMANDS, facts))
    _take_commands(commands, clock, facts)
    targets = _take_states(list(_rows(folder / STATES, facts)), commands, clock, facts)
    _take_tracks(folder / TRACKS, targets, clock, facts)
    facts.events = doubts_of(facts.states)
    if trace is None:
        facts.notes.append(
            "without a trace the tracker's own decisions are not told: `heel run --trace FILE`, "
            "then `heel report --trace FILE`"
        )
    else:
        facts.events += _traced(trace)
    facts.events.sort(key=lambda one: one.t_s)
    return facts


class _Clock:
    """From a frame's number to seconds since the beginning, and what size its pixels are of."""

    def __init__(self, summary: dict[str, Any], facts: Facts) -> None:
        camera = summary.get("camera")
        fps = camera.get("fps") if isinstance(camera, dict) else None
        self._fps = float(fps) if isinstance(fps, int | float) and 0 < fps <= 1000 else _ASSUMED_FPS
        size = (camera.get("width"), camera.get("height")) if isinstance(camera, dict) else ()
        self.size: tuple[int, int] | None = None
        match size:
            case (int(width), int(height)) if width > 0 and height > 0:
                self.size = (width, height)
        if not isinstance(fps, int | float):
            facts.notes.append(
                f"nothing says how many frames a second there were: times are told as if "
                f"{_ASSUMED_FPS:g}"
            )

    def t_s(self, frame: int) -> float:
        """Of a frame counted from 1."""
        return (frame - 1) / self._fps


def _summary(path: Path, facts: Facts) -> dict[str, Any]:
    try:
        summary = json.loads(path.read_bytes())
    except OSError:
        facts.notes.append("no summary: the run was ended by force, or still lasts")
        return {}
    except ValueError:
        facts.notes.append("the summary cannot be read: the run was ended by force, or still lasts")
        return {}
    if not isinstance(summary, dict):
        return {}
    with suppress(KeyError, TypeError, AttributeError, ValueError):
        _take_summary(summary, facts)
    return summary


def _take_summary(summary: dict[str, Any], facts: Facts) -> None:
    """Note what a summary says; of an older one what is there."""
    camera = summary.get("camera") or {}
    people = summary.get("perception") or {}
    frames = summary["frames"]
    facts.about += [
        ("delivery", str(summary["mode"])),
        ("ended", str(summary["ended"])),
        ("frames", f"{frames['captured']} captured, {frames['tracked']} tracked"),
    ]
    if camera:
        size = f"{camera['width']}x{camera['height']} at {camera['fps']:g} frames/s"
        facts.about += [("source", str(camera["source"])), ("pictures", size)]
    if people:
        network = f", network {people['model']}" if people["model"] else ""
        facts.about += [("detector", f"{people['detector']}{network}"), ("tracker",
                         f"preset {people['tracker']}")]  # fmt: skip
    versions = summary["versions"]
    facts.about.append(("software", f"heel-follow {versions['heel-follow']}"))
    lost = {name: count for name, count in summary["dropped"].items() if count}
    if lost:
        facts.notes.append("frames lost by " + ", ".join(f"{n}: {c}" for n, c in lost.items()))
    facts.age_table = {str(hop): dict(ages) for hop, ages in summary["age_ms"].items()}
    facts.health = [
        (str(name), f"{spent:.1f} s of processor time, {_peak(summary, name)} MB at most")
        for name, spent in summary["cpu_s"].items()
    ]
    facts.settings = dict(summary["settings"])


def _peak(summary: dict[str, Any], name: str) -> str:
    return f"{summary['peak_rss_mb'].get(name, math.nan):.0f}"


def _rows(path: Path, facts: Facts) -> Iterator[Row]:
    """Rows of a table that are whole; a row cut off by SIGKILL is the last one."""
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise HeelError(f"{path}: {path.stat().st_size >> 20} MB, larger than any run's")
        with path.open(newline="", encoding="utf-8", errors="replace") as file:
            for row in csv.DictReader(line.replace("\0", "") for line in file):
                if None not in row.values() and None not in row:
                    yield row
    except FileNotFoundError:
        facts.notes.append(f"no {path.name}: what is in it is left out")
    except (OSError, csv.Error) as error:
        facts.notes.append(f"{path.name} cannot be read to its end ({error})")


def _take_commands(rows: list[Row], clock: _Clock, facts: Facts) -> None:
    linear, angular, states = Curve("commanded"), Curve("commanded"), Spans()
    t_s = 0.0
    for row in rows:
        try:
            t_s = max(t_s, clock.t_s(int(row["frame"]))) if row["frame"] else t_s
            linear_mps, angular_radps = float(row["linear_mps"]), float(row["angular_radps"])
            states.take(t_s, row["state"], row["reason"])
        except (KeyError, ValueError):
            continue
        linear.add(t_s, linear_mps)
        angular.add(t_s, angular_radps)
    facts.states = states.end(t_s)
    facts.duration_s = t_s
    if linear.values:
        facts.linear, facts.angular = [linear], [angular]


def _take_states(
    rows: list[Row], commands: list[Row], clock: _Clock, facts: Facts
) -> list[tuple[int, int | None, str]]:
    """Take the follower's states; returns from which frame on who was the target, and the state."""
    frames = {row["seq"]: row["frame"] for row in commands if row.get("frame")}
    target, nearest = Curve("target"), Curve("nearest person")
    sure, other = Curve("target"), Curve("best other person")
    targets: list[tuple[int, int | None, str]] = []
    for row in rows:
        try:
            frame = int(frames[row["seq"]])
            t_s = clock.t_s(frame)
            who = int(row["target"]) if row["target"] else None
            target.add(t_s, _number(row["distance_m"]))
            nearest.add(t_s, _number(row["nearest_person_m"]))
            sure.add(t_s, _number(row["identity_confidence"]))
            other.add(t_s, _number(row["runner_up_confidence"]))
        except (KeyError, ValueError):
            continue
        targets.append((frame, who, row["state"]))
    if targets:
        facts.distances, facts.confidences = [target, nearest], [sure, other]
    return targets


def _number(text: str) -> float | None:
    return float(text) if text else None


def _take_tracks(
    path: Path, targets: list[tuple[int, int | None, str]], clock: _Clock, facts: Facts
) -> None:
    """Note where the target was, in pixels of the source."""
    if not path.is_file() or not path.stat().st_size:
        facts.notes.append("no tracks: nobody was found")
        return
    rows = _read_tracks(path, facts)
    if rows is None:
        return
    boxes = {
        (int(frame), int(key)): box.tolist()
        for frame, key, box in zip(rows.frames, rows.identities, rows.boxes_xyxy, strict=True)
    }
    for frame, who, state in targets:
        box = boxes.get((frame, who or 0))
        if box is not None:
            left, top, right, bottom = box
            facts.sightings.append(
                Sighting(
                    clock.t_s(frame), (0, frame), who or 0, (left, top, right, bottom), clock.size,
                    state,
                )
            )  # fmt: skip
    last = clock.t_s(int(rows.frames.max()))
    facts.duration_s = max(facts.duration_s, last)


def _read_tracks(path: Path, facts: Facts) -> BoxRows | None:
    from heel.evaluation.motchallenge import read_tracks

    try:
        return read_tracks(path)
    except HeelError as error:
        facts.notes.append(f"tracks cannot be read: {error}")
        return None


def _traced(path: Path) -> list[Event]:
    """What the tracker decided, in sentences."""
    from heel.services.tracker.story import sentence
    from heel.services.tracker.trace_file import read_trace

    return [
        Event(one.t_s, "tracker", one.kind, sentence(one),
              tuple(key for key in (one.id, one.other) if key), one.frame)
        for one in read_trace(path)
    ]  # fmt: skip
