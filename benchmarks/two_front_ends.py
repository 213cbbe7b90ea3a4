"""A background beside a network: what its evidence of people does for the network's boxes.

Both front ends watch a recording: the network's detector with the feedback of its tracker, and a
standing background that is kept off the same people, with a tracker of its own behind it. The
network's messages are then changed by one rule at a time, with what the evidence shows in that
frame, and replayed to fresh trackers; what the detector would have seen by the feedback of those is
left out. Nothing is changed in a frame whose background is still being learned.

A person of the evidence is steady who has been seen in ten frames, with at least half in view, and
whose silhouette explains most of what is there. A box stands on two people of the evidence if both
lie in it, side by side, are nearer to it than to any other box, and together fit it better than
either does.

Example run: python -m benchmarks.two_front_ends --model yolox_nano.onnx --model \
person_yolox_192.onnx --write docs/records/results.md
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import NAMED_NETWORKS, Recordings, Write, name_of, publish, recordings
from benchmarks.mechanisms import replayed
from heel.evaluation.sequence_scores import SequenceScores
from heel.schemas import Blob, Blobs, FrameId, Tracks
from heel.schemas.base import BoxXyxy
from heel.schemas.blobs import FOREGROUND, MAX_BLOBS
from heel.services.detector.background.foreground import StandingForeground
from heel.services.detector.messages import person_blobs
from heel.services.detector.scene import WorkSize
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.boxes import cover_matrix, iou, iou_matrix, width
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime.command_line import run_app
from heel.services.tracker.evidence.front_end import EvidenceFrame, EvidenceFrontEnd
from heel.services.tracker.evidence.silhouette import Silhouette
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import reporting_tuning
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_STEADY_HITS = 10
"""Frames in which a steady person has been seen; chosen by hand."""
_STEADY_GAIN = 0.45
"""Gain of a steady person's silhouette: that from which heights are measured."""
_STEADY_VIEW = 0.5
"""Share of a steady person that no other covers: that from which one counts as seen alone."""
_INSIDE = 0.7
"""Share of a person that lies in a box which may stand on two; chosen by hand."""
_FITS = 0.7
"""IoU from which two people together fit a box; chosen by hand."""
_BETTER = 0.08
"""IoU by which they have to fit it better than either alone; chosen by hand."""
_BESIDE = 0.5
"""Distance of their centres across the picture, mean widths; chosen by hand."""
_SEEN_IOU = 0.3
"""IoU from which a box of the network is on a person of the evidence; chosen by hand."""
_ADDED_SCORE = 0.5
"""Score of a box that the evidence adds: a doubtful person's; chosen by hand."""
_LEAST_FOREGROUND = 0.1
"""Share of foreground in a box below which nobody is there by the evidence; chosen by hand."""


@dataclass(frozen=True)
class Fitted:
    """A person of the evidence: as a blob of kind people, and whether steady."""

    blob: Blob
    steady: bool


@dataclass(frozen=True)
class Watched:
    """One frame.

    Attributes:
        sent: the network's message.
        people: those that the evidence shows; none while the background is learned.
        foreground: share of foreground in each box of the message; 1 while it is learned.
    """

    sent: Blobs
    people: tuple[Fitted, ...]
    foreground: tuple[float, ...]


@dataclass(frozen=True)
class Film:
    """All frames of a recording, and processor milliseconds a frame that the evidence takes."""

    frames: list[Watched]
    background_ms: float
    tracker_ms: float


def shared_boxes(sent: Blobs, people: Sequence[Blob]) -> dict[int, tuple[Blob, Blob]]:
    """Boxes of a message that stand on two of these people, by place in it, and which two."""
    if len(people) < 2 or not sent.blobs:
        return {}
    boxes = np.array([blob.box_xyxy for blob in sent.blobs])
    theirs = np.array([blob.box_xyxy for blob in people])
    overlap, inside = iou_matrix(boxes, theirs), cover_matrix(theirs, boxes)
    nearest = overlap.argmax(axis=0)
    found = {}
    for k, blob in enumerate(sent.blobs):
        own = [j for j in np.argsort(-overlap[k], kind="stable")
               if nearest[j] == k and inside[j, k] > _INSIDE]  # fmt: skip
        if len(own) >= 2:
            first, second = people[own[0]], people[own[1]]
            if _fit(blob.box_xyxy, first.box_xyxy, second.box_xyxy):
                found[k] = (first, second)
    return found


def _fit(box: BoxXyxy, first: BoxXyxy, second: BoxXyxy) -> bool:
    """Whether two people side by side fit a box, and better than either of them."""
    both = (
        min(first[0], second[0]), min(first[1], second[1]),
        max(first[2], second[2]), max(first[3], second[3]),
    )  # fmt: skip
    apart = abs(first[0] + first[2] - second[0] - second[2])
    beside = apart > _BESIDE * (width(first) + width(second))
    better = iou(box, both) > max(iou(box, first), iou(box, second)) + _BETTER
    return beside and better and iou(box, both) > _FITS


def _changed(sent: Blobs, blobs: Sequence[Blob]) -> Blobs:
    return sent.model_copy(update={"blobs": tuple(blobs[:MAX_BLOBS])})


def split(frame: Watched, steady: bool) -> Blobs:
    """With two boxes where one stands on two people."""
    people = [each.blob for each in frame.people if each.steady or not steady]
    shared, blobs = shared_boxes(frame.sent, people), []
    for k, blob in enumerate(frame.sent.blobs):
        instead = (each.model_copy(update={"score": blob.score}) for each in shared.get(k, ()))
        blobs += list(instead) or [blob]
    return _changed(frame.sent, blobs)


def left_out(frame: Watched) -> Blobs:
    """Without the boxes that stand on two people: whose they are cannot be told."""
    shared = shared_boxes(frame.sent, [each.blob for each in frame.people if each.steady])
    return _changed(frame.sent, [b for k, b in enumerate(frame.sent.blobs) if k not in shared])


def completed(frame: Watched) -> Blobs:
    """With boxes of steady people whom the network misses."""
    boxes = np.array([blob.box_xyxy for blob in frame.sent.blobs]).reshape(-1, 4)
    missed = [
        each.blob
        for each in frame.people
        if each.steady
        and iou_matrix(np.array([each.blob.box_xyxy]), boxes).max(initial=0.0) < _SEEN_IOU
    ]
    return _changed(frame.sent, [*frame.sent.blobs, *missed])


def confirmed(frame: Watched) -> Blobs:
    """Without the boxes in which there is next to no foreground."""
    return _changed(
        frame.sent,
        [
            blob
            for blob, share in zip(frame.sent.blobs, frame.foreground, strict=True)
            if share >= _LEAST_FOREGROUND
        ],
    )


RULES: dict[str, Callable[[Watched], Blobs]] = {
    "as sent": lambda frame: frame.sent,
    "split, steady people": lambda frame: split(frame, steady=True),
    "split, any people": lambda frame: split(frame, steady=False),
    "shared ones left out": left_out,
    "missed people added": completed,
    "without foreground left out": confirmed,
}
"""What becomes of the boxes, by name."""


class _Evidence(EvidenceFrontEnd):
    """The front end of evidence, that shows its silhouettes."""

    def silhouettes(self) -> dict[int, Silhouette]:
        return {track.track_id: each for track, each in self._of.items() if track.track_id}


class Beside:
    """Background and tracker of evidence beside a network's detector; for one recording."""

    def __init__(self, size: WorkSize) -> None:
        self._size = size
        self._background = StandingForeground(size, DetectorSettings())
        reporting = TrackerSettings().reporting("foreground")
        self._front = _Evidence(reporting, identify=False)
        self._tracker = PeopleTracker(
            self._front, reporting_tuning(reporting, False), (size.frame_width, size.frame_height)
        )
        self.background_s = self.tracker_s = 0.0

    def watch(
        self, frame: FrameId, image: NDArray[np.uint8], sent: Blobs, feedback: Tracks | None
    ) -> Watched:
        """What the evidence shows in a frame of which the network's message is known.

        Args:
            frame: which one. image: (H, W, 3) uint8 BGR. sent: of the network.
            feedback: tracks of the network's people, of some frames before.
        """
        started_s = time.process_time()
        seen = self._background.look(self._size.shrink(image), frame, feedback)
        assert seen.evidence is not None
        seen_s = time.process_time()
        state = "learning" if seen.learning else "valid"
        blobs = sent.model_copy(update={"background": state, "camera_motion": None})
        reports = self._tracker.update(
            EvidenceFrame(blobs, seen.evidence), frame.t_capture_ns * 1e-9
        )
        self._tracker.settle()
        self.background_s += seen_s - started_s
        self.tracker_s += time.process_time() - seen_s
        if seen.learning:
            return Watched(sent, (), (1.0,) * len(sent.blobs))
        silhouettes = self._front.silhouettes()
        shown = [each for each in reports if each.shown and each.missed_frames == 0]
        people = person_blobs([(each.box_xyxy, _ADDED_SCORE) for each in shown], image)
        fitted = tuple(
            Fitted(blob, _is_steady(silhouettes[each.id]))
            for blob, each in zip(people, shown, strict=True)
        )
        shares = tuple(self._share(blob.box_xyxy, seen.evidence) for blob in sent.blobs)
        return Watched(sent, fitted, shares)

    def _share(self, box: BoxXyxy, evidence: NDArray[np.uint8]) -> float:
        left, right = (max(0, round(x / self._size.scale_x)) for x in box[::2])
        top, bottom = (max(0, round(y / self._size.scale_y)) for y in box[1::2])
        part = evidence[top:bottom, left:right]
        return float(np.count_nonzero(part >= FOREGROUND)) / max(part.size, 1)


def _is_steady(silhouette: Silhouette) -> bool:
    return (
        silhouette.hits >= _STEADY_HITS
        and silhouette.gain >= _STEADY_GAIN
        and silhouette.in_view >= _STEADY_VIEW
    )


def watched(recording: str, model: Path) -> Film:
    """Both front ends on every frame of a recording."""
    settings = DetectorSettings(model=model)
    pipeline = InProcessPipeline(settings, TrackerSettings())
    beside: Beside | None = None
    told: dict[int, Tracks] = {}
    film = []
    with RecordedFrames(recording) as frames:
        for frame, image, source_size in frames:
            sent, tracks = pipeline.step(frame, image, source_size)
            if beside is None:
                size = WorkSize.of_frame(sent.width, sent.height, settings.work_width_px)
                beside = Beside(size)
            told[frame.seq] = tracks
            feedback = told.pop(frame.seq - settings.feedback_lag_frames, None)
            film.append(beside.watch(frame, image, sent, feedback))
    assert beside is not None
    to_ms = 1e3 / len(film)
    return Film(film, to_ms * beside.background_s, to_ms * beside.tracker_s)


def rows(network: str, scored: dict[str, list[tuple[SequenceScores, int]]]) -> list[str]:
    """Markdown rows of one network: means, frames changed, and keep and wrong of each recording."""
    lines = []
    for rule, results in scored.items():
        each = [scores for scores, _ in results]
        means = [
            f"{np.mean([getattr(scores, column) for scores in each]):.1f}"
            for column in ("mota", "idf1", "keep", "wrong")
        ]
        changed = str(sum(count for _, count in results))
        cells = [f"{scores.keep:.1f}, {scores.wrong:.1f}" for scores in each]
        lines.append("| " + " | ".join((network, rule, changed, *means, *cells)) + " |")
    return lines


@app.command()
def main(
    model: Annotated[list[Path], typer.Option(help="network; repeatable")],
    write: Write = None,
    recording: Recordings = None,
) -> None:
    """Score the boxes of a network as sent, and changed by the evidence of a background."""
    os.environ.update(NAMED_NETWORKS)
    cv2.setNumThreads(1)
    sources = recordings(recording)
    names = [name_of(source) for source in sources]
    head = ("network", "boxes", "frames changed", "MOTA", "IDF1", "keep%", "wrong%",
            *(f"{name} keep, wrong" for name in names))  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    costs = ["| recording | background, ms | its tracker, ms |", "|---|---|---|"]
    for file in model:
        scored: dict[str, list[tuple[SequenceScores, int]]] = {rule: [] for rule in RULES}
        for source, name in zip(sources, names, strict=True):
            film = watched(source, file)
            if file == model[0]:
                costs.append(f"| {name} | {film.background_ms:.1f} | {film.tracker_ms:.1f} |")
            for rule, change in RULES.items():
                messages = [change(frame) for frame in film.frames]
                changed = sum(
                    after.blobs != before.sent.blobs
                    for after, before in zip(messages, film.frames, strict=True)
                )
                scored[rule].append((replayed(source, messages), changed))
            typer.echo(f"{file.stem}, {name}: done", err=True)
        lines += rows(file.stem, scored)
    publish("\n".join([*lines, "", *costs]) + "\n", write, "two-front-ends")


if __name__ == "__main__":
    run_app(app)
