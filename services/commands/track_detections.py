"""`heel track-detections`: the tracker alone, on the boxes of a MOTChallenge det.txt."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.errors import HeelError, SettingsError

if TYPE_CHECKING:
    from evaluation.rows import BoxRows
    from services.tracker.given_boxes.sequence import GivenSequence
    from services.tracker.given_boxes.settings import BoxTrackerSettings
    from services.tracker.given_boxes.track import TrackOutput


def track_detections(
    detections: Annotated[
        Path,
        typer.Argument(
            help="det.txt, or the sequence folder that holds det/det.txt and seqinfo.ini",
            metavar="DET",
        ),
    ],
    out: Annotated[Path, typer.Option(help="file for the tracks", metavar="TRACKS")],
    fps: Annotated[
        float | None, typer.Option(help="frames per second [default: of seqinfo.ini]")
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option(help="folder of pictures, sequence or video: use looks, too", metavar="DIR"),
    ] = None,
    image_size: Annotated[
        str | None, typer.Option(help="size of the picture [default: of seqinfo.ini]",
                                 metavar="WxH")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(help="settings file (TOML) with tables such as [life]", metavar="FILE"),
    ] = None,
) -> None:  # fmt: skip
    """Give the boxes of DET identities, online; write MOTChallenge rows to TRACKS."""
    from evaluation.motchallenge import write_tracks
    from services.capture.numbered_pictures import pictures_by_number
    from services.tracker.given_boxes.sequence import track_sequence

    given = read_given(detections, fps, image_size)
    picture = None if frames is None else pictures_by_number(frames)
    rows = shown_rows(track_sequence(given, _settings(config), picture))
    write_tracks(out, rows)
    people = len(set(rows.identities.tolist()))
    typer.echo(f"wrote {out}: {len(rows)} boxes, {people} identities")


def shown_rows(tracked: Iterable[tuple[int, list[TrackOutput]]]) -> BoxRows:
    """What `track_sequence` yields, as rows of a tracks file."""
    import numpy as np

    from evaluation.rows import rows_from_xyxy

    shown = [(frame, track) for frame, tracks in tracked for track in tracks]
    return rows_from_xyxy(
        [frame for frame, _ in shown],
        [track.track_id for _, track in shown],
        np.array([track.box for _, track in shown]),
        [track.identity_confidence for _, track in shown],
    )


def read_given(
    detections: Path, fps: float | None = None, image_size: str | None = None
) -> GivenSequence:
    """Boxes of a det.txt or sequence folder; what is not given comes from its seqinfo.ini.

    Raises:
        HeelError: a file is missing, empty or malformed, or nothing tells the frame rate.
    """
    from evaluation.motchallenge import read_detections, read_sequence_info
    from services.runtime.sequence_file import sequence_file
    from services.tracker.given_boxes.sequence import GivenSequence

    file = detections / "det" / "det.txt" if detections.is_dir() else detections
    rows = read_detections(file)
    described = sequence_file(file.parent.parent)
    info = None if described is None else read_sequence_info(described)
    fps = fps if fps is not None else info.frame_rate_fps if info else None
    if fps is None:
        raise HeelError(f"{detections}: no seqinfo.ini tells the frame rate; give --fps")
    if not 0 < fps <= 1000:
        raise SettingsError(f"--fps {fps:g}: give frames per second, above 0 and up to 1000")
    size = None if image_size is None else _size(image_size)
    if size is None and info and info.width_px and info.height_px:
        size = (info.width_px, info.height_px)
    count = info.frame_count if info else 0
    return GivenSequence(rows.frames, rows.boxes_xyxy, rows.values, fps, count, size)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise SettingsError(f"--image-size {text!r}: give WIDTHxHEIGHT in pixels, e.g. 768x576")
    return int(width), int(height)


def _settings(file: Path | None) -> BoxTrackerSettings:
    from pydantic import ValidationError

    from services.tracker.given_boxes.settings import BoxTrackerSettings

    if file is None:
        return BoxTrackerSettings()
    try:
        return BoxTrackerSettings.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise SettingsError(f"settings file {file}: {error.strerror}: check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"settings file {file} is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        value = f"{first.get('input')!r:.80}"
        raise SettingsError(f"settings file {file}: {where} = {value}: {first['msg']}") from None
