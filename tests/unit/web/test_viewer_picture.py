from __future__ import annotations

import cv2
import numpy as np
import pytest

from heel.schemas import MessageError
from heel.schemas.image import JPEG, RAW, encode_image, jpeg_size
from heel.services.web.joiner import HeldImage
from heel.services.web.picture import to_jpeg
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


def bomb(width: int, height: int, scans: int = 0) -> HeldImage:
    """A progressive JPEG of some kB that claims a size of its own, and repeats its last scan."""
    pixels = np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8)
    done, coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    assert done
    payload = coded.tobytes()
    frame = payload.index(b"\xff\xc2")
    size = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    payload = payload[: frame + 5] + size + payload[frame + 9 : -2]
    payload += payload[payload.rindex(b"\xff\xda") :][:13] * scans + b"\xff\xd9"
    head = header(0, width=width, height=height).model_copy(update={"image_encoding": JPEG})
    return HeldImage(head, payload, 0.0)


@pytest.mark.parametrize(
    ("width", "height", "scans", "why"),
    [
        (16384, 16384, 0, "pixels"),
        (16384, 2100, 5, "pixels"),
        (64, 64, 40, "scans"),
        (7680, 4320, 40, "scans"),
    ],
)
def test_a_picture_that_would_cost_too_much_is_refused_before_it_is_decoded(
    width: int, height: int, scans: int, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = bomb(width, height, scans)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(MessageError, match=why):
        to_jpeg(picture, 960, 80)


def test_a_jpeg_that_is_cut_off_is_not_passed_on_to_browsers() -> None:
    small = image(320, 240, JPEG)
    with pytest.raises(MessageError, match="cut off"):
        to_jpeg(HeldImage(small.header, small.payload[:-40], 0.0), 640, 80)
