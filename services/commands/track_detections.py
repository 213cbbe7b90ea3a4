"""`heel track-detections`: the tracker alone, on the boxes of a MOTChallenge det.txt."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import HeelError, SettingsError
from heel.services.commands.shared_options import TraceTo

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from heel.evaluation.rows import BoxRows
    from heel.services.tracker.boxes.sequence import GivenSequence, Picture
    from heel.services.tracker.report import Report
    from heel.services.tracker.settings import TrackerServiceSettings

_REACH = 1.5
"""How far boxes may go on outside of the picture [picture sides]; chosen by hand."""
_SAME_SHAPE = 0.02
"""Largest relative difference of aspect ratios that counts as rounding of sizes; chosen by hand."""


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
        typer.Option(help="settings file (TOML): the tracker's table counts", metavar="FILE"),
    ] = None,
    trace: TraceTo = None,
) -> None:  # fmt: skip
    """Give the boxes of DET identities, online; write MOTChallenge rows to TRACKS."""
    from heel.evaluation.motchallenge import write_tracks
    from heel.services.capture.numbered_pictures import pictures_by_number
    from heel.services.tracker.boxes.sequence import track_sequence
    from heel.services.tracker.people.tuning import FILE, tuned
    from heel.services.tracker.trace import Trace
    from heel.services.tracker.trace_file import TraceFile

    given = read_given(detections, fps, image_size)
    picture = None if frames is None else _of_size(pictures_by_number(frames), given, frames)
    settings = _settings(config)
    if settings.min_height is not None and given.image_size is None:
        raise SettingsError(
            f"tracker.min_height = {settings.min_height:g}: it is a share of the picture's height: "
            "give --image-size"
        )
    picture = picture if settings.identify else None
    tuning, noted = tuned(FILE, settings), Trace()
    with ExitStack() as stack:
        if (traced := trace or settings.trace) is not None:
            noted.add(stack.enter_context(TraceFile(traced)).take)
        rows = shown_rows(track_sequence(given, tuning, picture, noted))
    write_tracks(out, rows)
    people = len(set(rows.identities.tolist()))
    typer.echo(f"wrote {out}: {len(rows)} boxes, {people} identities")


def shown_rows(tracked: Iterable[tuple[int, list[Report]]]) -> BoxRows:
    """What `track_sequence` yields, as rows of a tracks file."""
    import numpy as np

    from heel.evaluation.rows import rows_from_xyxy

    shown = [(frame, track) for frame, tracks in tracked for track in tracks]
    return rows_from_xyxy(
        [frame for frame, _ in shown],
        [track.id for _, track in shown],
        np.array([track.box_xyxy for _, track in shown]),
        [track.identity_confidence for _, track in shown],
    )


def read_given(
    detections: Path, fps: float | None = None, image_size: str | None = None
) -> GivenSequence:
    """Boxes of a det.txt or sequence folder; what is not given comes from its seqinfo.ini.

    Raises:
        HeelError: a file is missing, empty or malformed, or nothing tells the frame rate.
    """
    from heel.evaluation.motchallenge import read_detections, read_sequence_info
    from heel.evaluation.plausible import MOST_FRAMES_WITHOUT_BOXES, check_size
    from heel.services.sequence_file import sequence_file
    from heel.services.tracker.boxes.sequence import GivenSequence

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
    if count > int(rows.frames.max()) + MOST_FRAMES_WITHOUT_BOXES:
        raise HeelError(
            f"{described}: seqLength = {count}, and the last box is in frame {rows.frames.max()}: "
            "correct it"
        )
    if size is not None:
        check_size(rows, size, str(file))
    return GivenSequence(rows.frames, rows.boxes_xyxy, _positive(rows.values), fps, count, size)


def _positive(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scores of any scale but logarithms of odds, which become probabilities.

    The tracker takes scores as shares of a usual person's, whatever that is; below 0 there is no
    share. All alike, such as -1, say nothing and stay.
    """
    if not len(scores) or scores.min() >= 0 or scores.min() == scores.max():
        return scores
    import numpy as np

    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(scores, -50.0, 50.0))))


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise SettingsError(f"--image-size {text!r}: give WIDTHxHEIGHT in pixels, e.g. 768x576")
    return int(width), int(height)


def _settings(file: Path | None) -> TrackerServiceSettings:
    from heel.services.runtime.settings import load_settings
    from heel.services.tracker.settings import TrackerServiceSettings

    return load_settings("tracker", TrackerServiceSettings, {}, file).service


def _of_size(picture: Picture, given: GivenSequence, where: Path) -> Picture:
    """The same pictures, of the size that the boxes are for."""
    import cv2
    import numpy as np

    def read(frame: int) -> NDArray[np.uint8]:
        image = picture(frame)
        size = _size_for_boxes(f"{where}: frame {frame}", (image.shape[1], image.shape[0]), given)
        return image if size is None else np.asarray(cv2.resize(image, size), np.uint8)

    return read


def _size_for_boxes(
    where: str, found: tuple[int, int], given: GivenSequence
) -> tuple[int, int] | None:
    """The size that a picture must get so that the boxes fit it, None if they do.

    Raises:
        HeelError: it is not a matter of scale, or nothing tells the size of the boxes' pictures.
    """
    if given.image_size == found:
        return None
    shown = f"{where}: {found[0]}x{found[1]} pixels"
    if given.image_size is None:
        right, bottom = given.boxes[:, 2:].max(axis=0) if len(given.boxes) else (0.0, 0.0)
        if right > _REACH * found[0] or bottom > _REACH * found[1]:
            raise HeelError(
                f"{shown}, and boxes reach to {right:.0f}x{bottom:.0f}: give the size of the "
                "pictures that they were made on with --image-size, or those pictures"
            )
        return None
    wanted = given.image_size
    if abs(wanted[0] * found[1] / (wanted[1] * found[0]) - 1) > _SAME_SHAPE:
        raise HeelError(
            f"{shown}, and the boxes are for {wanted[0]}x{wanted[1]} (--image-size or "
            "seqinfo.ini): give pictures of the shape that they were made on"
        )
    return wanted
