"""An image message to a JPEG of bounded size for viewers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import MessageError
from heel.schemas.image import JPEG, RAW, check_jpeg, decode_image, encode_image
from heel.services.web.joiner import HeldImage

# Factors by which a JPEG can be decoded smaller, the greatest first.
_REDUCED = (
    (8, cv2.IMREAD_REDUCED_COLOR_8),
    (4, cv2.IMREAD_REDUCED_COLOR_4),
    (2, cv2.IMREAD_REDUCED_COLOR_2),
)


def to_jpeg(image: HeldImage, max_side_px: int, quality: int) -> bytes:
    """Code an image for viewers; a JPEG that is small enough passes as it is.

    Args:
        image: raw or JPEG pixels with their header.
        max_side_px: larger images are scaled to this longer side.
        quality: JPEG quality, 10 to 100.

    Raises:
        MessageError: the payload contradicts the header or cannot be decoded.
    """
    header = image.header
    fits = max(header.width, header.height) <= max_side_px
    if header.image_encoding == JPEG:
        # Those that pass as they are, too: a browser would have to decode them.
        check_jpeg(image.payload, header.width, header.height)
        if fits:
            return image.payload
        pixels = _decode_reduced(image, max_side_px)
    else:
        pixels = decode_image(image.payload, header, RAW)
    return encode_image(_fit(pixels, max_side_px), JPEG, quality)


def _decode_reduced(image: HeldImage, max_side_px: int) -> NDArray[np.uint8]:
    # The decoder itself shrinks by 2, 4 or 8: an 8K picture would otherwise unpack to 100 MB.
    longer = max(image.header.width, image.header.height)
    flag = next((f for by, f in _REDUCED if longer // by >= max_side_px), cv2.IMREAD_COLOR_BGR)
    try:
        pixels = cv2.imdecode(np.frombuffer(image.payload, np.uint8), flag)
    except cv2.error:
        pixels = None
    if pixels is None:
        raise MessageError(f"image: {len(image.payload)} bytes are not a readable JPEG")
    return np.asarray(pixels, np.uint8)


def _fit(pixels: NDArray[np.uint8], max_side_px: int) -> NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    scale = max_side_px / max(height, width)
    if scale >= 1.0:
        return pixels
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
