"""Any bytes at all into any decoder: the model, or exactly `MessageError`."""

from __future__ import annotations

import math
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from heel.schemas import (
    MESSAGES,
    Blobs,
    EStop,
    Evidence,
    Health,
    Message,
    MessageError,
    MotionCommand,
    Patch,
    Progress,
    Ranges,
    Stamp,
    Tracks,
    decode,
    encode,
)
from tests.support.generated import msgpack_values, mutated, valid_maps
from tests.unit.schemas.examples import EXAMPLES, golden_bytes

_BY_NAME = pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.schema_name)
_KINDS = st.sampled_from(MESSAGES)
_GOLDEN = {kind: golden_bytes(kind.schema_name) for kind in MESSAGES}
_VALID = {kind: valid_maps(kind.schema_name) for kind in MESSAGES}
_QUICK = settings(
    max_examples=200, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)


def outcome(kind: type[Message], payload: bytes) -> Message | MessageError:
    """The decoder's answer; any other exception fails the test."""
    try:
        return decode(kind, payload)
    except MessageError as refused:
        error = refused
    assert len(str(error)) < 400
    assert "\n" not in str(error)
    return error


def fields_of(example: Message) -> dict[str, Any]:
    fields: dict[str, Any] = msgpack.unpackb(encode(example), use_list=True)
    return fields


@_QUICK
@given(_KINDS, st.binary(max_size=200))
def test_any_bytes_give_the_model_or_a_message_error(kind: type[Message], payload: bytes) -> None:
    outcome(kind, payload)


@_QUICK
@given(_KINDS, msgpack_values(), st.booleans())
def test_any_msgpack_gives_the_model_or_a_message_error(
    kind: type[Message], value: Any, versioned: bool
) -> None:
    if versioned and isinstance(value, dict):
        value = {"v": kind.version, **value}
    outcome(kind, msgpack.packb(value))


@_QUICK
@given(_KINDS, st.integers(0, 60), msgpack_values())
def test_one_field_of_any_value_gives_the_model_or_a_message_error(
    kind: type[Message], which: int, value: Any
) -> None:
    fields = list(kind.model_fields)
    name = fields[which % len(fields)]
    golden = msgpack.unpackb(golden_bytes(kind.schema_name))
    outcome(kind, msgpack.packb(golden | {name: value}))


@_QUICK
@given(_KINDS.flatmap(lambda kind: st.tuples(st.just(kind), mutated(_GOLDEN[kind]))))
def test_mutated_golden_bytes_give_the_model_or_a_message_error(
    drawn: tuple[type[Message], bytes],
) -> None:
    answer = outcome(*drawn)
    if isinstance(answer, Blobs) and answer.evidence is not None:
        unpack(answer.evidence)


@_BY_NAME
def test_every_truncation_of_golden_bytes_is_refused(kind: type[Message]) -> None:
    golden = golden_bytes(kind.schema_name)
    for length in range(len(golden)):
        assert isinstance(outcome(kind, golden[:length]), MessageError)


@_QUICK
@given(_KINDS.flatmap(lambda kind: st.tuples(st.just(kind), _VALID[kind])))
def test_valid_messages_come_back_equal(drawn: tuple[type[Message], dict[str, Any]]) -> None:
    """Whatever the exported schema allows is accepted, and survives a second trip."""
    kind, fields = drawn
    message = decode(kind, msgpack.packb(fields))
    packed = encode(message)
    assert decode(kind, packed) == message
    assert encode(decode(kind, packed)) == packed


@_BY_NAME
def test_the_largest_texts_of_small_messages_fit_the_cap(kind: type[Message]) -> None:
    """A long path with four-byte characters must not stop the message that reports it."""
    example = next(e for e in EXAMPLES if type(e) is kind)
    long_texts = {}
    for name, field in kind.model_fields.items():
        limits = [m.max_length for m in field.metadata if hasattr(m, "max_length")]
        if limits and isinstance(getattr(example, name), str):
            long_texts[name] = "\U0001f600" * limits[0]
    encode(kind.model_validate(example.model_dump() | long_texts))


def unpack(evidence: Evidence) -> None:
    try:
        array = evidence.array()
    except MessageError:
        return
    assert array.shape == (evidence.height, evidence.width)
    assert set(array.ravel().tolist()) <= {0, 1, 2}


@_QUICK
@given(st.integers(1, 40), st.integers(1, 40), st.binary(max_size=100))
def test_any_evidence_bytes_unpack_or_give_a_message_error(
    width: int, height: int, data: bytes
) -> None:
    unpack(Evidence(width=width, height=height, data=data))


@_QUICK
@given(st.integers(-1, 5), st.integers(-1, 5), st.binary(max_size=80))
def test_patches_have_exactly_their_pixels_or_are_refused(
    width: int, height: int, bgr: bytes
) -> None:
    blobs = fields_of(next(e for e in EXAMPLES if isinstance(e, Blobs)))
    blobs["blobs"][0]["patch"] = {"width": width, "height": height, "bgr": bgr}
    answer = outcome(Blobs, msgpack.packb(blobs))
    fits = width > 0 and height > 0 and len(bgr) == width * height * 3
    assert isinstance(answer, Blobs) == fits
    if isinstance(answer, Blobs):
        assert answer.blobs[0].patch.array().shape == (height, width, 3)


@pytest.mark.parametrize(
    "box",
    [(-4.0, 0.0, 1.0, 1.0), (0.0, 0.0, 6.5, 1.0), (0.0, 0.0, 1.0, 1e9), (2.0, 0.0, 1.0, 1.0),
     (1.0, 0.0, 1.0, 1.0), (0.0, 1.0, 1.0, 1.0), (0.0, 2.0, 1.0, 1.0)],
)  # fmt: skip
def test_boxes_far_off_the_frame_or_turned_over_are_refused(box: tuple[float, ...]) -> None:
    blobs = fields_of(next(e for e in EXAMPLES if isinstance(e, Blobs)))
    blobs["blobs"][0]["box_xyxy"] = list(box)
    answer = outcome(Blobs, msgpack.packb(blobs))
    assert isinstance(answer, MessageError)
    assert "is not by a frame 3x2" in str(answer)


def test_patch_pixels_survive_packing() -> None:
    patch = Patch(width=2, height=1, bgr=b"\x01\x02\x03\x04\x05\x06")
    assert Patch.from_array(patch.array()) == patch


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf], ids=str)
def test_nan_and_infinity_are_refused_in_every_number(bad: float) -> None:
    """Also in nested parts: every float of every example is replaced in turn, but for ranges."""
    for example in EXAMPLES:
        for poisoned in _poisoned(fields_of(example), bad):
            answer = outcome(type(example), msgpack.packb(poisoned))
            if isinstance(answer, Ranges):
                odd = [s.distance_m for s in answer.sectors if not math.isfinite(s.distance_m)]
                assert [math.isnan(distance_m) for distance_m in odd] == [math.isnan(bad)]
            else:
                assert isinstance(answer, MessageError)


def test_infinity_and_nan_are_ranges_and_nothing_else_of_a_sector() -> None:
    """REP 117 of ROS: inf is nothing there, -inf too near, nan not measured."""
    for bad in (math.nan, math.inf, -math.inf):
        sector = {"bearing_rad": 0.5, "width_rad": 0.1, "distance_m": bad}
        message = {"v": 1, "seq": 0, "sectors": [sector]}
        assert isinstance(outcome(Ranges, msgpack.packb(message)), Ranges)
        for name in ("bearing_rad", "width_rad"):
            poisoned = message | {"sectors": [sector | {"distance_m": 1.0, name: bad}]}
            assert isinstance(outcome(Ranges, msgpack.packb(poisoned)), MessageError)


def _poisoned(value: Any, bad: float) -> list[Any]:
    if isinstance(value, float):
        return [bad]
    if isinstance(value, dict):
        return [value | {k: p} for k, v in value.items() for p in _poisoned(v, bad)]
    if isinstance(value, list):
        return [
            [*value[:i], p, *value[i + 1 :]] for i, v in enumerate(value) for p in _poisoned(v, bad)
        ]
    return []


@pytest.mark.parametrize(
    ("kind", "change", "named"),
    [
        (Progress, {"v": None}, "version"),
        (Progress, {"v": 2}, "version 2 instead of 1"),
        (Progress, {"v": True}, "v"),
        (Progress, {"v": "1"}, "version of type str"),
        (Progress, {"seq": -1}, "seq"),
        (Progress, {"seq": 2**63}, "seq"),
        (Progress, {"seq": 1.0}, "seq"),
        (Progress, {"seq": True}, "seq"),
        (Progress, {"stream": "Front"}, "stream"),
        (Progress, {"stream": b"front"}, "stream"),
        (Progress, {"stream": "front\n"}, "stream"),
        (Stamp, {"age_ns": 2**63 - 1}, "age_ns"),
        (Stamp, {"producer": "tracker"}, "producer"),
        (EStop, {"engaged": "off"}, "engaged"),
        (EStop, {"engaged": 0}, "engaged"),
        (MotionCommand, {"linear_mps": "1"}, "linear_mps"),
        (MotionCommand, {"linear_mps": True}, "linear_mps"),
        (MotionCommand, {"ttl_s": 0.0}, "ttl_s"),
        (MotionCommand, {"frame": []}, "frame"),
        (Health, {"details": {"key\nwith a line break": 1}}, "details"),
        (Health, {"details": {"k" * 60000: 1}}, "details"),
        (Tracks, {"tracks": {}}, "tracks"),
        (Tracks, {"tracks": [0]}, "tracks.0"),
        (Tracks, {"occlusion": "no"}, "occlusion"),
    ],
)
def test_errors_name_the_message_the_field_and_the_remedy(
    kind: type[Message], change: dict[str, Any], named: str
) -> None:
    example = next(e for e in EXAMPLES if type(e) is kind)
    answer = outcome(kind, msgpack.packb(fields_of(example) | change))
    assert isinstance(answer, MessageError)
    assert str(answer).startswith(f"{kind.schema_name}: ")
    assert named in str(answer)
    assert "see `heel schema" in str(answer) or "matching versions" in str(answer)


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\xc0", b"\x90", b"\x01", b"\x80\x80"])
def test_what_is_not_one_map_is_refused(payload: bytes) -> None:
    assert isinstance(outcome(Progress, payload), MessageError)


def test_unknown_keys_are_ignored_so_that_newer_senders_can_add_some() -> None:
    example = next(e for e in EXAMPLES if isinstance(e, Progress))
    later = msgpack.packb(fields_of(example) | {"added_in_2030": [1, {"x": 2}]})
    assert decode(Progress, later) == example


@pytest.mark.parametrize(
    "encoding",
    ["", "application/x-msgpack", "application/x-msgpack;progress.v2", "image/jpeg", "x" * 10**6],
    ids=["none", "no schema", "version", "other", "huge"],
)
def test_wrong_encodings_are_refused_and_named(encoding: str) -> None:
    with pytest.raises(MessageError, match=r"progress: encoding .* instead of .*progress\.v1") as e:
        decode(Progress, golden_bytes("progress"), encoding)
    assert len(str(e.value)) < 300


def test_messages_over_their_cap_are_neither_sent_nor_unpacked() -> None:
    example = next(e for e in EXAMPLES if isinstance(e, Health))
    huge = example.model_copy(update={"details": {"x": "y" * Health.max_bytes}})
    with pytest.raises(MessageError, match="exceeds its cap of 65536"):
        encode(huge)
    with pytest.raises(MessageError, match="exceed the cap of 65536"):
        decode(Health, bytes(Health.max_bytes + 1))
