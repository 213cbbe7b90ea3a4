"""Scores of whole sequences: from files or arrays to one object, a table and JSON.

    scores = evaluate(Path("PETS09-S2L1"), Path("out/tracks.txt"))
    print(scores.mota, scores.keep)

Evaluated are frames 1 to the largest of ``seqLength`` (where a ``seqinfo.ini`` lies beside the
ground truth), the last ground-truth frame and the last track frame. Frames without ground truth
count too: an output there is a false positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field
from rich.box import SIMPLE_HEAD
from rich.table import Table

from heel.evaluation.alignment import AlignedSequence, FlagRule, align
from heel.evaluation.dice import mean_dice
from heel.evaluation.motchallenge import (
    ground_truth_file,
    read_ground_truth,
    read_sequence_info,
    read_tracks,
)
from heel.evaluation.plausible import check_size, warn_of_another_size
from heel.evaluation.retention import APART_IOU, retention
from heel.evaluation.tracking_scores import tracking_scores
from heel.schemas.errors import HeelError
from heel.services.sequence_file import sequence_file


class SequenceScores(BaseModel):
    """Every score of one sequence: percent, except the counts."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    sequence: str = Field(description="name of the sequence")
    mota: float = Field(le=100, description="100 (1 - (fn + fp + idsw) / boxes), percent")
    motp: float = Field(ge=0, le=100, description="mean IoU of matched boxes, percent; 0 if none")
    idf1: float = Field(ge=0, le=100, description="F1 of the best fixed pairing of ids, percent")
    hota: float = Field(ge=0, le=100, description="HOTA, mean of IoU 0.05 to 0.95, percent")
    idsw: int = Field(ge=0, description="identity switches, count")
    fp: int = Field(ge=0, description="output boxes on nobody, count")
    fn: int = Field(ge=0, description="true boxes without an output box, count")
    boxes: int = Field(ge=1, description="true boxes, count")
    keep: float = Field(
        ge=0,
        le=100,
        description="share of a person's remaining frames in which the id chosen at first sight "
        "is on that person, percent",
    )
    wrong: float = Field(
        ge=0, le=100, description="share in which that id is on another person, percent"
    )
    dice: float = Field(
        ge=0, le=100, description="the paper's accuracy (equation 7), mean over frames, percent"
    )
    wrong_apart: float = Field(
        ge=0,
        le=100,
        description="`wrong` where everybody is chosen once the box is on nobody else, percent",
    )


def evaluate(
    gt_path: Path, tracks_path: Path, *, iou_threshold: float = 0.5, flags: FlagRule = "mot15"
) -> SequenceScores:
    """Scores a ``tracks.txt`` against the ground truth of one sequence.

    Args:
        gt_path: a sequence directory holding ``gt/gt.txt``, or the ``gt.txt`` itself.
        tracks_path: MOTChallenge rows; a directory means the ``tracks.txt`` in it.
        iou_threshold: from this IoU on a pair matches (all scores but HOTA and Dice).
        flags: what ground-truth rows with flag 0 mean (see ``alignment.FlagRule``).

    Raises:
        HeelError: a file is missing or malformed, or an option is not valid.
    """
    sequence = load_sequence(gt_path, tracks_path, iou_threshold=iou_threshold, flags=flags)
    return score_sequence(sequence, iou_threshold=iou_threshold)


def load_sequence(
    gt_path: Path, tracks_path: Path, *, iou_threshold: float = 0.5, flags: FlagRule = "mot15"
) -> AlignedSequence:
    """Reads what ``evaluate`` scores, for plots beside the scores; arguments as there."""
    file = ground_truth_file(gt_path)
    folder = file.absolute().parent
    folder = folder.parent if folder.name == "gt" else folder
    name, frame_count = (folder.name if file.name == "gt.txt" else file.stem), 0
    tracks_file = tracks_path / "tracks.txt" if tracks_path.is_dir() else tracks_path
    truth, tracks = read_ground_truth(file), read_tracks(tracks_file)
    if sequence_file(folder) is not None:
        info = read_sequence_info(folder)
        name, frame_count = info.name, info.frame_count
        if info.width_px and info.height_px:
            check_size(truth, (info.width_px, info.height_px), str(file))
            check_size(tracks, (info.width_px, info.height_px), str(tracks_file))
    warn_of_another_size(truth, tracks, str(tracks_file))
    return align(
        truth,
        tracks,
        name=name,
        frame_count=frame_count,
        iou_threshold=iou_threshold,
        flags=flags,
    )


def find_frame_rate(gt_path: Path) -> float:
    """Frames per second of the sequence of a ground truth, by its ``seqinfo.ini``.

    Raises:
        HeelError: there is none, or it does not say.
    """
    folder = ground_truth_file(gt_path).absolute().parent
    folder = folder.parent if folder.name == "gt" else folder
    info = None if sequence_file(folder) is None else read_sequence_info(folder)
    if info is None or info.frame_rate_fps is None:
        raise HeelError(f"{gt_path}: no seqinfo.ini with a frameRate beside it; give --fps")
    return info.frame_rate_fps


def score_sequence(sequence: AlignedSequence, *, iou_threshold: float = 0.5) -> SequenceScores:
    """Every score of an aligned sequence.

    Raises:
        HeelError: the threshold is not valid.
    """
    tracking = tracking_scores(sequence, iou_threshold)
    held = retention(sequence, iou_threshold)
    return SequenceScores(
        sequence=sequence.name,
        mota=tracking.mota,
        motp=tracking.motp,
        idf1=tracking.idf1,
        hota=tracking.hota,
        idsw=tracking.idsw,
        fp=tracking.fp,
        fn=tracking.fn,
        boxes=tracking.boxes,
        keep=held.keep_percent,
        wrong=held.wrong_percent,
        wrong_apart=retention(sequence, iou_threshold, APART_IOU).wrong_percent,
        dice=mean_dice(sequence),
    )


def find_pairs(gt_path: Path, tracks_path: Path) -> list[tuple[Path, Path]]:
    """The (ground truth, tracks) pairs that two paths stand for, in order of sequence name.

    One sequence and one file are one pair. A directory of sequence directories and a directory of
    results are one pair per sequence that has a ``<sequence>.txt`` or ``<sequence>/tracks.txt``.

    Raises:
        HeelError: there is no pair.
    """
    if not gt_path.is_dir() or (gt_path / "gt" / "gt.txt").is_file():
        return [(gt_path, tracks_path)]
    pairs = []
    for file in sorted(gt_path.glob("*/gt/gt.txt")):
        folder = file.parent.parent
        candidates = (tracks_path / f"{folder.name}.txt", tracks_path / folder.name / "tracks.txt")
        pairs += [(folder, tracks) for tracks in candidates if tracks.is_file()][:1]
    if not pairs:
        raise HeelError(
            f"{gt_path} and {tracks_path}: nothing to score; give a sequence directory (with "
            "gt/gt.txt) and a tracks.txt, or a directory of sequences and a directory of "
            "<sequence>.txt"
        )
    return pairs


def scores_table(scores: Sequence[SequenceScores], *, caption: str | None = None) -> Table:
    """A table for the terminal, one row per sequence, identity numbers first."""
    # Without lines between columns it fits 80 characters, as terminals and logs have.
    table = Table(
        box=SIMPLE_HEAD, padding=0, pad_edge=False, caption=caption, caption_justify="left"
    )
    table.add_column("sequence", no_wrap=True)
    for title in ("keep%", "wrong%", "MOTA", "MOTP", "IDF1", "HOTA", "IDsw", "FP", "FN", "boxes"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("Dice", justify="right", no_wrap=True)
    for row in scores:
        identity = (row.keep, row.wrong, row.mota, row.motp, row.idf1, row.hota)
        counts = (row.idsw, row.fp, row.fn, row.boxes)
        table.add_row(
            row.sequence, *(f"{x:.1f}" for x in identity), *map(str, counts), f"{row.dice:.1f}"
        )
    return table


def scores_json(scores: Sequence[BaseModel]) -> str:
    """One JSON object per sequence, each on a line of its own, without a final newline."""
    return "\n".join(row.model_dump_json() for row in scores)
