"""Recordings as other footage: boxes go where the pixels go, in the same order, and ids stay."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.common import REPOSITORY
from benchmarks.mechanisms import tracked_boxes
from benchmarks.variant_sequences import VARIANTS, Variant, write_variant
from heel.evaluation.motchallenge import read_detections, read_ground_truth, read_sequence_info
from heel.evaluation.rows import rows_from_xyxy
from heel.schemas.errors import SettingsError
from heel.services.pipeline import RecordedFrames

WIDTH, HEIGHT, FRAMES = 120, 80, 12
COLOURS = {3: (0, 0, 250), 8: (0, 250, 0)}


def box(person: int, frame: int) -> tuple[int, int, int, int]:
    """One walks right, one left, at different heights; pixels [left, right)."""
    left = 4 + 8 * frame if person == 3 else WIDTH - 20 - 8 * frame
    return left, 8 if person == 3 else 44, left + 12, 40 if person == 3 else 76


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two coloured boxes that walk, as a sequence folder."""
    folder = tmp_path_factory.mktemp("recording") / "walkers"
    for name in ("img1", "gt", "det"):
        (folder / name).mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        f"[Sequence]\nname=walkers\nimDir=img1\nframeRate=10\nseqLength={FRAMES}\n"
        f"imWidth={WIDTH}\nimHeight={HEIGHT}\nimExt=.png\n"
    )
    rows: dict[str, list[str]] = {"gt": [], "det": []}
    for frame in range(1, FRAMES + 1):
        image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
        for person, colour in COLOURS.items():
            x1, y1, x2, y2 = box(person, frame - 1)
            image[y1:y2, max(x1, 0) : x2] = colour
            for name, identity in (("gt", person), ("det", -1)):
                rows[name].append(
                    f"{frame},{identity},{x1 + 1},{y1 + 1},{x2 - x1},{y2 - y1},1,-1,-1,-1"
                )
        cv2.imwrite(str(folder / "img1" / f"{frame:06d}.png"), image)
    for name, lines in rows.items():
        (folder / name / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return folder


def written(recording: Path, variant: Variant, tmp_path: Path) -> Path:
    folder = tmp_path / "out" / recording.name
    write_variant(recording, variant, folder, FRAMES)
    return folder


def where_it_is(image: NDArray[np.uint8], colour: tuple[int, int, int]) -> list[float]:
    """The box of a colour in a picture, as xyxy; the strongest channel tells."""
    channel = int(np.argmax(colour))
    others = np.delete(image.astype(int), channel, axis=2).max(axis=2)
    rows, columns = np.nonzero(image[:, :, channel].astype(int) - others > 60)
    return [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]


@pytest.mark.parametrize("name", VARIANTS)
def test_boxes_are_where_the_pixels_of_their_person_are(
    name: str, recording: Path, tmp_path: Path
) -> None:
    folder = written(recording, VARIANTS[name], tmp_path)
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    seen = 0
    with RecordedFrames(str(folder)) as frames:
        for frame, image, _ in frames:
            people = truth.select(truth.frames == frame.index + 1)
            assert people.identities.tolist() == list(COLOURS)
            for person, true_box in zip(people.identities.tolist(), people.boxes_xyxy, strict=True):
                found = where_it_is(image, COLOURS[person])
                assert np.abs(np.array(found) - true_box).max() <= 1.0 * (
                    VARIANTS[name].scale < 1
                ), f"person {person} of frame {frame.index + 1}"
            seen += 1
    assert seen == read_sequence_info(folder).frame_count == truth.frames.max()


def test_frames_are_played_in_the_order_of_the_variant(recording: Path, tmp_path: Path) -> None:
    def lefts(variant: Variant, name: str) -> list[float]:
        folder = written(recording, variant, tmp_path / name)
        truth = read_ground_truth(folder / "gt" / "gt.txt")
        return [float(row) for row in truth.select(truth.identities == 3).boxes_xyxy[:, 0]]

    shot = [float(box(3, frame)[0]) for frame in range(FRAMES)]
    assert lefts(Variant(), "shot") == shot
    assert lefts(Variant(backwards=True), "backwards") == shot[::-1]
    assert lefts(Variant(start=0.25), "later") == shot[3:]
    assert lefts(Variant(backwards=True, start=0.25), "both") == shot[::-1][3:]
    assert lefts(Variant(every=2), "second") == shot[::2]


def test_time_goes_on_as_fast_where_frames_are_left_out(recording: Path, tmp_path: Path) -> None:
    folder = written(recording, Variant(every=2), tmp_path)
    with RecordedFrames(str(folder)) as frames:
        times_s = [frame.t_capture_ns * 1e-9 for frame, _, _ in frames]
    np.testing.assert_allclose(np.diff(times_s), 0.2)


def test_boxes_of_a_file_go_the_same_way(recording: Path, tmp_path: Path) -> None:
    folder = written(recording, Variant(mirrored=True, backwards=True, scale=0.5), tmp_path)
    found = read_detections(folder / "det" / "det.txt")
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    for frame in range(1, FRAMES + 1):
        detected = found.boxes_xyxy[found.frames == frame]
        true_boxes = truth.boxes_xyxy[truth.frames == frame]
        assert sorted(map(tuple, detected)) == sorted(map(tuple, true_boxes))


def test_flags_stay_with_their_boxes() -> None:
    rows = rows_from_xyxy([1, 2], [3, 3], np.array([[0, 0, 9, 9], [9, 0, 18, 9]]), [0.0, 1.0])
    turned = Variant(mirrored=True, backwards=True).rows(rows, 2, 100, 50)
    assert turned.values.tolist() == [1.0, 0.0]
    assert turned.boxes_xyxy.tolist() == [[82, 0, 91, 9], [91, 0, 100, 9]]


def test_boxes_alone_are_tracked_alike_mirrored_and_at_any_scale(
    recording: Path, tmp_path: Path
) -> None:
    """Why such variants are left out where there are no pictures."""
    shot = tracked_boxes(written(recording, Variant(), tmp_path / "shot"))
    for k, variant in enumerate((Variant(mirrored=True), Variant(scale=0.5))):
        assert not variant.moves_boxes
        assert tracked_boxes(written(recording, variant, tmp_path / str(k))) == shot


def test_no_picture_of_a_recording_gets_into_the_repository(recording: Path) -> None:
    with pytest.raises(SettingsError, match="repository"):
        write_variant(recording, Variant(), REPOSITORY / "variant", FRAMES)
    assert not (REPOSITORY / "variant").exists()
