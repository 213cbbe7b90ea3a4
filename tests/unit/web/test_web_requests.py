from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heel.services.web.requests import BadRequestError, acknowledged_number, target_request


@pytest.mark.parametrize(
    ("body", "mode"),
    [
        (b'{"mode": "id", "track_id": 7, "tracker": "tracker/main@0123abcd"}', "id"),
        (b'{"mode": "point", "x_px": 3, "y_px": 4.5}', "point"),
        (b'{"mode": "nearest"}', "nearest"),
        (b'{"mode": "none"}', "none"),
    ],
)
def test_reads_every_kind_of_target(body: bytes, mode: str) -> None:
    assert target_request(body).mode == mode


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"\xff\xfe\x00", "not JSON"),
        (b"[" * 4000, "not JSON"),
        (b"[1]", "list instead of an object"),
        (b'{"mode": "id"}', "track_id"),
        (b'{"mode": "id", "track_id": 0}', "track_id"),
        (b'{"mode": "id", "track_id": "7"}', "track_id"),
        (b'{"mode": "id", "track_id": 7, "tracker": "x"}', "tracker"),
        (b'{"mode": "point", "x_px": NaN, "y_px": 1}', "x_px"),
        (b'{"mode": "run"}', "mode"),
        (b'{"mode": "none", "spped": 1}', "'spped'"),
    ],
)
def test_refuses_in_one_line_that_names_the_fault(body: bytes, complaint: str) -> None:
    with pytest.raises(BadRequestError) as caught:
        target_request(body)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=200))
def test_any_bytes_are_a_target_or_one_typed_error(body: bytes) -> None:
    try:
        target_request(body)
    except BadRequestError:
        return


def test_reads_acknowledgements() -> None:
    assert acknowledged_number('{"ack": 12}') == 12


@pytest.mark.parametrize("text", ["", "12", "{}", '{"ack": true}', '{"ack": "1"}', '{"ack": 1.5}'])
def test_refuses_anything_else_from_viewers(text: str) -> None:
    with pytest.raises(BadRequestError):
        acknowledged_number(text)
