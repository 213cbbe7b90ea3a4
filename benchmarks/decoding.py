"""How fast recorded video is read, beside OpenCV's reader, in turn so that both meet the same load.

Without a file, scenes are drawn and encoded as H.264. OpenCV reads progressive video right, so that
the two do the same work: the table also says how far their pictures differ.

Example run: python -m benchmarks.decoding VIDEO.mp4
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import av
import cv2
import numpy as np
import typer
from av.video.stream import VideoStream
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from heel.services.capture.sources import open_source
from heel.services.capture.video_file import VideoFileSource
from heel.services.runtime.command_line import run_app
from heel.services.runtime.process import cpu_s, memory_mb
from heel.services.runtime.quiet import silence_decoders

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
ROUNDS = 7
SIZES = ((640, 480), (1920, 1080))
Reader = Callable[[Path], Iterator[NDArray[np.uint8]]]


def by_opencv(path: Path) -> Iterator[NDArray[np.uint8]]:
    """All frames by `cv2.VideoCapture`."""
    silence_decoders()
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    while True:
        done, image = capture.read()
        if not done:
            capture.release()
            return
        yield np.asarray(image, np.uint8)


def by_heel(path: Path) -> Iterator[NDArray[np.uint8]]:
    """All frames by Heel's reader."""
    with VideoFileSource(path, lambda _: None) as source:
        while (frame := source.read()) is not None:
            yield frame.image


READERS: dict[str, Reader] = {"opencv": by_opencv, "heel": by_heel}


def draw(path: Path, width: int, height: int, frames: int = 150) -> Path:
    """A scene as H.264."""
    with open_source(f"scene:demo?width={width}&height={height}&frames={frames}") as source:
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=25, options={"preset": "veryfast"})
            assert isinstance(stream, VideoStream)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            while (picture := source.read()) is not None:
                frame = av.VideoFrame.from_ndarray(picture.image, "bgr24")
                frame.pts, frame.time_base = picture.index, Fraction(1, 25)
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
    return path


def cost(reader: Reader, path: Path) -> tuple[float, float]:
    """Wall and processor milliseconds a frame."""
    wall, processor = time.perf_counter(), cpu_s()
    frames = sum(1 for _ in reader(path))
    return (
        1e3 * (time.perf_counter() - wall) / frames,
        1e3 * (cpu_s() - processor) / frames,
    )


def peak_mb(name: str, path: Path) -> float:
    """Peak memory of a process that reads the file and does nothing else."""
    command = [sys.executable, "-m", "benchmarks.decoding", "--peak", name, str(path)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def compare(path: Path, table: Table) -> None:
    """One row: medians over rounds in turn, and their ratios."""
    difference = max(
        float(np.abs(ours.astype(np.int16) - theirs).mean())
        for ours, theirs in zip(by_heel(path), by_opencv(path), strict=True)
    )
    costs: dict[str, list[tuple[float, float]]] = {name: [] for name in READERS}
    for _ in range(ROUNDS):
        for name, reader in READERS.items():
            costs[name].append(cost(reader, path))
    wall, processor = (
        {name: statistics.median(one[which] for one in costs[name]) for name in READERS}
        for which in (0, 1)
    )
    table.add_row(
        path.name,
        f"{wall['opencv']:.2f}", f"{wall['heel']:.2f}", f"{wall['heel'] / wall['opencv']:.2f}",
        f"{processor['opencv']:.2f}", f"{processor['heel']:.2f}",
        f"{processor['heel'] / processor['opencv']:.2f}",
        f"{peak_mb('opencv', path):.0f}", f"{peak_mb('heel', path):.0f}", f"{difference:.3f}",
    )  # fmt: skip


@app.command()
def main(
    video: Annotated[
        list[Path] | None, typer.Argument(help="files to read", exists=True, dir_okay=False)
    ] = None,
    peak: Annotated[str | None, typer.Option(hidden=True)] = None,
) -> None:
    """Print time and memory of reading recordings, beside OpenCV's reader."""
    if peak is not None:
        for path in video or []:
            for _ in READERS[peak](path):
                pass
        typer.echo(memory_mb()[1])
        return
    table = Table("video")
    for what in ("wall ms", "CPU ms"):
        for column in (f"OpenCV {what}", f"Heel {what}", "ratio"):
            table.add_column(column, justify="right")
    for column in ("OpenCV peak MB", "Heel peak MB", "largest mean difference"):
        table.add_column(column, justify="right")
    with tempfile.TemporaryDirectory() as folder:
        videos = video or [
            draw(Path(folder) / f"scene-{width}x{height}.mp4", width, height)
            for width, height in SIZES
        ]
        for path in videos:
            compare(path, table)
    Console(width=160).print(table)


if __name__ == "__main__":
    run_app(app)
