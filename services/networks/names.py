"""Names of what runs a network and of what its output means, and names from files; light."""

from __future__ import annotations

from typing import Literal

EngineName = Literal["auto", "onnxruntime", "opencv"]
HeadName = Literal[
    "yolox", "yolox-decoded", "yolov8", "yolov6", "yolov5", "yolov10", "yolov7-nms", "yolox-nms"
]  # fmt: skip


def printable(text: str) -> str:
    """A text from a file on one line, without codes that a terminal would obey."""
    return "".join(one if one.isprintable() else "?" for one in text)
