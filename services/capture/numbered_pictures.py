"""The pictures of a recording by the frame numbers of its ground truth, which count from 1."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import SourceError
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.image_folder import ImageFolderSource, list_images
from heel.services.capture.source import Frame
from heel.services.capture.sources import open_source
from heel.services.sequence_file import sequence_file


def pictures_by_number(path: Path) -> Callable[[int], NDArray[np.uint8]]:
    """Read the pictures of a folder, a sequence or a video, in rising order.

    Args:
        path: read as `heel run` reads it, but that a folder of pictures counts from 1 even if
            number 1 is not there, as ground truth does.

    Returns:
        A function of the frame number, never lower than before, that gives (H, W, 3) uint8 BGR
        and raises SourceError where there is no such picture.

    Raises:
        SourceError: there is nothing that can be read.
    """
    is_plain_folder = path.is_dir() and sequence_file(path) is None
    source = (
        ImageFolderSource(list_images(path), shown_path(path), first_number=1)
        if is_plain_folder
        else open_source(str(path))
    )
    newest: Frame | None = None

    def read(number: int) -> NDArray[np.uint8]:
        nonlocal newest
        while newest is None or newest.index + 1 < number:
            following = source.read()
            if following is None:
                break
            newest = following
        if newest is None or newest.index + 1 != number:
            raise SourceError(
                f"{source.name}: no picture of frame {number}; check --frames or leave it out"
            )
        return newest.image

    return read
