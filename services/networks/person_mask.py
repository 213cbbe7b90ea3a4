"""Which pixels of a picture are a person: MediaPipe's selfie segmentation, 250 kB.

It knows no instances: of two people that touch it makes one mask.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError, SettingsError
from heel.services.networks.engines import Floats, one_line
from heel.services.networks.person_model import PAD_GREY

SHA256 = "9ee168ec7c8f2a16c56fe8e1cfbc514974cbbb7e434051b455635f1bd1462f5c"
"""Of the one file that is read: OpenCV computes other TensorFlow Lite files wrongly without a word,
those with a stride of 2 over an even size; of this one it was compared with their own runtime."""
_FILE_BYTES = 249_505
"""Its length: other files are not read whole."""
SIDE_PX = 256
"""Of the network's square input."""


class PersonMask:
    """The network, ready to run on one thread; 11 ms a picture.

    Usage:
        mask = PersonMask(Path("selfie_segmentation.tflite")).of(image)
    """

    def __init__(self, file: Path) -> None:
        """Load it.

        Raises:
            SettingsError: the file is missing, or another one.
        """
        if not file.is_file():
            raise SettingsError(f"person mask {file}: no such file")
        size = file.stat().st_size
        content = file.read_bytes() if size == _FILE_BYTES else b""
        if hashlib.sha256(content).hexdigest() != SHA256:
            raise SettingsError(
                f"person mask {file}: not the selfie_segmentation.tflite of {_FILE_BYTES} bytes "
                f"with the SHA-256 {SHA256[:12]}..., the one that is read: damaged, or another "
                "network; get it again"
            )
        try:
            with one_line():
                self._network = cv2.dnn.readNetFromTFLite(np.frombuffer(content, np.uint8))
        except HeelError as error:
            raise SettingsError(f"person mask {file}: OpenCV cannot read it ({error})") from None

    def of(self, image: NDArray[np.uint8]) -> Floats:
        """How far each pixel of a (H, W, 3) uint8 BGR picture is a person: (H, W) in [0, 1].

        Raises:
            HeelError: OpenCV failed on this picture.
        """
        height, width = image.shape[:2]
        scale = SIDE_PX / max(height, width)
        # Not stretched: of boxes of people, which are narrow, it would find a sixth of the person.
        rows, columns = max(1, round(height * scale)), max(1, round(width * scale))
        top, left = (SIDE_PX - rows) // 2, (SIDE_PX - columns) // 2
        square = np.full((SIDE_PX, SIDE_PX, 3), PAD_GREY, np.uint8)
        with one_line():
            inside = (slice(top, top + rows), slice(left, left + columns))
            way = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
            square[inside] = cv2.resize(image, (columns, rows), interpolation=way)
            self._network.setInput(cv2.dnn.blobFromImage(square, 1.0 / 255.0, swapRB=True))
            mask = np.asarray(self._network.forward(), np.float32).reshape(SIDE_PX, SIDE_PX)
            whole = cv2.resize(mask[inside], (width, height), interpolation=cv2.INTER_LINEAR)
        return np.clip(whole, 0.0, 1.0).astype(np.float32, copy=False)
