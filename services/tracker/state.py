"""Which classes hold what a tracker's next frame depends on, so that another one can go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from heel.services.geometry.calibration_file import Calibration
from heel.services.runtime.state_bytes import StateClasses, StateError
from heel.services.tracker.boxes.front_end import BoxFrontEnd
from heel.services.tracker.boxes.score_scale import RunningMedian, ScoreScale
from heel.services.tracker.evidence.canvas import Canvas
from heel.services.tracker.evidence.front_end import EvidenceFrontEnd
from heel.services.tracker.evidence.line import Line
from heel.services.tracker.evidence.runs import Runs
from heel.services.tracker.evidence.scale import Refit, SceneScale
from heel.services.tracker.evidence.silhouette import Silhouette, Working
from heel.services.tracker.people.camera_motion import CameraMotion
from heel.services.tracker.people.carry import Carrier
from heel.services.tracker.people.contacts import Contact, Contacts
from heel.services.tracker.people.identity import Identity
from heel.services.tracker.people.looks import Gallery, LookModel, LookStatistics
from heel.services.tracker.people.recall import Recall
from heel.services.tracker.people.track import Track
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import Tuning
from heel.services.tracker.people.verification import Verification, Verifications
from heel.services.tracker.pointed.front_end import PointedFrontEnd
from heel.services.tracker.settings import Reporting
from heel.services.tracker.timing import FrameClock
from heel.services.tracker.trace import Changes, Known, Trace

MAX_BYTES = 16 << 20
"""Of a state: 128 people in sight, 64 remembered, and six galleries of each, is 15 MB."""


@dataclass
class TrackerState:
    """All of it.

    Attributes:
        scene: stream, epoch, size and kind of the messages; people of another one are others.
        evidence_size: rows and columns of the evidence map, if there is one.
        first_ns: capture time of the first frame.
        clock: of the frames.
        changes: what has been told of ids.
        method: the people.
    """

    scene: tuple[object, ...] | None
    evidence_size: tuple[int, ...] | None
    first_ns: int | None
    clock: FrameClock
    changes: Changes
    method: PeopleTracker[Any]


_MOST_REDUCED_PX = 4096 * 4096
"""Of a canvas: more pixels than the largest evidence map has with its margin."""


def _canvas(rows: int, columns: int, tallest: float, step: int, ratio: float) -> Canvas:
    margin = tallest / max(step, 1)
    pixels = (rows / max(step, 1) + 2 * margin + 32) * (columns / max(step, 1) + 2 * margin + 32)
    if not (step >= 1 and tallest > 0 and 0 < pixels < _MOST_REDUCED_PX):
        raise StateError(f"state of the tracker: a canvas for people {tallest} px high")
    return Canvas((rows, columns), tallest, step, ratio)


def _made_with(canvas: Canvas) -> tuple[Any, ...]:
    return canvas.rows, canvas.columns, canvas.tallest, canvas.step, canvas.ratio


CLASSES = StateClasses(
    what="tracker",
    kept=(
        BoxFrontEnd, CameraMotion, Carrier, Changes, Contact, Contacts, EvidenceFrontEnd,
        FrameClock, Gallery, Identity, Known, Line, LookModel, LookStatistics, PeopleTracker,
        PointedFrontEnd, Recall, Refit, Runs, RunningMedian, SceneScale, ScoreScale, Silhouette,
        Track, TrackerState, Verification, Verifications, Working,
    ),
    fixed=(Trace, Tuning, Reporting, Calibration),
    rebuilt={Canvas: (_made_with, _canvas)},
    transient={
        BoxFrontEnd: {"_frame": lambda: None, "_raw_of_track": list, "_free": list},
        EvidenceFrontEnd: {"_evidence": lambda: None},
        PointedFrontEnd: {"_blob": lambda: None},
        Refit: {"reduced": dict},
    },
    examples=(
        Gallery(), Runs(1.0), SceneScale(1, 1.0),
    ),
)  # fmt: skip
"""The published method has no place: it is run as printed, and begins anew."""
