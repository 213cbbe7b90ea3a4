"""A network in an ONNX file, run by OpenCV: pictures in, people out."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError, SettingsError
from heel.services.detector.neural.heads import (
    BYTES_BGR,
    UNIT_RGB,
    Floats,
    HeadName,
    InputForm,
    people,
    recognise,
)
from heel.services.detector.neural.onnx_file import read_onnx_file
from heel.services.detector.neural.sheet import PAD_GREY, Sheet

_MOST_MEMORY_BYTES = 4 << 30
"""Weights and all layers; the largest YOLO of the families read here takes about 1 GiB."""
_OVERLAP = 0.45
"""Of two boxes that overlap more than this (IoU), the weaker one goes."""


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


@contextmanager
def _opencv_silent() -> Iterator[None]:
    """What is wrong is told once, by us: OpenCV writes its own account to standard error."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


class PersonModel:
    """A detection network; input size, kind of head and person class are read from the file.

    Usage:
        model = PersonModel(Path("yolox_nano.onnx"))
        found = model.detect(image, least_score=0.3)
    """

    def __init__(self, file: Path, person_class: int | None = None) -> None:
        """Load the network and try it.

        Args:
            file: ONNX.
            person_class: which class is a person, where the file does not name its classes.

        Raises:
            SettingsError: the file is missing, is no ONNX network that OpenCV can run, has an
                input or output that is not understood, or finds no people.
        """
        told = read_onnx_file(file)
        self.width, self.height = told.width, told.height
        try:
            with bounded_memory(_MOST_MEMORY_BYTES), _opencv_silent():
                self._network = cv2.dnn.readNetFromONNX(str(file))
                probes = [self._all(probe, form, told.outputs) for probe, form in self._probes()]
        except (MemoryError, cv2.error) as error:
            if isinstance(error, MemoryError) or error.code == cv2.Error.StsNoMem:
                raise SettingsError(
                    f"model {file}: wants more than {_MOST_MEMORY_BYTES >> 30} GiB of memory: "
                    "damaged, or no network for a robot"
                ) from None
            raise SettingsError(
                f"model {file}: OpenCV cannot run it ({_first_line(error)}); export it for "
                "inference, with a batch of one and opset 12 to 17"
            ) from None
        try:
            self._head = recognise(told, probes, person_class)
        except SettingsError as error:
            raise SettingsError(f"model {file}: {error}") from None

    @property
    def head(self) -> HeadName:
        """The kind of its head."""
        return self._head.name

    @property
    def description(self) -> str:
        """What was read from the file, in one line."""
        head = self._head
        boxes = ", boxes as shares of the picture" if head.unit_boxes else ""
        return f"{head.title}, {self.width}x{self.height}{boxes}; people: {head.why}"

    def detect(self, image: NDArray[np.uint8], least_score: float) -> Detections:
        """People in a (H, W, 3) uint8 BGR picture with at least this score.

        Raises:
            HeelError: OpenCV failed on this picture.
        """
        rows, columns = image.shape[:2]
        sheet = Sheet((self.width, self.height), (columns, rows))
        try:
            output = self._run(sheet.lay_out(image), self._head.form, self._head.output)
        except cv2.error as error:
            raise HeelError(f"the network failed: {_first_line(error)}") from None
        boxes, scores = people(output, self._head, self.width, self.height)
        good = np.flatnonzero(scores >= least_score)
        boxes, scores = sheet.read(boxes[good], scores[good])
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
        self._show(pixels, form)
        found = self._network.forward(list(names))
        return {name: np.asarray(one, np.float32) for name, one in zip(names, found, strict=True)}

    def _run(self, pixels: NDArray[np.uint8], form: InputForm, output: str) -> Floats:
        self._show(pixels, form)
        return np.asarray(self._network.forward(output), np.float32)

    def _show(self, pixels: NDArray[np.uint8], form: InputForm) -> None:
        self._network.setInput(cv2.dnn.blobFromImage(pixels, form.scale, swapRB=form.rgb))


def without_doubles(boxes: Floats, scores: Floats) -> NDArray[np.intp]:
    """Indices of what non-maximum suppression leaves, best first."""
    wide = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
    index = np.flatnonzero(wide & np.isfinite(boxes).all(axis=1))
    if not index.size:
        return index
    corner_size = np.concatenate([boxes[index, :2], boxes[index, 2:] - boxes[index, :2]], axis=1)
    kept = cv2.dnn.NMSBoxes(corner_size.tolist(), scores[index].tolist(), 0.0, _OVERLAP)
    return index[np.asarray(kept, np.intp).ravel()]


def _first_line(error: cv2.error) -> str:
    return str(error).strip().splitlines()[0][:200]
