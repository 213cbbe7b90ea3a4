"""Four public trackers on given boxes, to be measured beside Heel's in the same run.

They are those of the package `trackers` (Roboflow), which is no dependency of Heel's: `make peers`
installs it into an environment of its own. Every tracker has its defaults and is told the frame
rate of the sequence; BoT-SORT goes without camera motion compensation, which needs pictures.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.services.tracker.boxes.sequence import GivenSequence

if TYPE_CHECKING:
    from supervision import Detections

Tracker = Callable[[GivenSequence], tuple[BoxRows, float]]
"""Tracks a sequence online: the boxes it shows, and CPU seconds."""


def peers() -> dict[str, Tracker]:
    """The public trackers by name; none where the package `trackers` is not installed."""
    if find_spec("trackers") is None:
        return {}
    from trackers import BoTSORTTracker, ByteTrackTracker, OCSORTTracker, SORTTracker

    return {
        "SORT": partial(_track, SORTTracker),
        "ByteTrack": partial(_track, ByteTrackTracker),
        "OC-SORT": partial(_track, OCSORTTracker),
        "BoT-SORT": partial(_track, partial(BoTSORTTracker, enable_cmc=False)),
    }


def peers_note() -> str:
    """One line below the table: where the public trackers are from, or how to get them."""
    if not peers():
        return "Heel only: `make peers` installs four public trackers and measures them, too.\n"
    packages = " and ".join(f"`{name}` {version(name)}" for name in ("trackers", "supervision"))
    return f"The others are those of {packages}, measured in the same run.\n"


def frame_count(given: GivenSequence) -> int:
    """Frames that a tracker goes through: up to the sequence's end or the last box."""
    return max(given.frame_count, int(given.frames.max(initial=0)))


def _track(build: Callable[..., Any], given: GivenSequence) -> tuple[BoxRows, float]:
    tracker = build(frame_rate=given.fps)
    count = frame_count(given)
    # Outside the measured time: these trackers want their boxes in a class of their own.
    wanted = [_detections(given, frame) for frame in range(1, count + 1)]
    started_s = time.process_time()
    tracked = [tracker.update(detections) for detections in wanted]
    cpu_s = time.process_time() - started_s
    return _shown(tracked), cpu_s


def _detections(given: GivenSequence, frame: int) -> Detections:
    from supervision import Detections

    rows = given.frames == frame
    return Detections(
        xyxy=given.boxes[rows].astype(np.float32),
        confidence=given.scores[rows].astype(np.float32),
        class_id=np.zeros(int(rows.sum()), int),
    )


def _shown(tracked: list[Detections]) -> BoxRows:
    """What has an id; -1 marks boxes of tracks that are not shown yet."""
    found = [
        (frame, int(identity), box)
        for frame, boxes in enumerate(tracked, start=1)
        if boxes.tracker_id is not None
        for identity, box in zip(boxes.tracker_id, boxes.xyxy, strict=True)
        if identity >= 0
    ]
    frames, identities, boxes_xyxy = zip(*found, strict=True) if found else ((), (), ())
    return rows_from_xyxy(frames, identities, np.array(boxes_xyxy))
