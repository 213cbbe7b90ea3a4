"""What the numbers that come out of a detection network mean.

Two layouts are read, whichever way they are turned: a box and class scores (YOLOv8 and its
successors), and a box, objectness and class scores. The latter is YOLOX's, with offset and
logarithmic size in a grid cell (Z. Ge et al., "YOLOX: Exceeding YOLO series in 2021") or decoded
already; YOLOv6's, whose objectness is 1; and YOLOv5's and YOLOv7's, with three rows a cell. They
want different pixels, so that none is taken for another.

Networks that choose among their boxes themselves (YOLOv10, exports with non-maximum suppression)
give a short list of them. Neither the order of its columns nor the pixels it wants can be told from
it: the file's metadata says it, or the user.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import SettingsError
from heel.services.networks.names import HeadName
from heel.services.networks.onnx_file import OnnxFile

Floats = NDArray[np.float32]
STRIDES = (8, 16, 32)
"""Input pixels per grid cell, of the three grids of a plain YOLO."""
_GRIDS = (STRIDES, (*STRIDES, 64), (4, *STRIDES))
"""Of networks that decode by themselves: P5, P6 and P2."""
_ANCHORS = 3
"""Rows a grid cell of YOLOv5 and YOLOv7."""
_RAW_OFFSET_LIMIT = 16.0
"""Offsets within a cell stay far below this, positions in a picture go far beyond it."""
_UNIT_LIMIT = 2.0
"""Positions that never pass this are shares of the picture's sides, not pixels."""
_GRID_CORRELATION = 0.8
"""Decoded centres correlate with their cells almost fully, raw offsets not at all."""
_SURE_OF_THE_CLASS = 0.01
"""YOLOX's class scores are those of a thing if there is one, and high where there is none; scores
without objectness are near 0 there."""
_MASKS = 32
"""Columns of mask coefficients of a YOLO that segments."""
_POSE_COLUMNS = 56
"""Of a YOLO for poses: box, one class and 17 points of three numbers."""
_COCO_PLAIN = 84
"""Columns of a box and COCO's 80 classes."""
_COCO_OBJECTNESS = 85
"""The same with objectness."""
_ROUNDING = 1e-3
"""By which probabilities may leave 0 to 1, in float16."""
_PEOPLE = {"person", "persons", "people", "pedestrian", "pedestrians", "human", "humans"}
_NO_NAME = re.compile(r"(class|cls|c|label|object|item)?[ _-]?\d+")
"""What exporters write where they were given no names."""
_MOST_CLASSES = 10_000
"""Of a file without names; the largest detection data sets have 1,200."""
_COCO = 80
"""Classes of the COCO data set; a person is the first."""
_SHOWN = 12
"""Class names that an error message shows at most."""
_LEAST_SURE_ROWS = 3
"""Of a list of boxes: by fewer its columns are not judged."""
_READ = "YOLOX, YOLOv5 to YOLOv10, YOLO11, YOLO12 and YOLO26 are read"


@dataclass(frozen=True)
class InputForm:
    """How a network wants its pixels.

    Attributes:
        scale: factor on 0 to 255.
        rgb: red first instead of blue first.
    """

    scale: float
    rgb: bool


BYTES_BGR = InputForm(1.0, False)
"""0 to 255, blue first: YOLOX."""
UNIT_RGB = InputForm(1.0 / 255.0, True)
"""0 to 1, red first: all others."""
_TITLES: dict[HeadName, str] = {
    "yolox": "YOLOX (release 0.1.1rc0 or newer; older weights want other pixels)",
    "yolox-decoded": "YOLOX, decoded (release 0.1.1rc0 or newer; older weights want other pixels)",
    "yolov8": "YOLOv8 and alike",
    "yolov6": "YOLOv6",
    "yolov5": "YOLOv5 or YOLOv7",
    "yolov10": "YOLOv10, YOLO26 or an export with non-maximum suppression",
    "yolov7-nms": "YOLOv7 with non-maximum suppression",
    "yolox-nms": "YOLOX with non-maximum suppression",
}


@dataclass(frozen=True)
class _Columns:
    """Where in a list of boxes what stands."""

    count: int
    corners: int
    score: int
    number: int
    said: str


_LISTS: dict[HeadName, _Columns] = {
    "yolov10": _Columns(6, 0, 4, 5, "x1 y1 x2 y2 score class, pixels RGB 0 to 1"),
    "yolov7-nms": _Columns(7, 1, 6, 5, "batch x1 y1 x2 y2 class score, pixels RGB 0 to 1"),
    "yolox-nms": _Columns(7, 3, 2, 1, "batch class score x1 y1 x2 y2, pixels BGR 0 to 255"),
}
"""Of networks that choose among their boxes: THU-MIG's and Ultralytics', WongKinYiu's end2end, and
PINTO0309's conversions."""
_WITH_OBJECTNESS = ("yolox", "yolox-decoded", "yolov6", "yolov5")


@dataclass(frozen=True)
class Head:
    """How one output is read.

    Attributes:
        name: the kind.
        output: name of the output that holds the boxes.
        turned: (1, columns, N) instead of (1, N, columns).
        unit_boxes: positions are shares of the picture's sides.
        people: columns of the class scores that are people; of a list of boxes their classes.
        why: why those, in words.
    """

    name: HeadName
    output: str
    turned: bool
    unit_boxes: bool
    people: tuple[int, ...]
    why: str

    @property
    def form(self) -> InputForm:
        """How it wants its pixels."""
        return BYTES_BGR if self.name.startswith("yolox") else UNIT_RGB

    @property
    def people_from(self) -> int:
        """The first column of class scores, of heads that have a row or a column for each cell."""
        return 5 if self.name in _WITH_OBJECTNESS else 4

    @property
    def is_list(self) -> bool:
        """Whether the network has chosen among its boxes: it gives as many as it likes."""
        return self.name in _LISTS

    @property
    def title(self) -> str:
        """The kind, for people."""
        return _TITLES[self.name]


def cells(width: int, height: int, strides: Sequence[int] = STRIDES) -> int:
    """Number of grid cells of an input of this size."""
    return sum((width // stride) * (height // stride) for stride in strides)


def recognise(
    file: OnnxFile, probes: Sequence[Mapping[str, Floats]], chosen_class: int | None = None,
    chosen_head: HeadName | None = None,
) -> Head:  # fmt: skip
    """Which head made the outputs of some probes.

    Args:
        file: what the file says of itself.
        probes: outputs by name, for pictures that show nobody.
        chosen_class: class that the user says is a person.
        chosen_head: head that the user says it is; its outputs must have the form of it.

    Raises:
        SettingsError: none that is read, or nothing tells which or what its classes are.
    """
    shapes = {name: output.shape for name, output in probes[0].items()}
    if file.task in ("classify", "obb"):
        kind = "a classifier: it finds no boxes" if file.task == "classify" else "turned boxes"
        raise SettingsError(f"a network for {kind}; {_READ}")
    if (found := _list_of_boxes(file, shapes, chosen_head)) is not None:
        return _recognise_list(file, [probe[found] for probe in probes], found, chosen_class,
                               chosen_head)  # fmt: skip
    name, turned = _output_with_boxes(file, shapes)
    tables = [_rows(probe[name], turned) for probe in probes]
    rows = len(tables[0])
    masks = any(len(shape) == 4 and shape[1] == _MASKS for shape in shapes.values())
    anchors = rows == _ANCHORS * cells(file.width, file.height)
    decoded = _is_decoded(tables, file.width, file.height)
    if chosen_head is None:
        objectness, classes = _layout(file, tables, turned, anchors, decoded, masks)
        kind_of = _kind(tables, objectness, anchors, decoded)
    else:
        objectness, kind_of = chosen_head in _WITH_OBJECTNESS, chosen_head
        classes = _classes(file, tables[0].shape[1], objectness, masks)
        _check_chosen(chosen_head, rows, file)
    first = 5 if objectness else 4
    _check_scores(tables, first - objectness, first + classes)
    people_of = _people_of(kind_of, file, classes, chosen_class)
    most = max(float(np.abs(table[:, :2]).max()) for table in tables)
    unit_boxes = kind_of != "yolox" and 0.0 < most <= _UNIT_LIMIT
    columns = tuple(first + column for column in people_of.columns)
    return Head(kind_of, name, turned, unit_boxes, columns, people_of.why)


def _people_of(
    kind: HeadName, file: OnnxFile, classes: int | None, chosen: int | None
) -> PersonClasses:
    try:
        return person_classes(file.class_names, classes, chosen)
    except SettingsError as error:
        raise SettingsError(f"head of {_TITLES[kind]}: {error}") from None


def _check_chosen(chosen: HeadName, rows: int, file: OnnxFile) -> None:
    """Of heads that are a grid of cells, the number of rows must be theirs."""
    count = cells(file.width, file.height)
    wanted = {"yolox": count, "yolov5": _ANCHORS * count}.get(chosen, rows)
    if rows != wanted:
        raise SettingsError(
            f"--model-head {chosen}: {rows} rows instead of the {wanted} of an input of "
            f"{file.width}x{file.height}: leave it out, or name another head"
        )


def _classes(file: OnnxFile, columns: int, objectness: bool, masks: bool) -> int:
    """Number of classes of a head that the user has named."""
    left = columns - 4 - objectness - (_MASKS if masks else 0)
    named = left if file.class_names is None else len(file.class_names)
    if named != left or left < 1:
        names = f" and the {named} class names in the file" if named != left else ""
        raise SettingsError(
            f"--model-head: {columns} columns do not fit it{names}: leave it out, or name another "
            "head"
        )
    return left


def _list_of_boxes(
    file: OnnxFile, shapes: Mapping[str, tuple[int, ...]], chosen: HeadName | None
) -> str | None:
    """The output that is a list of boxes, with no row for each cell; None where none is."""
    if chosen is not None and chosen not in _LISTS:
        return None
    counts = {cells(file.width, file.height, strides) for strides in _GRIDS}
    counts.add(_ANCHORS * cells(file.width, file.height))
    flat = {name: shape for name, shape in shapes.items() if len(shape) != 4 or shape[1] == 1}
    if len(flat) != 1:
        return None
    ((name, shape),) = flat.items()
    if len(shape) < 2:
        return None
    columns = {one.count for one in _LISTS.values()}
    if file.task in ("segment", "pose"):
        columns = {shape[-1]} if shape[-1] > _LISTS["yolov10"].count else set()
    is_list = math.prod(shape[:-2]) == 1 and shape[-1] in columns
    if is_list and (chosen is not None or not counts & set(shape)):
        return name
    if chosen is not None:
        raise SettingsError(
            f"--model-head {chosen}: an output of {'x'.join(map(str, shape))} is no list of "
            f"{_LISTS[chosen].count} columns ({_LISTS[chosen].said}): leave it out, or name "
            "another head"
        )
    return None


def _recognise_list(
    file: OnnxFile, outputs: Sequence[Floats], name: str, chosen_class: int | None,
    chosen: HeadName | None,
) -> Head:  # fmt: skip
    tables = [output.reshape(-1, output.shape[-1]) for output in outputs]
    columns = tables[0].shape[1]
    by_metadata = file.task != "" and file.class_names is not None
    kind = chosen or ("yolov10" if by_metadata else None)
    fitting = [one for one in _LISTS if _fits(tables, one, file)]
    if kind is None:
        offered = fitting or [one for one in _LISTS if _LISTS[one].count == columns]
        said = ", ".join(f"{one} ({_LISTS[one].said})" for one in offered)
        raise SettingsError(
            f"a list of boxes with {columns} columns, whose order and pixels the file does not "
            f"tell: say it with --model-head, which is one of {said}; or export it without "
            "non-maximum suppression"
        )
    if kind not in fitting:
        raise SettingsError(
            f"a list of boxes, but its {columns} columns are not those of {kind} "
            f"({_LISTS[kind].said}): name another with --model-head, or export it without "
            "non-maximum suppression"
        )
    people_of = _people_of(kind, file, None, chosen_class)
    corners = _corners(_filled(np.concatenate(tables)), kind)
    unit_boxes = len(corners) > 0 and float(np.abs(corners).max()) <= _UNIT_LIMIT
    return Head(kind, name, False, unit_boxes, people_of.columns, people_of.why)


def _fits(tables: Sequence[Floats], kind: HeadName, file: OnnxFile) -> bool:
    """Whether what stands in the rows can be what it should be; of few rows it is believed."""
    columns = _LISTS[kind]
    rows = np.concatenate(tables)
    if rows.shape[1] < columns.count or (file.task == "" and rows.shape[1] != columns.count):
        return False
    rows = _filled(rows)
    if len(rows) < _LEAST_SURE_ROWS:
        return True
    numbers, corners = rows[:, columns.number], _corners(rows, kind)
    most = len(file.class_names) if file.class_names is not None else _MOST_CLASSES
    counted = (np.abs(numbers - np.round(numbers)) <= _ROUNDING) & (numbers > -0.5)
    return bool(
        np.isfinite(rows[:, : columns.count]).all()
        and _unit(rows[:, columns.score])
        and (counted & (numbers < most - 0.5)).all()
        and (corners[:, 2:] >= corners[:, :2]).all()
        and (columns.corners == 0 or (rows[:, 0] == 0.0).all())
    )


def _filled(rows: Floats) -> Floats:
    """Without the rows that fill a list up: all the same number."""
    filled: Floats = rows[(rows != rows[:, :1]).any(axis=1)]
    return filled


def _corners(rows: Floats, kind: HeadName) -> Floats:
    first = _LISTS[kind].corners
    corners: Floats = rows[:, first : first + 4]
    return corners


def people(
    output: Floats, head: Head, width: int, height: int, least_score: float = -math.inf
) -> tuple[Floats, Floats]:  # fmt: skip
    """Boxes (N, 4) xyxy in input pixels and scores (N,) in [0, 1] of the people's classes.

    Args:
        output: of the network.
        head: how it is read.
        width: of the input, pixels.
        height: of the input, pixels.
        least_score: rows with less are left out.
    """
    if head.is_list:
        return _listed_people(output, head, width, height, least_score)
    rows = _rows(output, head.turned)
    # Column by column: rows are long, and of most of them nothing else is looked at.
    scores = rows[:, head.people[0]]
    for column in head.people[1:]:
        scores = np.maximum(scores, rows[:, column])
    if head.name != "yolov8":
        scores = scores * rows[:, 4]
    good = np.flatnonzero(scores >= least_score)
    centre, size = rows[good, :2], rows[good, 2:4]
    if head.name == "yolox":
        corner, stride = _grid(width, height)
        centre = (centre + corner[good]) * stride[good]
        size = np.exp(np.minimum(size, 12.0)) * stride[good]
    elif head.unit_boxes:
        sides = np.array([width, height], np.float32)
        centre, size = centre * sides, size * sides
    boxes = np.concatenate([centre - 0.5 * size, centre + 0.5 * size], axis=1)
    return boxes.astype(np.float32), scores[good].astype(np.float32)


def listed_scores(output: Floats, head: Head) -> Floats:
    """Scores (N,) of all boxes of a network that has chosen among them, of any class."""
    scores: Floats = output.reshape(-1, output.shape[-1])[:, _LISTS[head.name].score]
    return scores


def _listed_people(
    output: Floats, head: Head, width: int, height: int, least_score: float
) -> tuple[Floats, Floats]:
    rows = output.reshape(-1, output.shape[-1])
    columns = _LISTS[head.name]
    good = rows[:, columns.score] >= least_score
    rows = rows[good & np.isin(np.round(rows[:, columns.number]), head.people)]
    sides = np.array([width, height] * 2, np.float32) if head.unit_boxes else np.float32(1.0)
    return _corners(rows, head.name) * sides, rows[:, columns.score]


def _rows(output: Floats, turned: bool) -> Floats:
    rows: Floats = output[0].T if turned else output[0]
    return rows


def _output_with_boxes(file: OnnxFile, shapes: dict[str, tuple[int, ...]]) -> tuple[str, bool]:
    """The one output with a row or a column a cell, and whether it is columns."""
    counts = {cells(file.width, file.height, strides) for strides in _GRIDS}
    counts.add(_ANCHORS * cells(file.width, file.height))
    flat = {name: shape for name, shape in shapes.items() if len(shape) == 3}
    found = []
    for name, shape in flat.items():
        if shape[1] in counts and shape[2] >= 5:
            found.append((name, False))
        elif shape[2] in counts and shape[1] >= 5:
            found.append((name, True))
    # What comes beside it may be masks and single grids, no second list of boxes or scores.
    if len(found) == 1 and len(flat) == 1:
        rows = max(flat[found[0][0]][1:])
        if all(rows not in shape for name, shape in shapes.items() if name not in flat):
            return found[0]
    raise SettingsError(_refusal(file, list(shapes.values())))


def _layout(
    file: OnnxFile, tables: list[Floats], turned: bool, anchors: bool, decoded: bool, masks: bool
) -> tuple[bool, int]:
    """Whether there is objectness, and the number of classes."""
    columns = tables[0].shape[1]
    if file.class_names is not None:
        count = len(file.class_names)
        extra = columns - 4 - count
        if extra in (1, 1 + _MASKS):
            return True, count
        if extra == 0 or extra == _MASKS or (file.task == "pose" and extra > 0 and extra % 2 == 0):
            return False, count
        if file.task == "pose" and extra % 3 == 0:
            return False, count
        raise SettingsError(
            f"{columns} columns do not fit the {count} class names in the file: export it again; "
            f"{_READ}"
        )
    columns -= _MASKS if masks else 0
    if columns == _POSE_COLUMNS:
        return False, 1
    if anchors:
        return True, columns - 5
    if turned or columns in (5, _COCO_PLAIN):
        return False, columns - 4
    sure = max(float(np.median(table[:, 5:].max(axis=1))) for table in tables)
    if columns == _COCO_OBJECTNESS or not decoded or sure > _SURE_OF_THE_CLASS:
        return True, columns - 5
    raise SettingsError(
        f"nothing tells whether its {columns} columns are YOLOX's (objectness and {columns - 5} "
        f"classes) or YOLOv8's, transposed ({columns - 4} classes): export YOLOX without "
        "--decode_in_inference, or YOLOv8 with its metadata, or say --model-head yolox-decoded or "
        "--model-head yolov8"
    )


def _kind(tables: list[Floats], objectness: bool, anchors: bool, decoded: bool) -> HeadName:
    if not objectness:
        return "yolov8"
    plain = tables[0].shape[1] == _COCO_OBJECTNESS
    if not plain and not decoded and all(_unit(table[:, :4]) for table in tables):
        if not all(_unit(table) for table in tables):
            raise SettingsError(f"scores first, then distances: looks like NanoDet; {_READ}")
        raise SettingsError(
            f"scores without boxes (a part of YOLO-NAS, PP-YOLOE or YOLOv4?); {_READ}"
        )
    if anchors:
        return "yolov5"
    if all((table[:, 4] == 1.0).all() for table in tables) and decoded:
        return "yolov6"
    return "yolox-decoded" if decoded else "yolox"


def _is_decoded(tables: list[Floats], width: int, height: int) -> bool:
    """Whether the first two columns are positions in the picture."""
    if any(float(np.abs(table[:, :2]).max()) > _RAW_OFFSET_LIMIT for table in tables):
        return True
    rows = tables[0].shape[0]
    each = _ANCHORS if rows == _ANCHORS * cells(width, height) else 1
    places = _places(width, height, each)
    if rows != len(places):
        return True
    return any(
        abs(_correlation(table[:, axis], places[:, axis])) > _GRID_CORRELATION
        for table in tables
        for axis in (0, 1)
    )


def _correlation(a: Floats, b: Floats) -> float:
    if not (np.isfinite(a).all() and np.std(a) > 0 and np.std(b) > 0):
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def _check_scores(tables: list[Floats], first: int, end: int) -> None:
    scores = np.concatenate([table[:, first:end] for table in tables])
    if not np.isfinite(scores).all():
        raise SettingsError("scores that are no numbers (NaN or infinite): export it in float32")
    if not _unit(scores):
        raise SettingsError(
            f"scores from {scores.min():.3g} to {scores.max():.3g} are no probabilities (raw "
            f"scores, or another family such as NanoDet): export it with the sigmoid; {_READ}"
        )


def _unit(values: Floats) -> bool:
    return bool((values >= -_ROUNDING).all() and (values <= 1.0 + _ROUNDING).all())


def _refusal(file: OnnxFile, shapes: list[tuple[int, ...]]) -> str:
    """What outputs that cannot be read look like, and what to do."""
    shown = " and ".join("x".join(map(str, shape)) for shape in shapes[:4])
    told = f"{len(shapes)} outputs, {shown}," if len(shapes) > 1 else f"an output of {shown}"
    what = f"{told} for an input of {file.width}x{file.height}"
    flat = [shape for shape in shapes if len(shape) == 3]
    count = cells(file.width, file.height)
    if all(len(shape) == 2 for shape in shapes):
        return f"{what} looks like a classifier, which finds no boxes; {_READ}"
    if len(flat) >= 2 and any(shape[-1] == 4 for shape in flat):
        return (
            f"{what} looks like YOLO-NAS, PP-YOLOE or DAMO-YOLO (boxes and scores apart), which is "
            f"not read; {_READ}"
        )
    if flat and flat[0][1] in (100, 300, 900):
        return f"{what} looks like RT-DETR or DETR, which is not read; {_READ}"
    if flat and flat[0][1] in {cells(file.width, file.height, strides) for strides in _GRIDS}:
        return f"{what} looks like scores or boxes alone; {_READ}"
    if len(shapes) > 1 and all(len(shape) >= 4 for shape in shapes):
        return (
            f"{what} looks like raw heads, one a grid: export the network with its head decoded "
            f"into one output; {_READ}"
        )
    return (
        f"{what} is none that is read (1x{count}x(5+classes), 1x(4+classes)x{count} and alike): "
        "export the network without its own non-maximum suppression, with a batch of one and this "
        f"input size; {_READ}"
    )


@lru_cache(maxsize=8)
def _grid(width: int, height: int) -> tuple[Floats, Floats]:
    """Left upper corner (in cells) and stride of every grid cell, (N, 2) and (N, 1)."""
    corners, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        corners.append(np.stack([x.ravel(), y.ravel()], axis=1))
        strides.append(np.full((x.size, 1), stride))
    return (
        np.concatenate(corners).astype(np.float32),
        np.concatenate(strides).astype(np.float32),
    )


def _places(width: int, height: int, each: int) -> Floats:
    """Middle of every grid cell, pixels of the input; each grid so many times over, (N, 2)."""
    corner, stride = _grid(width, height)
    middle = (corner + 0.5) * stride
    grids = [middle[stride[:, 0] == one] for one in STRIDES]
    return np.concatenate([grid for one in grids for grid in [one] * each]).astype(np.float32)


@dataclass(frozen=True)
class PersonClasses:
    """The columns of a network's class scores that are people.

    Attributes:
        columns: from 0; a network may tell walking from sitting people.
        why: in words, for the log.
    """

    columns: tuple[int, ...]
    why: str


def person_classes(
    names: tuple[str, ...] | None, count: int | None, chosen: int | None
) -> PersonClasses:  # fmt: skip
    """The classes to look at.

    Args:
        names: what the file calls its classes, None where it does not say.
        count: of classes, None where only the names tell.
        chosen: what the user says, None for nothing.

    Raises:
        SettingsError: none is a person, or nothing tells which.
    """
    if names is not None and all(_NO_NAME.fullmatch(name.strip().lower()) for name in names):
        names = None
    if names is None:
        return _without_names(count, chosen)
    shown = ", ".join(name[:40] for name in names[:_SHOWN]) + (", ..." * (len(names) > _SHOWN))
    if chosen is not None:
        raise SettingsError(
            f"the file names its classes ({shown}), and --model-class {chosen} is for files that "
            "do not: leave it out"
        )
    columns = tuple(at for at, name in enumerate(names) if name.strip().lower() in _PEOPLE)
    if not columns:
        raise SettingsError(
            f"none of its {len(names)} classes is a person ({shown}): give a network that finds "
            "people"
        )
    found = ", ".join(f"{column} ({names[column][:40]})" for column in columns)
    return PersonClasses(columns, f"class {found} of {len(names)}, by the names in the file")


def _without_names(count: int | None, chosen: int | None) -> PersonClasses:
    if count is None:
        if chosen is None:
            raise SettingsError(
                "the file does not name its classes: say which one is a person with "
                "--model-class N, from 0"
            )
        return PersonClasses((chosen,), f"class {chosen}, as --model-class says")
    if chosen is not None:
        if chosen >= count:
            raise SettingsError(f"--model-class {chosen}: it has {count} classes, 0 to {count - 1}")
        return PersonClasses((chosen,), f"class {chosen} of {count}, as --model-class says")
    if count == 1:
        return PersonClasses((0,), "its only class, which the file does not name")
    if count == _COCO:
        return PersonClasses((0,), "class 0 of 80, COCO's person; the file names no classes")
    raise SettingsError(
        f"the file does not name its {count} classes: say which one is a person with "
        "--model-class N, from 0"
    )
