"""What a camera that moves costs: the cost table of docs/records/moving-camera.md.

Frames of 640x480 on one core: the detector `ego` from the frame to its message, with the tracker's
tracks protecting people, and beside it the ego-motion alone on the same pictures. Decoding and the
tracker are left out. Two recordings are panned over by a window of that size, two moving cameras'
pictures are brought to it.

Example run: python -m benchmarks.ego_cost --write docs/records/moving-camera.md
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import Figure, Json, Write, data_folder, publish, write_json
from heel.schemas import FrameId
from heel.schemas.errors import HeelError
from heel.services.detector.background.evidence import smoothed
from heel.services.detector.scene import WorkSize
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.picture_motion import EgoMotion
from heel.services.loops.panning.scripted import panning, scripted_frames
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime import process
from heel.services.runtime.command_line import run_app
from heel.services.tracker.core import warm_up
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SIZE = (640, 480)
PANNED, MOVING = ("PETS09-S2L1", "TownCentre-B"), ("Jogging", "UAV-person11")
BUDGET_MS = 12.0
STEPS = ("ego-motion alone", "detector")
_WARM_UP_FRAMES = 10
Pictures = Iterator[tuple[FrameId, NDArray[np.uint8]]]


def pictures(name: str) -> Pictures:
    """Frames of 640x480 of a recording, panned over or as its camera moved."""
    folder = data_folder() / name
    if name in PANNED:
        for panned in scripted_frames(folder, SIZE, panning):
            yield panned.id, panned.image
        return
    with RecordedFrames(str(folder)) as frames:
        for frame, image, _ in frames:
            yield frame, np.asarray(cv2.resize(image, SIZE), np.uint8)


def measure(frames: Pictures) -> dict[str, list[float]]:
    """CPU milliseconds of every frame but the first few, by step."""
    settings = DetectorSettings(detector="ego")
    pipeline, ego = InProcessPipeline(settings, TrackerSettings()), EgoMotion()
    size = WorkSize.of_frame(*SIZE, settings.work_width_px)
    free = np.full((size.height, size.width), 255, np.uint8)
    spent: dict[str, list[float]] = {step: [] for step in STEPS}
    for frame, image in frames:
        smooth = smoothed(size.shrink(image), settings.blur_px)
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        times = [time.process_time()]
        ego.update(grey, free)
        times.append(time.process_time())
        blobs = pipeline.detect(frame, image, SIZE)
        times.append(time.process_time())
        pipeline.track(blobs)
        pipeline.settle()
        for step, taken_s in zip(STEPS, np.diff(times).tolist(), strict=True):
            spent[step].append(1e3 * taken_s)
    return {step: values[_WARM_UP_FRAMES:] for step, values in spent.items()}


def row(name: str, spent: dict[str, list[float]]) -> str:
    """One line of the Markdown table: median and 95th percentile of every step."""
    cells = [name, str(len(spent[STEPS[0]]))]
    for step in STEPS:
        middle, high = np.percentile(spent[step], [50, 95])
        cells.append(f"{middle:.1f} (p95 {high:.1f})")
    return "| " + " | ".join(cells) + " |"


@app.command()
def main(
    write: Write = None,
    json: Json = None,
) -> None:
    """Print CPU milliseconds a frame of 640x480."""
    names = [name for name in (*PANNED, *MOVING) if (data_folder() / name).is_dir()]
    if not names:
        raise HeelError(f"no recordings in {data_folder()}: set HEEL_DATA to their folder")
    cv2.setNumThreads(1)
    process.keep_freed_memory()
    warm_up()
    rows, figures = [], []
    for name in names:
        spent = measure(pictures(name))
        rows.append(row(f"{name}, {'panned over' if name in PANNED else 'resized'}", spent))
        typer.echo(rows[-1], err=True)
        for step, values in spent.items():
            middle = float(np.median(values))
            figures.append(
                Figure(f"ego-cost/{name}/{step}", middle, "ms", f"{BUDGET_MS:g}",
                       middle / BUDGET_MS, 1)
            )  # fmt: skip
    head = ["| pictures | frames | " + " | ".join(f"{step}, ms" for step in STEPS) + " |"]
    publish("\n".join([*head, "|---|---|---|---|", *rows]) + "\n", write, "cost")
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
