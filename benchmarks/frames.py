"""A good frame and a bad one of our own drawn scene, side by side, for docs/records/results.md.

Good is the frame with the most people of those without a mistake, bad the one with the most
mistakes: people missed and boxes on nobody, IoU 0.5.

Example run: python -m benchmarks.frames docs/records/frames.jpg
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from heel.schemas import Tracks
from heel.schemas.errors import HeelError
from heel.services.drawing import Annotator
from heel.services.geometry.assignment import heaviest_pairs
from heel.services.geometry.boxes import iou_matrix
from heel.services.pipeline import RecordedFrames, load_pipeline, scene_truth
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SCENE = "scene:demo"
_IOU = 0.5
_SETTLED_FRAMES = 50
"""The first frames, in which the background is learned, show nothing else."""
_JPEG_QUALITY = 85
Boxes = NDArray[np.float64]


@dataclass
class Kept:
    """The best candidate so far."""

    rank: tuple[int, int]
    picture: NDArray[np.uint8]


def true_boxes() -> dict[int, Boxes]:
    """(N, 4) xyxy of the people that are to be seen, by frame from 1."""
    boxes: dict[int, list[list[float]]] = {}
    for row in scene_truth(SCENE).rows:
        frame, _, left, top, width, height, flag = (float(cell) for cell in row.split(",")[:7])
        if flag:
            corner = [left - 1, top - 1]
            boxes.setdefault(int(frame), []).append([*corner, left - 1 + width, top - 1 + height])
    return {frame: np.array(rows) for frame, rows in boxes.items()}


def mistakes(tracks: Tracks, truth: Boxes) -> int:
    """People missed and boxes on nobody."""
    shown = np.array([track.box_xyxy for track in tracks.tracks if track.shown]).reshape(-1, 4)
    overlap = iou_matrix(truth, shown)
    pairs = heaviest_pairs(overlap)
    return len(truth) + len(shown) - 2 * int((overlap[pairs] >= _IOU).sum())


@app.command()
def main(file: Annotated[Path, typer.Argument(help="where the picture goes")]) -> None:
    """Run the default preset over the drawn scene and keep its best and its worst frame."""
    pipeline, _ = load_pipeline("default", "none", None, model="none")
    truth, annotator = true_boxes(), Annotator()
    good: Kept | None = None
    bad: Kept | None = None
    with RecordedFrames(SCENE) as frames:
        for frame, image, source_size in frames:
            tracks = pipeline.step(frame, image, source_size).tracks
            people = truth.get(frame.index + 1, np.zeros((0, 4)))
            wrong = mistakes(tracks, people)
            caption = f"frame {frame.index + 1}: {len(people)} people, {wrong} mistakes"
            picture = annotator.draw(image, tracks, None, caption)
            if frame.index < _SETTLED_FRAMES:
                continue
            if good is None or (-wrong, len(people)) > good.rank:
                good = Kept((-wrong, len(people)), picture)
            if bad is None or (wrong, len(people)) > bad.rank:
                bad = Kept((wrong, len(people)), picture)
    if good is None or bad is None:
        raise HeelError(f"{SCENE} has no frame after its first {_SETTLED_FRAMES}")
    both = np.hstack([good.picture, bad.picture])
    if not cv2.imwrite(str(file), both, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]):
        raise HeelError(f"{file} cannot be written: give a folder that exists")
    typer.echo(f"wrote {file}")


if __name__ == "__main__":
    run_app(app)
