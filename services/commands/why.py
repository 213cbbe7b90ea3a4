"""`heel why`: what the tracker decided about an id, in sentences."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heel.schemas.errors import HeelError, SettingsError

_MOST_NAMED = 20
"""Ids that are named where one is not in the file; chosen by hand."""


def why(
    file: Annotated[Path, typer.Argument(help="file made with --trace", metavar="FILE")],
    track_id: Annotated[
        int | None, typer.Option("--id", help="whose story [default: everybody's]", min=1)
    ] = None,
    frame: Annotated[
        int | None,
        typer.Option(help="only what happened within 50 frames of this one, from 1", min=1),
    ] = None,
) -> None:
    """Tell what the tracker decided about an id, how sure it was, and what else it might be."""
    from heel.services.tracker.story import ids_of, told
    from heel.services.tracker.trace_file import read_trace

    if track_id is None and frame is None:
        raise SettingsError("heel why: give --id, --frame, or both")
    events = read_trace(file)
    known = sorted(ids_of(events))
    if track_id is not None and track_id not in known:
        named = ", ".join(map(str, known[:_MOST_NAMED])) or "none"
        more = f" and {len(known) - _MOST_NAMED} more" if len(known) > _MOST_NAMED else ""
        raise HeelError(f"{file}: no id {track_id} in it; its ids: {named}{more}")
    for line in told(events, track_id, frame):
        typer.echo(line)
