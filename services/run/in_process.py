"""The same run in one process, as the reference for the separate processes."""

from __future__ import annotations

import itertools
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import cv2

from heel.schemas import HeelError
from heel.services.pipeline import RecordedFrames, load_pipeline
from heel.services.run.options import RunOptions
from heel.services.run.outputs import RunOutputs
from heel.services.run.progress import RunProgress
from heel.services.run.summary import Camera, RunSummary
from heel.services.runtime import process
from heel.services.tracker.trace import Trace
from heel.services.tracker.trace_file import TraceFile


def run_in_process(options: RunOptions, stop: threading.Event) -> RunSummary:
    """Run the cores over a recording, one frame after the other.

    Raises:
        HeelError: the source cannot be read, or is a camera.
    """
    cv2.setNumThreads(1)
    process.keep_freed_memory()
    summary = RunSummary(mode="in-process")
    with ExitStack() as stack:
        frames = stack.enter_context(RecordedFrames(options.source, options.scale, options.fps))
        if frames.source.is_live:
            raise HeelError(f"{frames.source.name}: --in-process takes recordings, not cameras")
        outputs = stack.enter_context(RunOutputs(options.out, summary, options.annotate))
        trace = Trace()
        pipeline, settings = load_pipeline(
            options.preset,
            options.target,
            options.config,
            options.detector,
            options.model,
            options.model_class,
            options.model_head,
            options.trace,
            trace,
        )
        pipeline.was_recorded_by(frames.source.camera)
        if (traced := settings["tracker"]["trace"]) is not None:
            trace.add(stack.enter_context(TraceFile(Path(traced))).take)
        summary.in_force(settings)
        progress = stack.enter_context(RunProgress(options.progress))
        process.spare_from_collection()
        started_s = time.monotonic()
        for frame, image, source_size in itertools.islice(frames, options.frames):
            if stop.is_set():
                break
            summary.camera = Camera(frames.source.name, frames.source.fps, *source_size)
            result = pipeline.step(frame, image, source_size, frames.depth_mm)
            summary.captured = summary.detected = summary.tracked = frame.seq + 1
            summary.commands += 1
            outputs.tracks(result.tracks)
            outputs.command(result.command)
            outputs.state(result.state)
            if outputs.film is not None:
                outputs.film.write(image, result.tracks, result.target_id,
                                   f"frame {frame.index + 1}", frames.source.fps)  # fmt: skip
            progress.update(summary.tracked, frames.source.frame_count)
        summary.wall_s = time.monotonic() - started_s
        summary.ended = frames.source.end_reason or "stopped before the end of the stream"
        summary.cpu_s["run"] = process.cpu_s()
        summary.peak_rss_mb["run"] = process.memory_mb()[1]
    return summary
