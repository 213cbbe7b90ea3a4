"""The state of a core as bytes, and back, for the process that goes on where another one ends.

Whatever the listed classes hold is written, so that a new field is kept without a word here; what
is of no listed class is an error of the writer. Bytes may come from anywhere: they make objects of
the listed classes alone, with exactly the fields and the kinds of values that those have, and
anything else is one `StateError`. Nothing of them is ever run.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import msgpack
import numpy as np

from heel.schemas.errors import HeelError

_FORMAT = 1
"""Goes up when the way of writing changes; what is written tells the rest by itself."""
_MAX_DEPTH = 16
"""Of containers in containers; ours have three."""
_MAX_ITEMS = 1_000_000
"""Of one container; chosen by hand."""
_MAX_AXES = 8
"""Of an array; ours have three."""
_ARRAY_KINDS = "biuf"
"""Of numbers and truth values: objects would be pickled."""

R = TypeVar("R")
Maker = Callable[..., Any]


class StateError(HeelError):
    """Bytes that are no state of this core, or a core that cannot be written."""


@dataclass(frozen=True)
class StateClasses:
    """What a state is made of.

    Attributes:
        what: that it is the state of, for messages.
        kept: classes whose fields are the state.
        fixed: classes of which there is one object, made from the settings: the reader keeps its
            own.
        rebuilt: classes that are made anew: the arguments that an object was made with, and what
            makes it from them.
        transient: fields that the next frame makes anew, by class: what they are until then.
        examples: objects of classes whose fields no declaration tells, and that no core just
            begun has.
    """

    what: str
    kept: tuple[type, ...]
    fixed: tuple[type, ...] = ()
    rebuilt: Mapping[type, tuple[Callable[[Any], tuple[Any, ...]], Maker]] = field(
        default_factory=dict
    )
    transient: Mapping[type, Mapping[str, Callable[[], Any]]] = field(default_factory=dict)
    examples: tuple[object, ...] = ()

    @cached_property
    def by_name(self) -> dict[str, type]:
        """The kept classes by their names."""
        return {kind.__name__: kind for kind in self.kept}


def write_state(root: object, classes: StateClasses, settings: str) -> bytes:
    """The state of an object and of all that it refers to.

    Args:
        root: of a kept class.
        classes: of the state.
        settings: what tells the settings that the state rests on from others.

    Raises:
        StateError: there is something in it that no list names.
    """
    writer = _Writer(classes)
    writer.value(root)
    objects = []
    for one in writer.pending:
        left_out = classes.transient.get(type(one), {})
        fields = {name: writer.value(value) for name, value in _fields(one).items()
                  if name not in left_out}  # fmt: skip
        objects.append([type(one).__name__, fields])
    packed: bytes = msgpack.packb(
        {"format": _FORMAT, "what": classes.what, "settings": settings, "objects": objects,
         "arrays": writer.arrays}
    )  # fmt: skip
    return packed


def read_state(data: bytes, root: R, classes: StateClasses, settings: str, max_bytes: int) -> R:
    """The object that a state was written of.

    Args:
        data: from `write_state`.
        root: an object just begun with the same settings: its fixed objects are used, and its
            fields show what a state has to hold. It is not changed.
        classes, settings: as it was written with.
        max_bytes: refused above.

    Raises:
        StateError: it is of other settings or another version, or no such state.
    """
    if len(data) > max_bytes:
        raise StateError(
            f"state of the {classes.what}: {len(data)} bytes exceed the cap of {max_bytes}"
        )
    try:
        unpacked = msgpack.unpackb(
            data, raw=False, strict_map_key=True, max_array_len=_MAX_ITEMS, max_map_len=_MAX_ITEMS
        )
    except Exception as error:
        # msgpack has no common error for bad input, see `heel.schemas.codec`.
        raise StateError(
            f"state of the {classes.what}: not msgpack ({type(error).__name__})"
        ) from None
    if not isinstance(unpacked, dict) or unpacked.get("what") != classes.what:
        raise StateError(f"that is no state of a {classes.what}")
    if unpacked.get("format") != _FORMAT:
        raise StateError(f"state of the {classes.what}: of another version: run matching versions")
    if unpacked.get("settings") != settings:
        raise StateError(
            f"state of the {classes.what}: of other settings: start both with the same ones"
        )
    reader = _Reader(classes, root)
    try:
        return typing.cast("R", reader.read(unpacked.get("objects"), unpacked.get("arrays")))
    except (TypeError, ValueError, KeyError, IndexError, OverflowError, AttributeError) as error:
        raise StateError(f"state of the {classes.what}: {error}: run matching versions") from None


def _fields(one: object) -> dict[str, Any]:
    """All that an object holds, by name."""
    if dataclasses.is_dataclass(one):
        held = {each.name: getattr(one, each.name) for each in dataclasses.fields(one)}
        return held | getattr(one, "__dict__", {})
    return dict(vars(one))


class _Writer:
    """Turns values into what msgpack takes; objects are written once and referred to by number."""

    def __init__(self, classes: StateClasses) -> None:
        self._classes = classes
        self._kept = frozenset(classes.kept)
        self._numbers: dict[int, int] = {}
        self._array_numbers: dict[int, int] = {}
        self._seen_arrays: list[np.ndarray[Any, Any]] = []  # so that no number is given twice
        self.pending: list[object] = []
        self.arrays: list[list[object]] = []

    def value(self, value: Any) -> Any:
        kind = type(value)
        if value is None or kind in (bool, float, str, bytes):
            return value
        if kind is int:
            return value if -(2**63) <= value < 2**63 else ["i", str(value)]
        if kind in (list, tuple, set, frozenset):
            return [kind.__name__[0], *map(self.value, value)]
        if kind is dict:
            return ["d", *([self.value(k), self.value(v)] for k, v in value.items())]
        if kind is deque:
            return ["q", value.maxlen, *map(self.value, value)]
        if isinstance(value, np.ndarray):
            return ["a", self._array(value)]
        if isinstance(value, np.generic):
            return ["n", value.dtype.str, value.tobytes()]
        return self._object(value, kind)

    def _object(self, value: Any, kind: type) -> Any:
        if kind is np.random.Generator:
            return ["g", self.value(value.bit_generator.state)]
        if kind in self._classes.fixed:
            return ["x", kind.__name__]
        if kind in self._classes.rebuilt:
            arguments, _ = self._classes.rebuilt[kind]
            return ["r", kind.__name__, *map(self.value, arguments(value))]
        if kind not in self._kept:
            raise StateError(
                f"state of the {self._classes.what}: {kind.__module__}.{kind.__qualname__} has no "
                "place in it: list the class"
            )
        if id(value) not in self._numbers:
            self._numbers[id(value)] = len(self.pending)
            self.pending.append(value)
        return ["o", self._numbers[id(value)]]

    def _array(self, value: np.ndarray[Any, Any]) -> int:
        # Galleries share their views with copies of themselves: each array is written once.
        number = self._array_numbers.get(id(value))
        if number is None:
            if value.dtype.kind not in _ARRAY_KINDS:
                raise StateError(f"an array of {value.dtype} has no place in a state")
            number = self._array_numbers[id(value)] = len(self.arrays)
            self._seen_arrays.append(value)
            self.arrays.append([value.dtype.str, list(value.shape), value.tobytes()])
        return number


class _Reader:
    """Makes objects from what `_Writer` has made of them."""

    def __init__(self, classes: StateClasses, root: object) -> None:
        self._classes = classes
        self._fixed: dict[str, object] = {}
        self._examples: dict[type, dict[str, Any]] = {
            type(one): _fields(one) for one in classes.examples
        }
        self._collect(root, set())
        self._root = type(root)
        self._objects: list[Any] = []
        self._arrays: list[np.ndarray[Any, Any]] = []

    def _collect(self, value: Any, seen: set[int]) -> None:
        """Find the fixed objects, and one object of each kept class to compare with."""
        if id(value) in seen:
            return
        seen.add(id(value))
        kind = type(value)
        if kind in self._classes.fixed:
            self._fixed[kind.__name__] = value
        elif kind in self._classes.kept:
            held = _fields(value)
            self._examples.setdefault(kind, held)
            for one in held.values():
                self._collect(one, seen)
        elif isinstance(value, list | tuple | deque):
            for one in value:
                self._collect(one, seen)

    def read(self, objects: Any, arrays: Any) -> Any:
        if not isinstance(objects, list) or not isinstance(arrays, list) or not objects:
            raise ValueError("it has no objects")
        self._arrays = [_array(*one) for one in arrays]
        made = []
        for name, fields in objects:
            kind = self._classes.by_name[name]
            self._objects.append(object.__new__(kind))
            made.append((kind, fields))
        if made[0][0] is not self._root:
            raise ValueError(f"it is of a {made[0][0].__name__}, not a {self._root.__name__}")
        for one, (kind, fields) in zip(self._objects, made, strict=True):
            self._fill(one, kind, fields)
        return self._objects[0]

    def _fill(self, one: Any, kind: type, fields: Any) -> None:
        left_out = self._classes.transient.get(kind, {})
        if dataclasses.is_dataclass(kind):
            expected = {each.name for each in dataclasses.fields(kind)}
            expected |= set(self._examples.get(kind, ()))
        elif kind in self._examples:
            expected = set(self._examples[kind])
        else:
            raise ValueError(f"nothing tells the fields of {kind.__name__}")
        expected -= set(left_out)
        if set(fields) != expected:
            odd = sorted(set(fields) ^ expected)[0][:64]
            raise ValueError(f"{kind.__name__}.{odd} is not in both versions")
        for name, packed in fields.items():
            value = self._value(packed, 0)
            if not self._fits(kind, name, value):
                raise ValueError(f"{kind.__name__}.{name} is a {type(value).__name__}")
            object.__setattr__(one, name, value)
        for name, make in left_out.items():
            object.__setattr__(one, name, make())

    def _fits(self, kind: type, name: str, value: Any) -> bool:
        """Whether a field may hold a value, by its declaration, or by that of an example."""
        hint = _hints(kind).get(name)
        if hint is not None:
            return _is_of(value, hint)
        example = self._examples.get(kind, {}).get(name)
        if example is None or value is None:
            return example is None
        if isinstance(example, float | int | np.number) and not isinstance(example, bool):
            return isinstance(value, float | int | np.number) and not isinstance(value, bool)
        if isinstance(example, np.ndarray):
            return isinstance(value, np.ndarray) and value.ndim == example.ndim
        return type(value) is type(example)

    def _value(self, packed: Any, depth: int) -> Any:
        if not isinstance(packed, list):
            if isinstance(packed, dict):
                raise ValueError("a map where none belongs")
            return packed
        if depth > _MAX_DEPTH or not packed:
            raise ValueError("nested too deeply, or empty")
        tag, *rest = packed
        match tag:
            case "i":
                return int(rest[0][:64])
            case "l":
                return [self._value(one, depth + 1) for one in rest]
            case "t":
                return tuple(self._value(one, depth + 1) for one in rest)
            case "s":
                return {self._value(one, depth + 1) for one in rest}
            case "f":
                return frozenset(self._value(one, depth + 1) for one in rest)
            case "d":
                return {self._value(k, depth + 1): self._value(v, depth + 1) for k, v in rest}
            case "q":
                longest, *items = rest
                return deque((self._value(one, depth + 1) for one in items), maxlen=longest)
            case "a":
                return self._arrays[_index(rest[0])]
            case "n":
                return _array(rest[0], [1], rest[1])[0]
            case "o":
                return self._objects[_index(rest[0])]
            case "x":
                return self._fixed[rest[0]]
            case _:
                return self._made(tag, rest, depth)

    def _made(self, tag: str, rest: list[Any], depth: int) -> Any:
        if tag == "g":
            generator = np.random.default_rng(0)
            generator.bit_generator.state = self._value(rest[0], depth + 1)
            return generator
        if tag == "r":
            for kind, (_, make) in self._classes.rebuilt.items():
                if kind.__name__ == rest[0]:
                    return make(*(self._value(one, depth + 1) for one in rest[1:]))
        raise ValueError(f"nothing is known of {str(tag)[:20]!r}")


def _index(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError("a reference that is no number")
    return value


def _array(dtype: str, shape: list[int], data: bytes) -> np.ndarray[Any, Any]:
    kind = np.dtype(dtype)
    if kind.kind not in _ARRAY_KINDS or len(shape) > _MAX_AXES or min(shape, default=0) < 0:
        raise ValueError(f"an array of {str(dtype)[:20]}")
    return np.frombuffer(data, kind).reshape(shape).copy()


_HINTS: dict[type, dict[str, Any]] = {}


def _hints(kind: type) -> dict[str, Any]:
    """The declared types of a data class, by field."""
    if kind not in _HINTS:
        declared = dataclasses.is_dataclass(kind)
        _HINTS[kind] = typing.get_type_hints(kind) if declared else {}
    return _HINTS[kind]


def _is_of(value: Any, hint: Any) -> bool:
    """Whether a value is of a declared type; what is in containers is left to their users."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return any(_is_of(value, one) for one in typing.get_args(hint))
    if origin is typing.Literal:
        return value in typing.get_args(hint)
    if origin is typing.Annotated:
        return _is_of(value, typing.get_args(hint)[0])
    if hint is None or hint is type(None):
        return value is None
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    if hint is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool)
    if hint is float:
        numbers = isinstance(value, float | int | np.floating | np.integer)
        return numbers and not isinstance(value, bool)
    kind = origin or hint
    return isinstance(value, kind) if isinstance(kind, type) else True
