"""Outputs of the networks that people have: read right, or refused by name with what to do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.networks.heads import Head, cells, people, recognise
from heel.services.networks.names import HeadName
from heel.services.networks.onnx_file import OnnxFile

SIDE = 96
CELLS = cells(SIDE, SIDE)
PERSON, OTHER = (48.0, 36.0, 16.0, 40.0), (24.0, 50.0, 34.0, 24.0)
CORNERS = (40.0, 16.0, 56.0, 56.0)
COCO = ("person", "bicycle", "car", *(f"thing {number}" for number in range(77)))
Table = np.ndarray[Any, np.dtype[np.float32]]


def file(names: tuple[str, ...] | None = None, task: str = "") -> OnnxFile:
    return OnnxFile(SIDE, SIDE, ("out",), names, task)


def centres(strides: tuple[int, ...] = (8, 16, 32), each: int = 1) -> Table:
    found = []
    for stride in strides:
        y, x = np.mgrid[: SIDE // stride, : SIDE // stride]
        found += [np.stack([x.ravel(), y.ravel()], axis=1) * stride + stride / 2] * each
    return np.concatenate(found).astype(np.float32)


def boxes(columns: int, places: Table | None = None) -> Table:
    """A decoded box of 8 px about every cell, all scores 0."""
    at = centres() if places is None else places
    table = np.zeros((len(at), columns), np.float32)
    table[:, :2], table[:, 2:4] = at, 8.0
    return table


def seen(table: Table, first: int, person: int, other: int | None = None) -> Table:
    """The same with a person, and something surer of another class."""
    found = table.copy()
    found[20, :4], found[20, first + person] = PERSON, 0.9
    if other is not None:
        found[30, :4], found[30, first + other] = OTHER, 0.95
    return found


def recognised(
    table: Table, told: OnnxFile | None = None, chosen: int | None = None, turned: bool = False,
    **more: Table,
) -> Head:  # fmt: skip
    out = table.T if turned else table
    probe: Mapping[str, Table] = {"out": out[None], **more}
    return recognise(told or file(), [probe, probe], chosen)


def found(head: Head, table: Table) -> list[list[float]]:
    """Boxes of people with a score of at least a half."""
    at, scores = people((table.T if head.turned else table)[None], head, SIDE, SIDE)
    return at[scores > 0.5].tolist()


@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize(
    ("names", "person", "other"),
    [
        (COCO, 0, 2),
        (("Bus", "Car", "Person", "Truck"), 2, 0),
        (("head", "person"), 1, 0),
        (("pedestrian",), 0, None),
    ],
)
def test_the_person_is_the_class_of_that_name_wherever_it_stands(
    names: tuple[str, ...], person: int, other: int | None, turned: bool
) -> None:
    blank = boxes(4 + len(names))
    head = recognised(blank, file(names), turned=turned)
    assert (head.name, head.turned, head.form.rgb) == ("yolov8", turned, True)
    assert found(head, seen(blank, 4, person, other)) == [pytest.approx(CORNERS)]
    assert names[person] in head.why


def test_two_classes_of_people_are_both_people() -> None:
    blank = boxes(6)
    head = recognised(blank, file(("pedestrian", "people")))
    both = seen(blank, 4, 0, 1)
    assert len(found(head, both)) == 2


@pytest.mark.parametrize(
    ("names", "count", "chosen", "message"),
    [
        (("cat", "dog"), 2, None, r"none of its 2 classes is a person \(cat, dog\)"),
        (("car",), 1, None, r"none of its 1 classes is a person \(car\)"),
        (("person", "car"), 2, 1, "leave it out"),
        (None, 9, None, "does not name its 9 classes: .*--model-class N"),
        (None, 2, 5, "it has 2 classes, 0 to 1"),
        (("class0", "class1"), 2, None, "does not name its 2 classes"),
    ],
)
def test_no_class_is_taken_for_people_in_silence(
    names: tuple[str, ...] | None, count: int, chosen: int | None, message: str
) -> None:
    with pytest.raises(SettingsError, match=message):
        recognised(boxes(4 + count), file(names), chosen, turned=True)


def test_what_the_user_says_counts_where_the_file_is_silent() -> None:
    blank = boxes(4 + 9)
    head = recognised(blank, chosen=7, turned=True)
    assert found(head, seen(blank, 4, 7, 0)) == [pytest.approx(CORNERS)]
    assert "--model-class" in head.why


def test_coco_and_a_single_class_need_no_names_and_are_told_of() -> None:
    assert "COCO" in recognised(boxes(84), turned=True).why
    assert "only class" in recognised(boxes(5)).why


def test_a_transposed_yolov8_without_metadata_is_no_yolox() -> None:
    blank = boxes(84)
    head = recognised(blank)
    assert head.name == "yolov8"
    assert found(head, seen(blank, 4, 0, 2)) == [pytest.approx(CORNERS)]


def test_yolov6_is_known_by_its_objectness_of_1_and_gets_its_own_pixels() -> None:
    blank = boxes(85)
    blank[:, 4] = 1.0
    head = recognised(blank)
    assert head.name == "yolov6"
    assert head.form.rgb
    assert head.form.scale == pytest.approx(1 / 255)
    assert found(head, seen(blank, 5, 0, 2)) == [pytest.approx(CORNERS)]


def test_yolov5_has_three_rows_a_cell() -> None:
    blank = boxes(85, centres(each=3))
    blank[:, 4] = 0.001
    for more in ({}, {"grid": np.zeros((1, 3, 12, 12, 85), np.float32)}):
        head = recognised(blank, **more)
        assert head.name == "yolov5"
        assert head.form.rgb
    person = seen(blank, 5, 0)
    person[20, 4] = 0.95
    assert found(head, person) == [pytest.approx(CORNERS)]


@pytest.mark.parametrize("columns", [85, 6])
def test_yolox_raw_and_decoded_are_told_apart_also_with_one_class(columns: int) -> None:
    rng = np.random.default_rng(3)
    raw = rng.normal(0.5, 0.7, (CELLS, columns)).astype(np.float32)
    raw[:, 4] = rng.uniform(0, 1e-3, CELLS)
    raw[:, 5:] = rng.uniform(0, 0.4, (CELLS, columns - 5))
    assert recognised(raw).name == "yolox"
    decoded = raw.copy()
    decoded[:, :2] = centres() + rng.normal(0, 4, (CELLS, 2))
    head = recognised(decoded)
    assert head.name == "yolox-decoded"
    assert not head.form.rgb


@pytest.mark.parametrize("strides", [(8, 16, 32, 64), (4, 8, 16, 32)])
def test_yolov8_with_another_grid_is_decoded_by_itself(strides: tuple[int, ...]) -> None:
    blank = boxes(84, centres(strides))
    head = recognised(blank, file(COCO), turned=True)
    assert found(head, seen(blank, 4, 0, 2)) == [pytest.approx(CORNERS)]


def test_boxes_as_shares_of_the_picture_become_pixels() -> None:
    blank = boxes(84)
    blank[:, :4] /= SIDE
    head = recognised(blank, file(COCO), turned=True)
    person = seen(blank, 4, 0)
    person[20, :4] = np.array(PERSON) / SIDE
    assert found(head, person) == [pytest.approx(CORNERS, abs=1e-3)]


def test_poses_and_masks_are_left_aside() -> None:
    pose = boxes(56)
    pose[:, 5:] = 300.0
    for told in (file(("person",), "pose"), file()):
        head = recognised(pose, told, turned=True)
        assert found(head, seen(pose, 4, 0)) == [pytest.approx(CORNERS)]
    masks = boxes(4 + 80 + 32)
    masks[:, 84:] = -3.0
    for told in (file(COCO, "segment"), file()):
        head = recognised(masks, told, turned=True, masks=np.zeros((1, 32, 24, 24), np.float32))
        assert found(head, seen(masks, 4, 0, 2)) == [pytest.approx(CORNERS)]


def zeros(*shape: int) -> Table:
    return np.zeros(shape, np.float32)


def nanodet() -> Table:
    rng = np.random.default_rng(4)
    scores, distances = rng.uniform(0, 0.05, (CELLS, 80)), rng.normal(0, 3, (CELLS, 32))
    return np.concatenate([scores, distances], axis=1).astype(np.float32)[None]


@pytest.mark.parametrize(
    ("outputs", "message"),
    [
        pytest.param([zeros(1, CELLS, 80), zeros(1, CELLS, 4)], "YOLO-NAS", id="scores-boxes"),
        pytest.param([zeros(1, CELLS, 4), zeros(1, CELLS, 80)], "YOLO-NAS", id="boxes-scores"),
        pytest.param([zeros(1, CELLS, 80)], "scores without boxes", id="scores-alone"),
        pytest.param([zeros(1, CELLS, 4)], "boxes alone", id="boxes-alone"),
        pytest.param([zeros(1, 3 * CELLS, 1, 4), zeros(1, 3 * CELLS, 80)], "none that is read",
                     id="yolov4"),
        pytest.param([nanodet()], "NanoDet", id="nanodet"),
        pytest.param([zeros(1, 300, 6)], "order and pixels.*--model-head.*yolov10", id="yolov10"),
        pytest.param([zeros(0, 7)], "--model-head.*yolov7-nms.*yolox-nms", id="nms"),
        pytest.param([zeros(1, 300, 84)], "RT-DETR", id="rt-detr"),
        pytest.param([zeros(1, 300, 4), zeros(1, 300, 80)], "boxes and scores apart", id="detr"),
        pytest.param([zeros(1, 1000)], "a classifier", id="classifier"),
        pytest.param([zeros(1, 3, 12, 12, 85), zeros(1, 3, 6, 6, 85), zeros(1, 3, 3, 3, 85)],
                     "raw heads", id="raw-heads"),
        pytest.param([zeros(1, 21, 96, 96)], "none that is read", id="segmentation"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_by_name_with_what_to_do(
    outputs: list[Table], message: str
) -> None:
    probe = {f"out{number}": output for number, output in enumerate(outputs)}
    with pytest.raises(SettingsError, match=message) as refused:
        recognise(file(), [probe, probe])
    assert "\n" not in str(refused.value)
    if "alone" not in message and "--model-head" not in message:
        assert "YOLOX" in str(refused.value), "what is read is named"


def listed(kind: str, *more: tuple[float, ...]) -> Table:
    """A list of boxes: a person, others, and rows that fill it up."""
    rows = [
        (*CORNERS, 0.9, 0),
        (7.0, 38.0, 41.0, 62.0, 0.95, 2),
        (1.0, 2.0, 9.0, 20.0, 0.02, 0),
        *more,
    ]
    table = np.array(rows, np.float32)
    if kind == "yolov10":
        return np.concatenate([table, np.zeros((5, 6), np.float32)])
    batch = np.zeros((len(table), 1), np.float32)
    if kind == "yolov7-nms":
        return np.concatenate([batch, table[:, :4], table[:, 5:], table[:, 4:5]], axis=1)
    return np.concatenate([batch, table[:, 5:], table[:, 4:5], table[:, :4]], axis=1)


LISTS: list[HeadName] = ["yolov10", "yolov7-nms", "yolox-nms"]


@pytest.mark.parametrize("kind", LISTS)
@pytest.mark.parametrize("many", [True, False])
def test_a_list_of_boxes_is_read_as_the_user_says(kind: HeadName, many: bool) -> None:
    table = listed(kind)
    probe = {"out": table[None] if many else table}
    head = recognise(file(COCO), [probe, probe], None, kind)
    assert (head.name, head.form.rgb) == (kind, kind != "yolox-nms")
    boxes_of, scores = people(probe["out"], head, SIDE, SIDE)
    assert boxes_of[scores > 0.5].tolist() == [pytest.approx(CORNERS)]


def test_ultralytics_says_of_itself_how_its_list_is_arranged() -> None:
    told = file(COCO, "detect")
    for table in (listed("yolov10"), np.zeros((300, 6), np.float32)):
        probe = {"out": table[None]}
        assert recognise(told, [probe, probe]).name == "yolov10"
    masks = np.concatenate([listed("yolov10"), zeros(8, 32)], axis=1)
    probe = {"out": masks[None], "masks": zeros(1, 32, 24, 24)}
    head = recognise(file(COCO, "segment"), [probe, probe])
    assert people(masks[None], head, SIDE, SIDE)[1].tolist()[0] == pytest.approx(0.9)


def test_shares_of_the_picture_in_a_list_become_pixels() -> None:
    table = listed("yolov10")
    table[:, :4] /= SIDE
    probe = {"out": table[None]}
    head = recognise(file(COCO), [probe, probe], None, "yolov10")
    assert people(table[None], head, SIDE, SIDE)[0][0] == pytest.approx(CORNERS, abs=1e-3)


@pytest.mark.parametrize(
    ("made", "said", "message"),
    [
        ("yolov7-nms", None, r"--model-head, which is one of yolov7-nms \("),
        ("yolox-nms", None, r"--model-head, which is one of yolox-nms \("),
        ("yolov7-nms", "yolox-nms", "its 7 columns are not those of yolox-nms"),
        ("yolov10", "yolov7-nms", "no list of 7 columns|not those of yolov7-nms"),
        ("yolov10", "yolox", "none that is read"),
    ],
)
def test_a_list_is_never_read_another_way(
    made: str, said: HeadName | None, message: str
) -> None:  # fmt: skip
    probe = {"out": listed(made)[None]}
    with pytest.raises(SettingsError, match=message):
        recognise(file(COCO), [probe, probe], None, said)


def test_without_names_a_list_does_not_tell_its_people() -> None:
    probe = {"out": listed("yolov10")[None]}
    with pytest.raises(SettingsError, match="which one is a person with --model-class N"):
        recognise(file(), [probe, probe], None, "yolov10")
    head = recognise(file(), [probe, probe], 2, "yolov10")
    assert people(probe["out"], head, SIDE, SIDE)[1] == pytest.approx([0.95])


def test_what_cannot_be_told_apart_is_read_as_the_user_says() -> None:
    blank = boxes(9)
    with pytest.raises(SettingsError, match="--model-head yolox-decoded or --model-head yolov8"):
        recognised(blank)
    probe = {"out": blank[None]}
    yolox = recognise(file(), [probe, probe], 1, "yolox-decoded")
    assert (yolox.people, yolox.form.rgb) == ((6,), False)
    yolov8 = recognise(file(), [probe, probe], 1, "yolov8")
    assert (yolov8.people, yolov8.form.rgb) == ((5,), True)
    with pytest.raises(SettingsError, match=r"--model-head yolov5: .* rows instead of"):
        recognise(file(), [probe, probe], 1, "yolov5")
    with pytest.raises(SettingsError, match="9 columns do not fit it and the 80 class names"):
        recognise(file(COCO), [probe, probe], None, "yolov8")


def test_scores_that_are_no_probabilities_are_refused() -> None:
    blank = boxes(84)
    blank[:, 4:] = -6.0
    with pytest.raises(SettingsError, match=r"scores from -6 to -6 .*sigmoid"):
        recognised(blank, file(COCO), turned=True)
    blank[:, 4:] = np.nan
    with pytest.raises(SettingsError, match="NaN"):
        recognised(blank, file(COCO), turned=True)


@pytest.mark.parametrize(("task", "what"), [("classify", "classifier"), ("obb", "turned boxes")])
def test_another_task_is_named(task: str, what: str) -> None:
    with pytest.raises(SettingsError, match=what):
        recognised(boxes(84), file(COCO, task), turned=True)
