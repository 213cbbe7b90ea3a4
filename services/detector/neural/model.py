"""A network in an ONNX file, run by OpenCV: pictures in, people out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas.errors import HeelError, SettingsError
from services.detector.neural.heads import FORMS, Floats, InputForm, people, recognise
from services.detector.neural.sheet import PAD_GREY, Sheet

_OVERLAP = 0.45
"""Of two boxes that overlap more than this (IoU), the weaker one goes."""
_MOST_SIDE_PX = 2048


@dataclass(frozen=True, eq=False)
class Detections:
    """People in one picture.

    Attributes:
        boxes: (N, 4) float32 xyxy, pixels of the picture, clipped to it, best first.
        scores: (N,) float32 in [0, 1].
    """

    boxes: Floats
    scores: Floats


class PersonModel:
    """A detection network, its input size and its kind of head read from the file.

    Usage:
        model = PersonModel(Path("yolox_nano.onnx"))
        found = model.detect(image, least_score=0.3)
    """

    def __init__(self, file: Path) -> None:
        """Load the network and try it once.

        Raises:
            SettingsError: the file is missing, is no ONNX network that OpenCV can run, or has
                an input or output that is not understood.
        """
        if not file.is_file():
            raise SettingsError(f"model {file}: no such file; give the path of an ONNX network")
        self.width, self.height = _input_size(file)
        try:
            self._network = cv2.dnn.readNetFromONNX(str(file))
            blank = np.full((self.height, self.width, 3), PAD_GREY, np.uint8)
            probe = self._run(blank, InputForm(1.0, False))
        except cv2.error as error:
            raise SettingsError(
                f"model {file}: OpenCV cannot run it ({_first_line(error)}); export it for "
                "inference, with a batch of one"
            ) from None
        try:
            self.head = recognise(probe, self.width, self.height)
        except SettingsError as error:
            raise SettingsError(f"model {file}: {error}") from None
        self._form = FORMS[self.head]

    def detect(self, image: NDArray[np.uint8], least_score: float) -> Detections:
        """People in a (H, W, 3) uint8 BGR picture with at least this score.

        Raises:
            HeelError: OpenCV failed on this picture.
        """
        rows, columns = image.shape[:2]
        sheet = Sheet((self.width, self.height), (columns, rows))
        try:
            output = self._run(sheet.lay_out(image), self._form)
        except cv2.error as error:
            raise HeelError(f"the network failed: {_first_line(error)}") from None
        boxes, scores = people(output, self.head, self.width, self.height)
        good = np.flatnonzero(scores >= least_score)
        boxes, scores = sheet.read(boxes[good], scores[good])
        kept = without_doubles(boxes, scores)
        return Detections(boxes[kept], scores[kept])

    def _run(self, pixels: NDArray[np.uint8], form: InputForm) -> Floats:
        self._network.setInput(cv2.dnn.blobFromImage(pixels, form.scale, swapRB=form.rgb))
        return np.asarray(self._network.forward(), np.float32)


def _input_size(file: Path) -> tuple[int, int]:
    """Width and height from the file itself."""
    try:
        import onnx
        from google.protobuf.message import DecodeError
    except ImportError:
        raise SettingsError(
            f"model {file}: reading a network needs the extra `neural`: "
            "pip install 'heel-follow[neural]'"
        ) from None
    try:
        graph = onnx.load(str(file), load_external_data=False).graph
    except (DecodeError, OSError, ValueError) as error:
        raise SettingsError(f"model {file}: not an ONNX network ({error})") from None
    weights = {weight.name for weight in graph.initializer}
    inputs = [entry for entry in graph.input if entry.name not in weights]
    sides = [d.dim_value for d in inputs[0].type.tensor_type.shape.dim] if inputs else []
    if len(inputs) != 1 or len(sides) != 4 or sides[1] != 3:
        raise SettingsError(
            f"model {file}: wants {len(inputs)} inputs of {sides}; give a network that takes one "
            "picture, 1x3xHEIGHTxWIDTH"
        )
    height, width = sides[2:]
    if not (0 < width <= _MOST_SIDE_PX and 0 < height <= _MOST_SIDE_PX):
        raise SettingsError(
            f"model {file}: input of {width}x{height} pixels; export it with a fixed input size "
            f"of 32 to {_MOST_SIDE_PX}"
        )
    return width, height


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
