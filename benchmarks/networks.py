"""Networks that find people: milliseconds a frame by engine, and of the detector that runs them.

Everything on one thread and one core, in one process and in turns, so that whatever else the
machine does hits all alike. Printed are the medians of processor time and wall-clock time, and the
least processor time, which is nearest to that of an idle machine: a busy one empties the caches.

The detector is measured on a recording scaled to 640x480, with the tracker behind it as in a run:
whole frames alone, and with closer looks at small people, which run the network up to three times.

Example run: python -m benchmarks.networks --write docs/records/results.md
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import Figure, Json, T, Write, data_folder, publish, write_json
from heel.schemas import FrameId
from heel.schemas.errors import HeelError
from heel.services.detector.settings import DetectorSettings
from heel.services.networks.engines import onnxruntime
from heel.services.networks.names import EngineName
from heel.services.networks.person_mask import PersonMask
from heel.services.networks.person_model import PersonModel
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime import process
from heel.services.runtime.command_line import run_app
from heel.services.tracker.core import warm_up
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_WIDTH = 640
_SEQUENCE = "PETS09-S2L1"
_SCORE = 0.3
_LOOKS = {"whole frames": 0, "with closer looks": 2}
_ENGINES: tuple[EngineName, ...] = ("opencv", "onnxruntime")
_AT_A_TIME = 10
"""Frames; chosen by hand."""
Taken = tuple[FrameId, NDArray[np.uint8], tuple[int, int]]
"""Its name, its picture and the size of the source."""
Times = dict[tuple[str, str], list[tuple[float, float]]]
"""By network (or what the detector does with it) and engine: processor and wall time, ms."""


def networks(files: list[Path], frames: Sequence[Taken]) -> Times:
    """One look at a whole picture: laid out, run, read."""
    looks: dict[tuple[str, str], Callable[[NDArray[np.uint8]], object]] = {}
    for file in files:
        if file.suffix == ".tflite":
            looks[file.stem, "opencv"] = PersonMask(file).of
            continue
        for engine in _ENGINES:
            looks[file.stem, engine] = partial(_found, PersonModel(file, engine=engine))
    times: Times = {name: [] for name in looks}
    for name, (_, image, _) in _in_turns(list(looks), frames):
        times[name].append(_timed(partial(looks[name], image))[1])
    return times


def detectors(files: list[Path], frames: Sequence[Taken]) -> Times:
    """The detector on every frame, with the tracks of its own boxes fed back."""
    pipelines: dict[tuple[str, str], InProcessPipeline] = {
        (f"{file.stem}, {what}", engine): InProcessPipeline(
            DetectorSettings(model=file, model_engine=engine, model_closer_looks=looks),
            TrackerSettings(),
        )
        for file in files if file.suffix == ".onnx"
        for what, looks in _LOOKS.items()
        for engine in _ENGINES
    }  # fmt: skip
    times: Times = {name: [] for name in pipelines}
    for name, taken in _in_turns(list(pipelines), frames):
        blobs, spent = _timed(partial(pipelines[name].detect, *taken))
        times[name].append(spent)
        pipelines[name].track(blobs)
        pipelines[name].settle()
    return times


def _in_turns(
    names: list[tuple[str, str]], frames: Sequence[Taken]
) -> Iterator[tuple[tuple[str, str], Taken]]:
    """Every frame to everyone, some at a time, so that each finds its weights in the caches."""
    for turn, first in enumerate(range(0, len(frames), _AT_A_TIME)):
        for name in names if turn % 2 == 0 else reversed(names):
            for taken in frames[first : first + _AT_A_TIME]:
                yield name, taken


def read_frames(recording: Path, count: int) -> list[Taken]:
    """The first frames of a recording, 640 pixels wide."""
    with RecordedFrames(str(recording)) as source:
        width = source.source.width
    with RecordedFrames(str(recording), scale=_WIDTH / width) as frames:
        return list(itertools.islice(frames, count))


def _found(model: PersonModel, image: NDArray[np.uint8]) -> object:
    return model.detect(image, _SCORE)


def _timed(call: Callable[[], T]) -> tuple[T, tuple[float, float]]:
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    found = call()
    return found, (1e3 * (time.process_time() - cpu_s), 1e3 * (time.perf_counter() - wall_s))


def table(title: str, times: Times) -> tuple[list[str], list[Figure]]:
    """Medians by engine, and how often as fast the second one is."""
    lines = [
        f"| {title} | OpenCV, ms | onnxruntime, ms | ratio |",
        "|---|---|---|---|",
    ]
    figures = []
    for name in dict.fromkeys(network for network, _ in times):
        middle = {
            engine: np.median(times[name, engine], axis=0).tolist()
            for engine in _ENGINES if (name, engine) in times
        }  # fmt: skip
        cells = [_cell(times[name, engine]) if engine in middle else "-" for engine in _ENGINES]
        both = len(middle) == len(_ENGINES)
        ratio = middle["opencv"][0] / middle["onnxruntime"][0] if both else None
        lines.append(f"| {name} | {' | '.join(cells)} | {f'{ratio:.2f}' if ratio else '-'} |")
        for engine, (cpu_ms, _) in middle.items():
            against = ratio if engine == "onnxruntime" else None
            figures.append(
                Figure(f"networks/{name}/{engine}", cpu_ms, "ms", "OpenCV", against,
                       len(times[name, engine]))
            )  # fmt: skip
    return lines, figures


def _cell(spent: Sequence[tuple[float, float]]) -> str:
    cpu_ms, wall_ms = np.median(spent, axis=0).tolist()
    return f"{cpu_ms:.1f} (least {min(spent)[0]:.1f}, wall {wall_ms:.1f})"


@app.command()
def main(
    model: Annotated[
        list[Path] | None, typer.Option(help="measure these [default: those in HEEL_DATA/models]")
    ] = None,
    frames: Annotated[int, typer.Option(min=3, help="of the recording")] = 60,
    write: Write = None,
    json: Json = None,
) -> None:
    """Print medians of every network and of the detector with it."""
    if onnxruntime() is None:
        raise HeelError("there is nothing to compare with: pip install onnxruntime")
    files = model or sorted((data_folder() / "models").glob("*.*"))
    recording = data_folder() / _SEQUENCE
    if not files or not recording.is_dir():
        raise HeelError(f"no models, or no {_SEQUENCE}, in {data_folder()}: set HEEL_DATA")
    cv2.setNumThreads(1)
    process.keep_freed_memory()
    warm_up()
    taken = read_frames(recording, frames)
    lines, figures = table("a look at 640x480", networks(files, taken))
    more, others = table("detector, 640x480", detectors(files, taken))
    publish("\n".join([*lines, "", *more]) + "\n", write, "networks")
    write_json([*figures, *others], json)


if __name__ == "__main__":
    run_app(app)
