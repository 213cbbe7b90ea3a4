"""Golden bytes: what went over the wire yesterday is understood today, and sent the same."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import MESSAGES, Header, Message, decode, encode
from heel.schemas.image import JPEG, RAW, decode_image, encode_image
from tests.unit.schemas.examples import (
    EVIDENCE,
    EVIDENCE_ROWS,
    EXAMPLES,
    RAW_PIXELS,
    golden_bytes,
)

_NAMES = [message.schema_name for message in EXAMPLES]


def test_every_message_has_one_example_and_golden_bytes() -> None:
    assert sorted(_NAMES) == sorted(kind.schema_name for kind in MESSAGES)
    assert all(golden_bytes(name) for name in _NAMES)


@pytest.mark.parametrize("expected", EXAMPLES, ids=_NAMES)
def test_golden_bytes_decode_to_the_example_and_encode_to_the_same_bytes(
    expected: Message,
) -> None:
    golden = golden_bytes(expected.schema_name)
    decoded = decode(type(expected), golden, expected.encoding())
    assert decoded == expected
    assert encode(decoded) == golden


@pytest.mark.parametrize("example", EXAMPLES, ids=_NAMES)
def test_examples_fill_every_field_that_has_a_default(example: Message) -> None:
    """A field that golden bytes leave at its default is not pinned by them."""
    optional = {
        name for name, field in type(example).model_fields.items() if not field.is_required()
    }
    not_needed = {"v"} | ({"track_id"} if example.schema_name == "target-request" else set())
    assert optional - not_needed <= example.model_fields_set


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.schema_name)
def test_messages_are_sent_with_the_version_of_their_class(kind: type[Message]) -> None:
    assert kind.model_fields["v"].default == kind.version


def test_evidence_is_two_bit_planes_most_significant_bit_first() -> None:
    assert EVIDENCE.array().tolist() == EVIDENCE_ROWS


def test_golden_raw_image_is_bgr_rows_from_the_top() -> None:
    header = decode(Header, golden_bytes("header"))
    pixels = decode_image(golden_bytes("image-raw"), header, RAW)
    assert pixels.shape == (2, 3, 3)
    assert pixels.tobytes() == RAW_PIXELS
    assert encode_image(pixels, RAW) == golden_bytes("image-raw")


def test_golden_jpeg_decodes_to_its_grey() -> None:
    header = decode(Header, golden_bytes("header")).model_copy(update={"image_encoding": JPEG})
    pixels = decode_image(golden_bytes("image-jpeg"), header, JPEG)
    assert pixels.shape == (2, 3, 3)
    assert np.abs(pixels.astype(int) - 128).max() <= 2
