from __future__ import annotations

import numpy as np
import pytest

from schemas import MessageError
from schemas.image import JPEG, RAW, encode_image, jpeg_size
from services.web.joiner import HeldImage
from services.web.picture import to_jpeg
from tests.unit.web.web_builders import header


def image(width: int, height: int, encoding: str) -> HeldImage:
    pixels = np.full((height, width, 3), 90, np.uint8)
    head = header(0, width=width, height=height).model_copy(update={"image_encoding": encoding})
    return HeldImage(head, encode_image(pixels, encoding), 0.0)


@pytest.mark.parametrize(
    ("width", "height", "encoding", "coded"),
    [
        (64, 48, RAW, (64, 48)),
        (1, 1, RAW, (1, 1)),
        (1280, 720, RAW, (640, 360)),
        (360, 1280, RAW, (180, 640)),
        (1280, 720, JPEG, (640, 360)),
        (7680, 4320, JPEG, (640, 360)),
        (16384, 16, JPEG, (640, 1)),
    ],
)
def test_pictures_are_scaled_to_the_longer_side(
    width: int, height: int, encoding: str, coded: tuple[int, int]
) -> None:
    assert jpeg_size(to_jpeg(image(width, height, encoding), 640, 80)) == coded


def test_a_small_jpeg_passes_as_it_is() -> None:
    small = image(320, 240, JPEG)
    assert to_jpeg(small, 640, 80) is small.payload


@pytest.mark.parametrize(
    ("head", "payload"),
    [
        (header(0), b""),
        (header(0), bytes(64 * 48 * 3 - 1)),
        (header(0).model_copy(update={"image_encoding": JPEG}), b"\xff\xd8\xff\xd9"),
        (header(0).model_copy(update={"image_encoding": JPEG}), bytes(100)),
        (header(0).model_copy(update={"image_encoding": JPEG}), image(32, 32, JPEG).payload),
    ],
)
def test_a_payload_that_is_not_the_picture_is_refused(head: object, payload: bytes) -> None:
    with pytest.raises(MessageError):
        to_jpeg(HeldImage(head, payload, 0.0), 640, 80)  # type: ignore[arg-type]
