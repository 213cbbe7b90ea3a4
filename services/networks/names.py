"""Names by which users choose what runs a network and what its output means; light to import."""

from __future__ import annotations

from typing import Literal

EngineName = Literal["auto", "onnxruntime", "opencv"]
HeadName = Literal[
    "yolox", "yolox-decoded", "yolov8", "yolov6", "yolov5", "yolov10", "yolov7-nms", "yolox-nms"
]  # fmt: skip
