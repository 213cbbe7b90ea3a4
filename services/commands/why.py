"""`heel why`: what the tracker decided about an id, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import HeelError, SettingsError

if TYPE_CHECKING:
    from heel.services.tracker.trace import Event

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
    frames: Annotated[
        str | None, typer.Option(help="what was run, for --strip", metavar="SOURCE")
    ] = None,
    tracks: Annotated[
        Path | None, typer.Option(help="tracks.txt of that run, for --strip", metavar="TRACKS")
    ] = None,
    strip: Annotated[
        Path | None,
        typer.Option(help="picture of the people before and after each event", metavar="PNG"),
    ] = None,
) -> None:
    """Tell what the tracker decided about an id, how sure it was, and what else it might be."""
    from heel.services.tracker.story import ids_of, story, told
    from heel.services.tracker.trace_file import read_trace

    if track_id is None and frame is None:
        raise SettingsError("heel why: give --id, --frame, or both")
    if len({given is None for given in (frames, tracks, strip)}) > 1:
        raise SettingsError("heel why: --frames, --tracks and --strip go together: give all three")
    events = read_trace(file)
    known = sorted(ids_of(events))
    if track_id is not None and track_id not in known:
        named = ", ".join(map(str, known[:_MOST_NAMED])) or "none"
        more = f" and {len(known) - _MOST_NAMED} more" if len(known) > _MOST_NAMED else ""
        raise HeelError(f"{file}: no id {track_id} in it; its ids: {named}{more}")
    for line in told(events, track_id, frame):
        typer.echo(line)
    if frames is not None and tracks is not None and strip is not None:
        _write_strip(story(events, track_id, frame), frames, tracks, strip)


def _write_strip(events: Sequence[Event], frames: str, tracks: Path, out: Path) -> None:
    import cv2

    from heel.evaluation.motchallenge import read_tracks
    from heel.services.capture.numbered_pictures import pictures_by_number
    from heel.services.commands.why_strip import strip

    drawn = strip(events, read_tracks(tracks), pictures_by_number(Path(frames)))
    if drawn is None:
        raise HeelError(f"{tracks}: none of the ids is in it: give the tracks of the same run")
    _, content = cv2.imencode(".png", drawn)
    try:
        out.write_bytes(content.tobytes())
    except OSError as error:
        raise HeelError(f"--strip {out}: {error.strerror}: give another file") from None
    typer.echo(f"wrote {out}")
