"""Detector and tracker, milliseconds a frame on one core, decoding left out.

`tracks after` is how long a frame's tracks take in the tracker; `learned after` is what is done
once they are sent: the scene's scale. Without that step tracks would take both.

Example run: python -m benchmarks.speed --write docs/records/results.md
"""

from __future__ import annotations

import time

import cv2
import numpy as np
import typer

from benchmarks.common import (
    Figure,
    Json,
    Recordings,
    Write,
    name_of,
    publish,
    recordings,
    write_json,
)
from heel.services.detector.settings import DetectorSettings
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime import process
from heel.services.runtime.command_line import run_app
from heel.services.tracker.core import warm_up
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
STEPS = ("detector", "tracks after", "learned after", "detector + tracker")
_BUDGET_MS = 15.0


def measure(recording: str) -> dict[str, list[float]]:
    """Milliseconds of every frame by step."""
    pipeline = InProcessPipeline(DetectorSettings(), TrackerSettings())
    spent: dict[str, list[float]] = {step: [] for step in STEPS}
    with RecordedFrames(recording) as frames:
        for frame, image, source_size in frames:
            times = [time.perf_counter()]
            blobs = pipeline.detect(frame, image, source_size)
            times.append(time.perf_counter())
            pipeline.track(blobs)
            times.append(time.perf_counter())
            pipeline.settle()
            times.append(time.perf_counter())
            steps = [1e3 * step_s for step_s in np.diff(times)]
            for step, value in zip(STEPS, (*steps, sum(steps)), strict=True):
                spent[step].append(float(value))
    return spent


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
    json: Json = None,
) -> None:
    """Print median and 95th percentile of every step."""
    cv2.setNumThreads(1)
    process.keep_freed_memory()
    warm_up()
    lines = ["| recording | " + " | ".join(f"{step}, ms" for step in STEPS) + " |"]
    lines.append("|---|" + "---|" * len(STEPS))
    figures = []
    for source in recordings(recording):
        cells = [name_of(source)]
        for step, values in measure(source).items():
            middle, high = np.percentile(values, [50, 95])
            cells.append(f"{middle:.1f} (p95 {high:.1f})")
            name = f"speed/{name_of(source)}/{step}"
            figures.append(
                Figure(name, float(middle), "ms", f"{_BUDGET_MS:g}", float(middle) / _BUDGET_MS, 1)
            )
        lines.append("| " + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n"
    publish(text, write, "speed")
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
