"""A network in an ONNX file: pictures in, people out."""

from __future__ import annotations

import math
import resource
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError, SettingsError
from heel.services.geometry.boxes import clipped
from heel.services.networks.engines import OnnxRuntime, onnxruntime, open_engine
from heel.services.networks.heads import (
    BYTES_BGR,
    UNIT_RGB,
    Floats,
    Head,
    InputForm,
    listed_scores,
    people,
    recognise,
)
from heel.services.networks.names import EngineName, HeadName
from heel.services.networks.onnx_file import OnnxFile, read_onnx_file
from heel.services.networks.shortening import shortened

Columns = tuple[int, ...] | None
"""Of an output: which are left; None: all."""
_MOST_MEMORY_BYTES = 4 << 30
"""Weights and all layers; the largest YOLO of the families read here takes about 1 GiB."""
_LONGEST_PROBE_S = 30.0
"""Of one picture at loading: the file is damaged or hostile then; chosen by hand."""
_TOLERANCE = 1e-2
"""Between engines, as a share of an output: they add in different orders, which of a picture of one
colour leaves up to 1e-3; what is computed wrongly is off by much more."""
_LIST_LENGTH_SHARE = 0.1
"""Of its length by which a list may be longer from one engine than from another, beside one box;
chosen by hand."""
_OVERLAP = 0.45
"""Of two boxes that overlap more than this (IoU), the weaker one goes."""
PAD_GREY = 114
"""Of what is around the picture, as YOLO networks are trained."""
_GAP_PX = 8
"""Between picture and copy: the network's finest cell."""
_HALVED_FROM = 8
"""Times the size of its place from which a picture is halved first: means of 2x2 pixels are quick,
and nearly nothing of them shows in so small a copy."""
_LEAST_COPY_SHARE = 0.2
"""Of the input's side: in a smaller copy nobody is found."""
_LARGE_SHARE = 0.45
"""Of the picture's height: a smaller person is seen better in the picture than in the copy."""


@dataclass(frozen=True, eq=False)
class Detections:
    """People in one picture.

    Attributes:
        boxes: (N, 4) float32 xyxy, pixels of the picture, clipped to it, best first.
        scores: (N,) float32 in [0, 1].
    """

    boxes: Floats
    scores: Floats


@contextmanager
def bounded_memory(more_bytes: int) -> Iterator[None]:
    """Let this process map only so much more than now: what a file asks for is not to end others.

    Linux; elsewhere, and under a limit that is stricter already, this changes nothing.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    try:
        mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (OSError, ValueError):
        yield
        return
    limit = mapped + more_bytes
    if soft != resource.RLIM_INFINITY and soft < limit:
        yield
        return
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


class PersonModel:
    """A detection network; input size, kind of head and person class are read from the file.

    Usage:
        model = PersonModel(Path("yolox_nano.onnx"))
        found = model.detect(image, least_score=0.3)
    """

    def __init__(
        self, file: Path, person_class: int | None = None, *, head: HeadName | None = None,
        engine: EngineName = "auto", providers: Sequence[str] = (), threads: int = 1,
    ) -> None:  # fmt: skip
        """Load the network and try it.

        Args:
            file: ONNX.
            person_class: which class is a person, where the file does not name its classes.
            head: what its output means, where the file does not tell.
            engine: what runs it; `auto` is onnxruntime where it is installed, else OpenCV.
            providers: of onnxruntime, for processors of other kinds.
            threads: of onnxruntime.

        Raises:
            SettingsError: the file is missing, is no ONNX network that the engine can run, has an
                input or output that is not understood, finds no people, or is not computed as the
                standard says; or there is no such engine.
        """
        told = read_onnx_file(file)
        self.width, self.height = told.width, told.height
        try:
            with bounded_memory(_MOST_MEMORY_BYTES):
                self._engine = open_engine(told.network, engine, providers, threads)
                probes = [self._all(probe, form, told.outputs) for probe, form in self._probes()]
                self._head = recognise(told, probes, person_class, head)
                read: Columns = None
                # OpenCV gains nothing by it, and takes longer for the larger window.
                if isinstance(self._engine, OnnxRuntime) and not self._head.is_list:
                    told, read = self._shorten(told)
                    self._engine = open_engine(told.network, engine, providers, threads)
                self._check(told, read)
        except MemoryError:
            raise SettingsError(
                f"model {file}: wants more than {_MOST_MEMORY_BYTES >> 30} GiB of memory: "
                "damaged, or no network for a robot"
            ) from None
        except SettingsError as error:
            raise SettingsError(f"model {file}: {error}") from None
        except HeelError as error:
            raise SettingsError(
                f"model {file}: the engine cannot run it ({error}); export it for inference, with "
                "a batch of one and opset 12 to 17"
            ) from None

    @property
    def head(self) -> HeadName:
        """The kind of its head."""
        return self._head.name

    @property
    def description(self) -> str:
        """What was read from the file, in one line."""
        head = self._head
        boxes = ", boxes as shares of the picture" if head.unit_boxes else ""
        what = f"{head.title}, {self.width}x{self.height}{boxes}"
        return f"{what}, by {self._engine.name}; people: {head.why}"

    def detect(self, image: NDArray[np.uint8], least_score: float) -> Detections:
        """People in a (H, W, 3) uint8 BGR picture with at least this score.

        Raises:
            HeelError: the engine failed on this picture.
        """
        rows, columns = image.shape[:2]
        sheet = Sheet((self.width, self.height), (columns, rows))
        blob = _blob(sheet.lay_out(image), self._head.form)
        try:
            output = self._engine.run(blob, [self._head.output])[0]
        except HeelError as error:
            raise HeelError(f"the network failed: {error}") from None
        boxes, scores = people(output, self._head, self.width, self.height, least_score)
        boxes, scores = sheet.read(boxes, scores)
        kept = without_doubles(boxes, scores)
        return Detections(boxes[kept], scores[kept])

    def _probes(self) -> list[tuple[NDArray[np.uint8], InputForm]]:
        """Pictures of nobody, in both ranges of pixels."""
        shape = (self.height, self.width, 3)
        noise = np.random.default_rng(1).integers(0, 256, shape).astype(np.uint8)
        return [(np.full(shape, PAD_GREY, np.uint8), BYTES_BGR), (noise, UNIT_RGB)]

    def _all(
        self, pixels: NDArray[np.uint8], form: InputForm, names: tuple[str, ...]
    ) -> dict[str, Floats]:
        found = self._engine.run(_blob(pixels, form), names, _LONGEST_PROBE_S)
        return dict(zip(names, found, strict=True))

    def _shorten(self, told: OnnxFile) -> tuple[OnnxFile, Columns]:
        """The file with a network of which no more is left than is read, and the columns left."""
        head = self._head
        boxes = tuple(range(head.people_from))
        columns = (*boxes, *head.people)
        axis = 1 if head.turned else 2
        network, alone = shortened(told.network, head.output, axis, columns)
        if alone:
            self._head = replace(head, people=tuple(range(len(boxes), len(columns))))
        return replace(told, network=network), columns if alone else None

    def _check(self, told: OnnxFile, read: Columns) -> None:
        """Compare with what onnxruntime makes of the file layer by layer, where it is installed.

        Args:
            told: the file.
            read: columns of the output that the network has still; None: all.

        Raises:
            SettingsError: what the engine computes is something else.
        """
        if onnxruntime() is None:
            return
        name = self._head.output
        for pixels, form in self._probes():
            blob = _blob(pixels, form)
            (found,) = self._engine.run(blob, [name], _LONGEST_PROBE_S)
            right = _layer_by_layer(told, blob, name)
            if self._head.is_list:
                off = _difference_of_lists(found, right, self._head)
            elif read is not None:
                off = _difference(found, np.take(right, read, axis=1 if self._head.turned else 2))
            else:
                off = _difference(found, right)
            if off > _TOLERANCE:
                raise SettingsError(
                    f"{self._engine.name} makes other numbers of it than onnxruntime does layer by "
                    f"layer (by {off:.2g}): choose model_engine onnxruntime without "
                    "model_providers, or a network that does not depend on chance"
                )


def _blob(pixels: NDArray[np.uint8], form: InputForm) -> Floats:
    return np.asarray(cv2.dnn.blobFromImage(pixels, form.scale, swapRB=form.rgb), np.float32)


def _layer_by_layer(told: OnnxFile, blob: Floats, output: str) -> Floats:
    """An output as onnxruntime computes it without optimisation."""
    try:
        plain = OnnxRuntime(told.as_given, optimised=False)
        return plain.run(blob, [output], _LONGEST_PROBE_S)[0]
    except HeelError:
        # Padding of its own in a layer with dilation, for one: it is run with it written out.
        plain = OnnxRuntime(told.network, optimised=False)
        return plain.run(blob, [output], _LONGEST_PROBE_S)[0]


def _difference_of_lists(found: Floats, right: Floats, head: Head) -> float:
    """Largest difference of scores in their order; a last digit may decide which boxes are left."""
    ours, theirs = (np.sort(listed_scores(one, head))[::-1] for one in (found, right))
    shared = min(len(ours), len(theirs))
    if abs(len(ours) - len(theirs)) > 1 + _LIST_LENGTH_SHARE * shared:
        return math.inf
    return _difference(ours[:shared], theirs[:shared])


def _difference(found: Floats, right: Floats) -> float:
    """Largest difference, as a share of what is right or of 1; infinite for other shapes or NaN."""
    if found.shape != right.shape:
        return math.inf
    with np.errstate(invalid="ignore", over="ignore"):
        share = np.abs(found - right) / np.maximum(1.0, np.abs(right))
    return float(np.nan_to_num(share, nan=math.inf).max(initial=0.0))


def without_doubles(boxes: Floats, scores: Floats) -> NDArray[np.intp]:
    """Indices of what non-maximum suppression leaves, best first."""
    wide = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
    index = np.flatnonzero(wide & np.isfinite(boxes).all(axis=1))
    if not index.size:
        return index
    corner_size = np.concatenate([boxes[index, :2], boxes[index, 2:] - boxes[index, :2]], axis=1)
    kept = cv2.dnn.NMSBoxes(corner_size.tolist(), scores[index].tolist(), 0.0, _OVERLAP)
    return index[np.asarray(kept, np.intp).ravel()]


@dataclass(frozen=True, slots=True)
class _SheetPlace:
    """Where on the sheet the picture is: upper left corner and size, pixels, and scale."""

    left: int
    top: int
    width: int
    height: int
    scale: float

    def inside(self, centre: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
        """Which of the points (N, 2) lie in it."""
        low = np.array([self.left, self.top])
        high = low + np.array([self.width, self.height])
        return np.asarray(((centre >= low) & (centre < high)).all(axis=1))

    def to_picture(self, boxes: Floats) -> Floats:
        """Boxes (N, 4) of the sheet in pixels of the picture."""
        offset = np.array([self.left, self.top, self.left, self.top], np.float32)
        return (boxes - offset) / np.float32(self.scale)


class Sheet:
    """Lays pictures of one size out on the network's input, and a small copy in the room left.

    A picture that is not of the form of the input leaves part of it free, at the same cost. Small
    networks see those people best that take up a fourth or a third of the input, not those that
    fill it.

    Args:
        input_size: width and height of the input, pixels.
        picture_size: width and height of the pictures, pixels.
    """

    def __init__(self, input_size: tuple[int, int], picture_size: tuple[int, int]) -> None:
        self._input, self._picture = input_size, picture_size
        self._whole = self._placed(0, 0, *input_size)
        self._copy = self._free_place()

    def lay_out(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The network's input, (H, W, 3) uint8 BGR, for a picture of the same form."""
        sheet = np.full((self._input[1], self._input[0], 3), PAD_GREY, np.uint8)
        _put(sheet, picture, self._whole, cv2.INTER_LINEAR)
        if self._copy is not None:
            _put(sheet, picture, self._copy, cv2.INTER_AREA)
        return sheet

    def read(self, boxes: Floats, scores: Floats) -> tuple[Floats, Floats]:
        """Boxes and scores on the sheet as such of the picture, clipped to it.

        Args:
            boxes: (N, 4) xyxy, pixels of the sheet.
            scores: (N,).
        """
        centre = (boxes[:, :2] + boxes[:, 2:]) / 2
        if self._copy is None:
            return self._clipped(self._whole.to_picture(boxes)), scores
        on_copy = self._copy.inside(centre)
        copied = self._copy.to_picture(boxes[on_copy])
        large = copied[:, 3] - copied[:, 1] >= _LARGE_SHARE * self._picture[1]
        on_whole = self._whole.inside(centre)
        found = np.concatenate([self._whole.to_picture(boxes[on_whole]), copied[large]])
        return self._clipped(found), np.concatenate([scores[on_whole], scores[on_copy][large]])

    def _clipped(self, boxes: Floats) -> Floats:
        columns, rows = self._picture
        return clipped(boxes, (columns, rows))

    def _placed(self, left: int, top: int, width: int, height: int) -> _SheetPlace:
        """As large as fits into this room."""
        columns, rows = self._picture
        scale = min(width / columns, height / rows)
        wide = min(width, max(1, round(columns * scale)))
        high = min(height, max(1, round(rows * scale)))
        return _SheetPlace(left, top, wide, high, scale)

    def _free_place(self) -> _SheetPlace | None:
        """Below the picture or beside it; None where too little is free."""
        below, beside = self._whole.height + _GAP_PX, self._whole.width + _GAP_PX
        width, height = self._input
        if height - below >= _LEAST_COPY_SHARE * height:
            return self._placed(0, below, width, height - below)
        if width - beside >= _LEAST_COPY_SHARE * width:
            return self._placed(beside, 0, width - beside, height)
        return None


def _put(
    sheet: NDArray[np.uint8], picture: NDArray[np.uint8], place: _SheetPlace, interpolation: int
) -> None:
    if interpolation == cv2.INTER_AREA:
        picture = _halved(picture, place)
    resized = cv2.resize(picture, (place.width, place.height), interpolation=interpolation)
    sheet[place.top : place.top + place.height, place.left : place.left + place.width] = resized


def _halved(picture: NDArray[np.uint8], place: _SheetPlace) -> NDArray[np.uint8]:
    """Half of a picture that is many times as large as its place."""
    rows, columns = picture.shape[:2]
    large = rows >= _HALVED_FROM * place.height and columns >= _HALVED_FROM * place.width
    if not large or rows % 2 or columns % 2:
        return picture
    half = cv2.resize(picture, (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half, np.uint8)
