"""Which features tell people apart after they met: the paper's seven and others, on real splits.

A split: two people of the ground truth overlap, and within 2 s before and after each of them is
seen by oneself. Each feature names who is who by the cheaper of the two assignments of its L1
distances (the paper's S1 and S2). N-way: everybody seen by oneself in a frame is to be found again
2 s later (Kuhn-Munkres). Boxes are the ground truth's, or our own tracks' on the same people; what
counts of a box is its foreground.

Example run: python -m benchmarks.features --write docs/records/identity.md
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import Recordings, Write, publish, recordings
from benchmarks.people_features import FEATURES, Vectors, vectors_of
from heel.evaluation.motchallenge import ground_truth_file, read_ground_truth
from heel.services.capture.sources import open_source
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.assignment import cheapest
from heel.services.geometry.boxes import iou_matrix
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime.command_line import run_app
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SPAN_S = 2.0
LOOKS = 4
_MET_IOU, _ALONE_IOU, _SAME_IOU = 0.15, 0.02, 0.5

Boxes = NDArray[np.float64]
Ids = NDArray[np.int64]
Seen = dict[int, dict[int, Vectors]]
"""Frame, person: features of the person seen by oneself."""
Meetings = dict[tuple[int, int], list[int]]
"""Two people, ascending: frames in which they overlap."""
Counts = dict[str, list[int]]
"""Feature: right, asked."""


def observe(recording: str) -> tuple[dict[str, Seen], Meetings, int]:
    """Features from the two kinds of boxes, who met whom, and the frames of `SPAN_S`."""
    truth = read_ground_truth(ground_truth_file(Path(recording)))
    truth = truth.select(truth.values != 0)
    seen: dict[str, Seen] = {"truth": defaultdict(dict), "tracks": defaultdict(dict)}
    meetings: Meetings = defaultdict(list)
    pipeline = InProcessPipeline(DetectorSettings(), TrackerSettings())
    with RecordedFrames(recording) as frames:
        for frame, image, source_size in frames:
            number = frame.index + 1
            blobs, tracks = pipeline.step(frame, image, source_size)
            assert blobs.evidence is not None
            evidence = blobs.evidence.array()
            rows, columns = evidence.shape
            small = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
            people = truth.select(truth.frames == number)
            boxes = people.boxes_xyxy * (columns / source_size[0])
            own = np.array([track.box_xyxy for track in tracks.tracks if track.shown])
            own = own.reshape(-1, 4) * (columns / blobs.width)
            _note_meetings(meetings, number, people.identities, iou_matrix(boxes, boxes))
            for person, found in _alone(people.identities, boxes, own):
                for kind, box in found.items():
                    vectors = vectors_of(np.asarray(small, np.uint8), evidence, box)
                    if vectors is not None:
                        seen[kind][number][person] = vectors
    return seen, meetings, round(SPAN_S * _fps(recording))


def _note_meetings(meetings: Meetings, frame: int, people: Ids, common: Boxes) -> None:
    for i, j in combinations(range(len(people)), 2):
        if common[i, j] > _MET_IOU:
            first, second = sorted((int(people[i]), int(people[j])))
            meetings[first, second].append(frame)


def _alone(people: Ids, boxes: Boxes, own: Boxes) -> Iterator[tuple[int, dict[str, Boxes]]]:
    """Everybody whom nobody else overlaps: the true box, and ours if there is one on it."""
    common, on = iou_matrix(boxes, boxes), iou_matrix(boxes, own)
    for i, person in enumerate(people):
        if np.delete(common[i], i).max(initial=0.0) > _ALONE_IOU:
            continue
        found = {"truth": boxes[i]}
        if len(own) and on[i].max() > _SAME_IOU:
            found["tracks"] = own[int(on[i].argmax())]
        yield int(person), found


def _fps(recording: str) -> float:
    source = open_source(recording)
    try:
        return float(source.fps)
    finally:
        source.close()


def split_scores(seen: Seen, meetings: Meetings, span: int) -> Counts:
    """How often each feature names the right of two people after they met."""
    counts: Counts = {name: [0, 0] for name in FEATURES}
    for pair, frames in meetings.items():
        ends = [
            i
            for i in range(len(frames))
            if i + 1 == len(frames) or frames[i + 1] - frames[i] > span
        ]
        starts = [0, *[end + 1 for end in ends[:-1]]]
        for start, end in zip(starts, ends, strict=True):
            before = [
                _looks(seen, person, range(frames[start] - 1, frames[start] - span, -1))
                for person in pair
            ]
            after = [
                _looks(seen, person, range(frames[end] + 1, frames[end] + span)) for person in pair
            ]
            if all(before) and all(after):
                for name, count in counts.items():
                    costs = _costs(name, before, after)
                    count[0] += bool(np.trace(costs) < np.trace(costs[::-1]))
                    count[1] += 1
    return counts


def _looks(seen: Seen, person: int, frames: Sequence[int]) -> list[Vectors]:
    found = [seen[frame][person] for frame in frames if frame in seen and person in seen[frame]]
    return found[:LOOKS]


def _costs(
    name: str, before: Sequence[list[Vectors]], after: Sequence[list[Vectors]]
) -> NDArray[np.float64]:
    """Sum over families of mean L1 distances, each divided by its mean over the matrix."""
    total = np.zeros((len(before), len(after)))
    for family in FEATURES[name]:
        first = [np.mean([look[family] for look in looks], axis=0) for looks in before]
        second = [np.mean([look[family] for look in looks], axis=0) for looks in after]
        costs = np.array([[np.abs(a - b).sum() for b in second] for a in first])
        total += costs / max(float(costs.mean()), 1e-12)
    return total


def group_scores(seen: Seen, span: int) -> Counts:
    """How often each feature finds each of everybody again `SPAN_S` later."""
    counts: Counts = {name: [0, 0] for name in FEATURES}
    for frame in sorted(seen)[:: max(1, span // 2)]:
        both = sorted(seen[frame].keys() & seen.get(frame + span, {}).keys())
        if len(both) < 2:
            continue
        first = [[seen[frame][person]] for person in both]
        second = [[seen[frame + span][person]] for person in both]
        for name, count in counts.items():
            columns = cheapest(_costs(name, first, second)).columns
            count[0] += int((columns == np.arange(len(both))).sum())
            count[1] += len(both)
    return counts


def table(scores: dict[str, Counts]) -> str:
    """Markdown: percent right by feature and kind of question."""
    first = next(iter(scores.values()))
    head = ["features"]
    for kind, counts in scores.items():
        head.append(f"{kind} (of {next(iter(counts.values()))[1]})")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    order = sorted(
        first, key=lambda name: -sum(c[name][0] / max(c[name][1], 1) for c in scores.values())
    )
    for name in order:
        cells = [f"{100.0 * c[name][0] / max(c[name][1], 1):.1f}" for c in scores.values()]
        lines.append("| " + " | ".join((name, *cells)) + " |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
) -> None:
    """Print how often each feature names the right person."""
    scores: dict[str, Counts] = {}
    for source in recordings(recording):
        seen, meetings, span = observe(source)
        for kind, looks in seen.items():
            for question, counts in (
                (f"splits, % by {kind}", split_scores(looks, meetings, span)),
                (f"N-way, % by {kind}", group_scores(looks, span)),
            ):
                total = scores.setdefault(question, {name: [0, 0] for name in FEATURES})
                for name, (right, asked) in counts.items():
                    total[name][0] += right
                    total[name][1] += asked
    text = table(scores)
    publish(text, write, "features")


if __name__ == "__main__":
    run_app(app)
