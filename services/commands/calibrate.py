"""`heel calibrate`: a camera's mount from a person of known height, its lens from a board."""

from __future__ import annotations

import logging
import math
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from heel.schemas.errors import HeelError, SettingsError
from heel.services.geometry.camera import Pinhole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from heel.services.geometry.board import Board, View, Views
    from heel.services.web.board_page import BoardPreview

    FloatArray = NDArray[np.float64]


app = typer.Typer(
    help="The camera's lens from a board, its mount from a person who walks about.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.command()
def board(
    source: Annotated[
        str, typer.Argument(help="recording, folder of pictures, or camera", metavar="SOURCE")
    ],
    board: Annotated[
        str,
        typer.Option(
            help="inner corners of a checkerboard; squares, with --marker-mm",
            metavar="COLUMNSxROWS",
        ),
    ] = "9x6",
    square_mm: Annotated[
        float, typer.Option(min=1, max=1000, help="side of a square, millimetres")
    ] = 25.0,
    marker_mm: Annotated[
        float | None,
        typer.Option(min=1, max=1000, help="a ChArUco board: side of its markers, millimetres"),
    ] = None,
    dictionary: Annotated[str, typer.Option(help="of a ChArUco board's markers")] = "5X5_100",
    fisheye: Annotated[
        bool, typer.Option("--fisheye", help="fit a fisheye: for lenses above 110 degrees")
    ] = False,
    seconds: Annotated[
        float, typer.Option(min=1, max=3600, help="longest look at a camera")
    ] = 120.0,
    out: Annotated[
        Path | None, typer.Option(help="file for `heel capture --lens`", metavar="FILE")
    ] = None,
    web: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            metavar="PORT",
            help="show picture and coverage on a page at this port of loopback; 0: a free one",
        ),
    ] = None,
) -> None:
    """Estimate focal length and distortion; write them as a ROS camera_info file."""
    from heel.services.geometry.board import estimate_lens
    from heel.services.geometry.lens_file import write_lens

    columns, rows = _counts(board)
    wanted = _board_of(columns, rows, square_mm, marker_mm, dictionary)
    with ExitStack() as stack:
        preview = None if web is None else stack.enter_context(_preview(web))
        estimate = estimate_lens(_views(source, wanted, seconds, preview), fisheye)
        found = estimate.found
        camera = Pinhole.through(found.lens, found.width_px, found.height_px)
        result = (
            f"field of view {math.degrees(camera.horizontal_fov_rad):.1f} degrees, focal length "
            f"{found.lens.focal_px[0]:.1f} px; {estimate.views} views cover "
            f"{estimate.covered:.0%} of the picture; corners are {estimate.residual_px:.2f} px off"
        )
        typer.echo(result)
        if preview is not None:
            preview.end(result)
    if out is not None:
        write_lens(out, found, "heel")
        typer.echo(f"wrote {out}: use it with `heel capture --lens {out}`")


def _counts(text: str) -> tuple[int, int]:
    columns, _, rows = text.lower().partition("x")
    if not (columns.isdecimal() and rows.isdecimal() and min(int(columns), int(rows)) >= 3 and
            max(int(columns), int(rows)) <= 64):  # fmt: skip
        raise SettingsError(f"--board {text}: give COLUMNSxROWS, from 3 to 64 each, e.g. 9x6")
    return int(columns), int(rows)


def _board_of(
    columns: int, rows: int, square_mm: float, marker_mm: float | None, dictionary: str
) -> Board:
    from heel.services.geometry.board import CharucoBoard, Checkerboard

    if marker_mm is None:
        return Checkerboard(columns, rows, square_mm / 1000)
    return CharucoBoard(columns, rows, square_mm / 1000, marker_mm / 1000, dictionary)


@contextmanager
def _preview(port: int) -> Iterator[BoardPreview]:
    """A page that shows what is found; how it ended badly, too.

    Raises:
        HeelError: the port is taken.
    """
    from heel.services.web.board_page import board_page

    with board_page(port, logging.getLogger("heel.board")) as (url, preview):
        typer.echo(f"page at {url}")
        try:
            yield preview
        except HeelError as error:
            preview.end(str(error))
            raise


def _views(source: str, board: Board, seconds: float, preview: BoardPreview | None) -> Views:
    """Views of the board in a source; what is still missing is said while a camera looks.

    Raises:
        HeelError: it cannot be read, or its pictures change their size.
    """
    import cv2

    from heel.services.geometry.board import MOST_VIEWS, Views
    from heel.services.pipeline import RecordedFrames

    views: Views | None = None
    end_s = time.monotonic() + seconds
    with RecordedFrames(source) as frames:
        for _, image, _ in frames:
            size = image.shape[1], image.shape[0]
            views = views or Views(size)
            if size != views.size_px:
                raise HeelError(f"{source}: pictures of {views.size_px} and {size}: give one size")
            view = board.find(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8))
            kept = view is not None and views.add(view)
            if kept and frames.source.is_live:
                hint = f"; show it in the {views.missing}" if views.missing else ""
                typer.echo(f"{len(views.chosen)} views, {views.covered.mean():.0%} covered{hint}")
            if preview is not None:
                preview.show(image, shown(views, view, kept))
            if len(views.chosen) >= MOST_VIEWS and not views.missing:
                break
            if frames.source.is_live and time.monotonic() > end_s:
                break
    if views is None:
        raise HeelError(f"{source}: no picture")
    return views


def shown(views: Views, view: View | None, kept: bool) -> dict[str, Any]:
    """What the page says beside a picture.

    Args:
        views: with this one, if it was kept.
        view: the board in this picture; None where it was not found.
        kept: whether it differs from those before.
    """
    from heel.services.geometry.board import LEAST_VIEWS, MOST_VIEWS

    if view is None:
        seen = "no board found: hold it flat, still, in the light, as a whole"
    elif kept:
        seen = f"view {len(views.chosen)} is kept"
    else:
        seen = "as a view that is kept already: move or tilt it"
    if views.missing:
        then = f"show it in the {views.missing}"
    elif len(views.chosen) < LEAST_VIEWS:
        then = "tilt it this way and that"
    else:
        then = f"all is covered: go on tilting it, up to {MOST_VIEWS} views"
    return {
        "views": len(views.chosen), "least": LEAST_VIEWS, "covered": views.covered.tolist(),
        "wanted": views.wanted, "width": views.size_px[0], "kept": kept, "seen": seen,
        "next": then, "corners": [] if view is None else view.pixels.round(1).tolist(),
    }  # fmt: skip


@app.command()
def person(
    source: Annotated[
        str, typer.Argument(help="recording, or tracks.txt of one", metavar="SOURCE|TRACKS")
    ],
    person_height: Annotated[
        float, typer.Option(min=0.5, max=2.5, help="height of the person, metres, with shoes")
    ],
    fov_deg: Annotated[
        float | None,
        typer.Option(help="horizontal field of view, degrees [default: estimated, too]"),
    ] = None,
    image_size: Annotated[
        str | None, typer.Option(help="size of the picture, for tracks", metavar="WxH")
    ] = None,
    track: Annotated[
        int | None,
        typer.Option("--person", help="id of the person [default: the one with most boxes]"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="file for `heel capture --calibration`", metavar="FILE")
    ] = None,
) -> None:
    """Estimate mounting height, pitch and field of view; write them to a calibration file."""
    from heel.services.geometry.calibrate import estimate_mount
    from heel.services.geometry.calibration_file import calibration_of, write_calibration

    if fov_deg is not None and not 0 < fov_deg < 180:
        raise SettingsError(f"--fov-deg {fov_deg:g}: give degrees between 0 and 180")
    file = Path(source)
    if file.suffix == ".txt" and file.is_file():
        boxes, size = _of_tracks(file, image_size), _size(image_size)
    else:
        boxes, size = _of_recording(source)
    chosen = _most_seen(boxes) if track is None else track
    if chosen not in boxes:
        raise HeelError(f"{source}: nobody has id {chosen}; ids: {_listed(boxes)}")
    fov_rad = None if fov_deg is None else math.radians(fov_deg)
    estimate = estimate_mount(boxes[chosen], size, person_height, fov_rad)
    camera = estimate.camera
    typer.echo(
        f"height {camera.mount_height_m:.2f} m +- {estimate.mount_height_sigma_m:.2f}, "
        f"pitch {math.degrees(camera.pitch_rad):.1f} degrees "
        f"+- {math.degrees(estimate.pitch_sigma_rad):.1f}, "
        f"field of view {math.degrees(camera.horizontal_fov_rad):.1f} degrees "
        f"+- {math.degrees(estimate.fov_sigma_rad):.1f}"
    )
    typer.echo(
        f"person {chosen}: {estimate.boxes} boxes; heads are {estimate.residual_px:.1f} px off "
        f"({estimate.residual_share:.1%} of the box height)"
    )
    if out is not None:
        write_calibration(out, calibration_of(estimate, source, person_height))
        typer.echo(f"wrote {out}: use it with `heel capture --calibration {out}`")


def _most_seen(boxes: dict[int, FloatArray]) -> int:
    return max(boxes, key=lambda one: (len(boxes[one]), -one))


def _listed(boxes: dict[int, FloatArray]) -> str:
    return ", ".join(str(one) for one in sorted(boxes)[:20])


def _of_tracks(file: Path, image_size: str | None) -> dict[int, FloatArray]:
    """Boxes per id of a MOTChallenge file.

    Raises:
        HeelError: malformed, empty, or the picture's size is not given.
    """
    from heel.evaluation.motchallenge import read_tracks

    if image_size is None:
        raise SettingsError(f"{file}: tracks do not tell the picture's size; give --image-size WxH")
    rows = read_tracks(file)
    people = Counter(rows.identities.tolist())
    if not people:
        raise HeelError(f"{file}: no boxes; let one person walk about before the camera")
    return {one: rows.boxes_xyxy[rows.identities == one] for one in people}


def _size(text: str | None) -> tuple[int, int]:
    width, _, height = (text or "").lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise SettingsError(f"--image-size {text!r}: give WIDTHxHEIGHT in pixels, e.g. 640x480")
    return int(width), int(height)


def _of_recording(source: str) -> tuple[dict[int, FloatArray], tuple[int, int]]:
    """Boxes per id of people seen well in a recording, and the picture's size.

    Raises:
        HeelError: it cannot be read, or shows no person.
    """
    from heel.services.pipeline import RecordedFrames, load_pipeline

    pipeline, _ = load_pipeline("default", "none", None)
    seen: dict[int, list[tuple[float, float, float, float]]] = {}
    size = (0, 0)
    with RecordedFrames(source) as frames:
        if frames.source.is_live:
            raise HeelError(
                f"{frames.source.name}: give a recording; record one with `heel run` first"
            )
        for frame, image, source_size in frames:
            tracks = pipeline.step(frame, image, source_size).tracks
            size = (tracks.width, tracks.height)
            for track in tracks.tracks:
                if track.shown and track.state == "tracked":
                    seen.setdefault(track.id, []).append(track.box_xyxy)
    if not seen:
        raise HeelError(f"{source}: nobody was seen; let one person walk about before the camera")
    return {one: np.array(boxes) for one, boxes in seen.items()}, size
