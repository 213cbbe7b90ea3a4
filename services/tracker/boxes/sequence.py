"""A sequence of given boxes through the tracker, frame by frame, in time order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.boxes.frame import FrameBoxes, checked
from heel.services.tracker.boxes.front_end import BoxFrontEnd
from heel.services.tracker.people.appearance import cut_out, describe
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import FILE, Tuning
from heel.services.tracker.report import Report
from heel.services.tracker.trace import Changes, Event, Trace

Picture = Callable[[int], NDArray[np.uint8]]
"""Gives the (H, W, 3) uint8 BGR picture of a frame, by its number from 1."""


@dataclass(frozen=True)
class GivenSequence:
    """A detector's boxes of one sequence.

    Attributes:
        frames: (N,) frame numbers from 1, in any order.
        boxes: (N, 4) float64 xyxy pixels.
        scores: (N,) float64, any scale; more is surer.
        fps: frames per second, > 0.
        frame_count: least number of frames; the last box may be in a later one.
        image_size: (width, height) in pixels, where known.
    """

    frames: NDArray[np.int64]
    boxes: FloatArray
    scores: FloatArray
    fps: float
    frame_count: int = 0
    image_size: tuple[int, int] | None = None


def box_tracker(
    tuning: Tuning = FILE, image_size: tuple[int, int] | None = None, trace: Trace | None = None
) -> PeopleTracker[FrameBoxes]:
    """A tracker of people by boxes alone; arguments as of `PeopleTracker`."""
    return PeopleTracker(BoxFrontEnd(tuning, image_size), tuning, image_size, trace=trace)


def track_sequence(
    given: GivenSequence,
    tuning: Tuning = FILE,
    picture: Picture | None = None,
    trace: Trace | None = None,
) -> Iterator[tuple[int, list[Report]]]:
    """Yield each frame's number and its shown tracks.

    Args:
        given: boxes, scores and clock.
        tuning: thresholds of the tracker.
        picture: source of pictures; without it appearance is not used.
        trace: takes what is decided; the tracks are the same without.

    Raises:
        HeelError: a box or score is not finite, or a box has no area.
    """
    trace = trace or Trace()
    tracker, changes = box_tracker(tuning, given.image_size, trace), Changes(trace)
    order = np.argsort(given.frames, kind="stable")
    last = max(given.frame_count, int(given.frames.max(initial=0)))
    limits = np.searchsorted(given.frames[order], np.arange(1, last + 2))
    for frame in range(1, last + 1):
        trace.begin(frame, (frame - 1) / given.fps)
        if frame == 1:
            trace.note(Event("input", input="people", method="boxes"))
        rows = order[limits[frame - 1] : limits[frame]]
        boxes = given.boxes[rows]
        looks = None if picture is None else describe(cut_out(picture(frame), boxes))
        seen = checked(boxes, given.scores[rows], looks)
        tracks = tracker.update(seen, (frame - 1) / given.fps)
        changes.observe(tracks)
        yield frame, [track for track in tracks if track.shown]
