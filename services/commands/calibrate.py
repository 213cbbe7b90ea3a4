"""`heel calibrate`: the camera's mount, from a person of known height that walks about."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import HeelError, SettingsError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]


def calibrate(
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
    person: Annotated[
        int | None, typer.Option(help="id of the person [default: the one with most boxes]")
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
    chosen = _most_seen(boxes) if person is None else person
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
    import numpy as np

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
