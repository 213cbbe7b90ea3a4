"""Who is back: the person named by appearance alone, some seconds later, among everybody present.

Once a second every person known by then is asked for again 2, 5, 15 and 30 s later: of the people
seen alone in that frame, whose gallery is nearest to one descriptor (rank 1), and how sure the
model is of that. Galleries and the metric know what was seen up to the question alone. Boxes are
the ground truth's, our own evidence tracks' on these people, or those of tracks with the network
yolox_nano of the data folder's models. Nothing is fitted to a recording beforehand; the fixed
numbers of the model were chosen by hand with PETS09-S2L1 in view, so that the others are the test.

Example run: python -m benchmarks.returns --write docs/records/identity.md
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import Recordings, Write, data_folder, name_of, publish, recordings
from benchmarks.learned_metric.gallery import Gallery, nearest_views
from benchmarks.learned_metric.metric import Metric
from benchmarks.learned_metric.model import AppearanceModel
from heel.evaluation.motchallenge import ground_truth_file, read_ground_truth
from heel.services.capture.sources import open_source
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.boxes import iou_matrix
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.runtime.command_line import run_app
from heel.services.tracker.people.appearance import FloatArray, cut_out, describe
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SPANS_S = (2, 5, 15, 30)
SURE = 0.9
KINDS = ("true boxes", "own evidence", "network")
_EVERY_S = 1.0
_ALONE_IOU, _SAME_IOU, _KNOWN_LOOKS = 0.25, 0.5, 3
_NETWORK = "yolox_nano.onnx"
_FOREGROUND = 2

Looks = dict[int, FloatArray]
"""Person: descriptor of one frame."""


@dataclass
class Score:
    """What was asked after one span: nearest by Hellinger and by the learned metric, and surely."""

    asked: int = 0
    plain: int = 0
    learned: int = 0
    sure: int = 0
    sure_right: int = 0


@dataclass
class Film:
    """Descriptors of the people seen alone, by kind of box, frame by frame."""

    fps: float
    frames: dict[str, list[Looks]] = field(default_factory=lambda: defaultdict(list))


def observe(recording: str) -> Film:
    """Run both trackers over a recording with ground truth."""
    truth = read_ground_truth(ground_truth_file(Path(recording)))
    truth = truth.select(truth.values != 0)
    source = open_source(recording)
    film = Film(float(source.fps))
    source.close()
    model = data_folder() / "models" / _NETWORK
    pipelines = {"own evidence": InProcessPipeline(DetectorSettings(), TrackerSettings())}
    if model.is_file():
        pipelines["network"] = InProcessPipeline(DetectorSettings(model=model), TrackerSettings())
    with RecordedFrames(recording) as frames:
        for frame, image, size in frames:
            people = truth.select(truth.frames == frame.index + 1)
            boxes = people.boxes_xyxy * (image.shape[1] / size[0])
            alone = (iou_matrix(boxes, boxes) - np.eye(len(boxes))).max(axis=1, initial=0.0)
            known = [(int(person), boxes[k]) for k, person in enumerate(people.identities)
                     if alone[k] <= _ALONE_IOU]  # fmt: skip
            film.frames["true boxes"].append(_described(image, None, dict(known)))
            for kind, pipeline in pipelines.items():
                blobs, tracks = pipeline.step(frame, image, size)
                evidence = None if blobs.evidence is None else blobs.evidence.array()
                shown = [track.box_xyxy for track in tracks.tracks if track.shown]
                own = np.array(shown).reshape(-1, 4) * (image.shape[1] / blobs.width)
                found = dict(_matched(known, own))
                film.frames[kind].append(_described(image, evidence, found))
    return film


def _matched(known: list[tuple[int, FloatArray]], own: FloatArray) -> Iterator[
    tuple[int, FloatArray]
]:  # fmt: skip
    """The box of ours on each person, where there is one."""
    for person, box in known:
        common = iou_matrix(box[None], own)[0]
        if len(own) and common.max() >= _SAME_IOU:
            yield person, own[int(common.argmax())]


def _described(
    image: NDArray[np.uint8], evidence: NDArray[np.uint8] | None, boxes: dict[int, FloatArray]
) -> Looks:
    found = np.array(list(boxes.values())).reshape(-1, 4)
    masks = None
    if evidence is not None:
        scale = np.tile(np.array(evidence.shape[::-1]) / image.shape[1::-1], 2)
        masks = cut_out((evidence >= _FOREGROUND).astype(np.uint8), found * scale)
    return dict(zip(boxes, describe(cut_out(image, found), masks), strict=True))


def scores(frames: list[Looks], fps: float) -> dict[int, Score]:
    """How often the right person is named, by span."""
    model, galleries = AppearanceModel(), defaultdict[int, Gallery](Gallery)
    found = {span: Score() for span in SPANS_S}
    due = 0.0
    for index, looks in enumerate(frames):
        t_s = index / fps
        known = [person for person in looks if galleries[person].looks]
        if known:
            seen = np.array([looks[person] for person in known])
            model.learn([galleries[person] for person in known], seen, t_s)
        model.settle(t_s)
        for person, look in looks.items():
            galleries[person].add(look)
        if t_s < due:
            continue
        due = t_s + _EVERY_S
        for span, score in found.items():
            later = index + round(span * fps)
            if later < len(frames):
                _ask(score, model, galleries, frames[later])
    return found


def _ask(score: Score, model: AppearanceModel, galleries: dict[int, Gallery], later: Looks) -> None:
    present = [who for who in later if who in galleries and galleries[who].looks >= _KNOWN_LOOKS]
    if len(present) < 2:
        return
    views = [galleries[who] for who in present]
    looks, right = np.array([later[who] for who in present]), np.arange(len(present))
    score.asked += len(present)
    score.plain += int((nearest_views(views, looks, Metric())[0].argmin(axis=0) == right).sum())
    named = nearest_views(views, looks, model.metric)[0].argmin(axis=0) == right
    score.learned += int(named.sum())
    odds = model.compare(views, looks)
    shares = np.exp(odds - odds.max(axis=0))
    shares /= shares.sum(axis=0)
    sure = shares.max(axis=0) >= SURE
    score.sure += int(sure.sum())
    score.sure_right += int((shares.argmax(axis=0) == right)[sure].sum())


def table(found: dict[str, dict[str, dict[int, Score]]]) -> str:
    """Markdown: percent right by recording, kind of box and span; Hellinger, then learned."""
    spans = " | ".join(f"after {span} s" for span in SPANS_S)
    lines = [f"| recording | boxes | {spans} | said {SURE:g} or more: right |", "|---" * 7 + "|"]
    for name, kinds in found.items():
        for kind, by_span in kinds.items():
            cells = [
                f"{100 * one.plain / one.asked:.1f} / {100 * one.learned / one.asked:.1f} "
                f"(of {one.asked})" if one.asked else "" for one in by_span.values()
            ]  # fmt: skip
            sure = sum(one.sure for one in by_span.values())
            right = sum(one.sure_right for one in by_span.values())
            cells.append(f"{100 * right / sure:.1f} (of {sure})" if sure else "")
            lines.append("| " + " | ".join((name, kind, *cells)) + " |")
    return "\n".join(lines) + "\n"


@app.command()
def main(write: Write = None, recording: Recordings = None) -> None:
    """Print how often appearance alone names the right person."""
    found: dict[str, dict[str, dict[int, Score]]] = {}
    for source in recordings(recording):
        film = observe(source)
        found[name_of(source)] = {
            kind: scores(film.frames[kind], film.fps) for kind in KINDS if kind in film.frames
        }
    publish(table(found), write, "returns")


if __name__ == "__main__":
    run_app(app)
