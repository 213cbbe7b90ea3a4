"""Bytes and hashes of Heel's messages, beside those of ROS itself and of two other libraries."""

import json
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from benchmarks.ros.robots import SHARE
from heel.services.ros2.cdr import Messages
from tests.support.ros_kinds import KINDS

pytest.importorskip("rclpy", reason="no ROS 2 here: make test-ros2 brings it")
from pycdr2 import IdlStruct
from pycdr2.types import float64, int32, uint32

pytestmark = pytest.mark.filterwarnings("default::DeprecationWarning")
MESSAGES = Messages()


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs/msg/Vector3"):
    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs/msg/Twist"):
    linear: Vector3
    angular: Vector3


@dataclass
class Time(IdlStruct, typename="builtin_interfaces/msg/Time"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs/msg/Header"):
    stamp: Time
    frame_id: str


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs/msg/TwistStamped"):
    header: Header
    twist: Twist


def ros_class(kind: str) -> Any:
    package, _, name = kind.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def number(kind: str, random: np.random.Generator) -> Any:
    """One of which no byte is zero, so that zeros in a message are lengths and what fills gaps."""
    if kind == "boolean":
        return True
    if kind == "octet":
        return bytes([random.integers(1, 120)])
    dtype = np.dtype({"float": "float32", "double": "float64"}.get(kind, kind))
    return np.frombuffer(random.integers(1, 120, dtype.itemsize, np.uint8), dtype)[0].item()


def filled(message: Any, random: np.random.Generator) -> None:
    """Put numbers into every field of one of rclpy's messages."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        of = kind.removeprefix("sequence<").partition(">")[0].partition("[")[0]
        if hasattr(value, "get_fields_and_field_types"):
            filled(value, random)
        elif kind == "string":
            setattr(message, name, "x" * int(random.integers(0, 7)))
        elif kind.startswith("sequence") and "/" in of:
            package, name_of = of.split("/")
            parts = [ros_class(f"{package}/msg/{name_of}")() for _ in range(random.integers(1, 3))]
            for part in parts:
                filled(part, random)
            setattr(message, name, parts)
        elif kind.startswith("sequence"):
            setattr(message, name, [number(of, random) for _ in range(random.integers(0, 9))])
        elif kind.endswith("]"):
            setattr(message, name, np.array([number(of, random) for _ in value], value.dtype))
        else:
            setattr(message, name, number(of, random))


def copied(ros: Any, ours: Any) -> None:
    """The same values, field by field, from one of rclpy's messages."""
    for name, kind in ros.get_fields_and_field_types().items():
        value = getattr(ros, name)
        if hasattr(value, "get_fields_and_field_types"):
            copied(value, getattr(ours, name))
        elif kind.startswith("sequence") and "/" in kind:
            package, name_of = kind.removeprefix("sequence<").removesuffix(">").split("/")
            setattr(ours, name, [MESSAGES.empty(f"{package}/msg/{name_of}") for _ in value])
            for one, other in zip(value, getattr(ours, name), strict=True):
                copied(one, other)
        elif kind == "octet":
            setattr(ours, name, value[0])
        elif isinstance(getattr(ours, name), np.ndarray):
            setattr(ours, name, np.array(value, getattr(ours, name).dtype))
        else:
            setattr(ours, name, value)


def same(ros: Any, ours: Any) -> bool:
    for name in ros.get_fields_and_field_types():
        one, other = getattr(ros, name), getattr(ours, name)
        if isinstance(other, list):
            if not all(map(same, one, other)):
                return False
            continue
        one = one[0] if isinstance(one, bytes) else one
        nested = hasattr(one, "get_fields_and_field_types")
        if not (same(one, other) if nested else np.array_equal(np.array(one), np.array(other))):
            return False
    return True


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("kind", KINDS)
def test_bytes_are_those_of_ros(kind: str, seed: int) -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    ros = ros_class(kind)()
    filled(ros, np.random.default_rng(seed))
    theirs = np.frombuffer(serialize_message(ros), np.uint8)
    ours = MESSAGES.empty(kind)
    copied(ros, ours)
    told = np.frombuffer(MESSAGES.encoded(ours), np.uint8)
    assert 0 <= len(theirs) - len(told) < 4, "Fast CDR's length is a multiple of four"
    # Between the fields Fast CDR leaves whatever stood in its memory.
    gaps = told == 0
    assert (told == theirs[: len(told)])[~gaps].all()
    assert deserialize_message(told.tobytes(), ros_class(kind)) == ros
    assert same(ros, MESSAGES.decoded(theirs.tobytes(), kind))


@pytest.mark.parametrize("kind", KINDS)
def test_hashes_are_those_that_the_wheels_ship(kind: str) -> None:
    package, folder, name = kind.split("/")
    told = json.loads((SHARE / package / folder / f"{name}.json").read_text())
    hashes = {one["type_name"]: one["hash_string"] for one in told["type_hashes"]}
    assert MESSAGES.type_hash(kind) == hashes[kind]


def test_a_velocity_has_the_bytes_of_pycdr2() -> None:
    theirs = TwistStamped(
        Header(Time(7, 8), "base_link"), Twist(Vector3(0.5, 0, 0), Vector3(0, 0, -1.0))
    ).serialize()
    ours = MESSAGES.empty("geometry_msgs/msg/TwistStamped")
    ours.header.stamp.sec, ours.header.stamp.nanosec, ours.header.frame_id = 7, 8, "base_link"
    ours.twist.linear.x, ours.twist.angular.z = 0.5, -1.0
    assert MESSAGES.encoded(ours) == theirs
