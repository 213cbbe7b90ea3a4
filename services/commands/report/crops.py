"""The target cut out of pictures: of a run's film or source, or of a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Header, MessageError, decode
from heel.schemas.errors import HeelError
from heel.schemas.image import decode_image
from heel.services.capture.numbered_pictures import pictures_by_number
from heel.services.commands.report.facts import Box, Crop, Sighting
from heel.services.recordings.reading import Recording, wire_messages

_HEIGHT_PX = 184
"""Most height of a crop: twice what the page gives it, for sharp screens."""
_MOST_WIDTH_PX = 168
"""The same of its width."""
_AROUND = 0.15
"""Of the box's size that is shown around it; chosen by hand."""
_QUALITY = 80
"""Of the JPEG; 24 crops then add some 200 kB to the page."""

Image = NDArray[np.uint8]


def of_recording(path: Path, wanted: Sequence[Sighting]) -> list[Crop]:
    """Cut from the pictures in a recording; sightings without one are left out.

    Raises:
        SourceError: the file cannot be read.
    """
    left = {one.frame: one for one in wanted}
    found: list[Crop] = []
    for message in wire_messages(Recording(path)):
        if not left:
            break
        if not message.encoding.startswith("image/"):
            continue
        try:
            header = decode(Header, message.attachment or b"")
            sighting = left.get((header.epoch, header.seq))
            if sighting is None:
                continue
            image = decode_image(message.payload, header, message.encoding)
        except MessageError:
            continue
        del left[sighting.frame]
        found += _cut(image, sighting)
    return sorted(found, key=lambda one: one.t_s)


def of_pictures(path: Path, wanted: Sequence[Sighting], note: Callable[[str], None]) -> list[Crop]:
    """Cut from a video, a folder of pictures or a film of a run, by the numbers of frames.

    Args:
        path: as `heel run` takes it.
        wanted: by time.
        note: told in words what is missing.
    """
    found: list[Crop] = []
    try:
        picture = pictures_by_number(path)
        for sighting in wanted:
            found += _cut(picture(sighting.frame[1]), sighting)
    except HeelError as error:
        note(f"pictures of the target are missing: {error}")
    return found


def _cut(image: Image, sighting: Sighting) -> list[Crop]:
    """One crop, or none where the box lies outside of the picture."""
    rows, columns = image.shape[:2]
    width, height = sighting.size or (columns, rows)
    left, top, right, bottom = _wider(sighting.box)
    x0, x1 = (round(min(max(x * columns / width, 0), columns)) for x in (left, right))
    y0, y1 = (round(min(max(y * rows / height, 0), rows)) for y in (top, bottom))
    part = image[y0:y1, x0:x1]
    if not part.size:
        return []
    scale = min(_HEIGHT_PX / part.shape[0], _MOST_WIDTH_PX / part.shape[1])
    size = max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale))
    shrunk = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", shrunk, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return [Crop(sighting.t_s, sighting.track_id, sighting.state, jpeg.tobytes())]


def _wider(box: Box) -> Box:
    left, top, right, bottom = box
    x, y = _AROUND * (right - left), _AROUND * (bottom - top)
    return left - x, top - y, right + x, bottom + y
