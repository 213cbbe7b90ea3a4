"""A tracker that goes on from another one's snapshot gives its tracks, byte for byte."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial
from itertools import product

import msgpack
import numpy as np
import pytest

from heel.schemas import Blobs, CameraMotion, encode
from heel.services.runtime.state_bytes import (
    StateClasses,
    StateError,
    read_state,
    write_state,
)
from heel.services.tracker.core import Tracker
from heel.services.tracker.evidence.scale import SceneScale
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.state import CLASSES, MAX_BYTES
from heel.services.tracker.trace import Trace
from tests.unit.tracker import drawn_detections as detections
from tests.unit.tracker import drawn_people as people

Frames = Callable[[int], Blobs]


def walked_regions(seq: int) -> Blobs:
    """Two cross, a third comes in late: births, contacts, a scale that is learned."""
    walkers = [
        people.straight(people.RED, 40, 4), people.straight(people.BLUE, 300, -4, row=196),
        people.straight(people.GREEN, -90, 3, row=150),
    ]  # fmt: skip
    return people.blobs_of(walkers, seq)


def walked_boxes(seq: int, motion: CameraMotion | None = None) -> Blobs:
    """Two cross, one is away for a while, one comes forth from behind another."""

    def away(t_s: float) -> tuple[float, float] | None:
        return None if 2.0 <= t_s < 4.6 else (120 + 30 * t_s, 400.0)

    def crossing(t_s: float) -> tuple[float, float] | None:
        return 560 - 60 * t_s, 404.0

    def newcomer(t_s: float) -> tuple[float, float] | None:
        return None if t_s < 1.5 else (560 - 90 * (t_s - 0.5), 400.0)

    drawn = [
        detections.Person(detections.RED, away), detections.Person(detections.GREEN, crossing),
        detections.Person(detections.BLUE, newcomer),
    ]  # fmt: skip
    return detections.message(drawn, seq, 10.0, motion)


def pointed_at(seq: int) -> Blobs:
    blobs = walked_boxes(seq)
    return blobs.model_copy(update={"sought": 1, "blobs": blobs.blobs[:1]})


TURNING = CameraMotion(affine=(1.0, 0.0, -2.0, 0.0, 1.0, 0.5), quality=0.9)
SCENES: dict[str, Frames] = {
    "evidence": walked_regions,
    "boxes": walked_boxes,
    "boxes of a moving camera": partial(walked_boxes, motion=TURNING),
    "pointed at": pointed_at,
}


def new_tracker(**settings: object) -> Tracker:
    return Tracker(TrackerSettings.model_validate(settings))


@pytest.mark.parametrize("name", SCENES)
def test_a_tracker_goes_on_from_a_snapshot_as_if_nothing_had_been(name: str) -> None:
    frames, tracker = SCENES[name], new_tracker()
    messages = [frames(seq) for seq in range(60)]
    expected = []
    snapshots = {}
    for seq, blobs in enumerate(messages):
        expected.append(encode(tracker.update(blobs)))
        if seq in (0, 4, 16, 23, 31, 47):
            snapshot = tracker.snapshot()
            assert snapshot is not None
            snapshots[seq] = snapshot
        tracker.settle()
    for seq, snapshot in snapshots.items():
        other = new_tracker()
        other.restore(snapshot)
        assert other.snapshot() == snapshot
        for blobs, wanted in zip(messages[seq + 1 :], expected[seq + 1 :], strict=True):
            assert encode(other.update(blobs)) == wanted, (seq, blobs.seq)
            other.settle()


def some_snapshot(seq: int = 30, **settings: object) -> bytes:
    tracker = new_tracker(**settings)
    for each in range(seq):
        tracker.update(walked_boxes(each))
    snapshot = tracker.snapshot()
    assert snapshot is not None
    return snapshot


def test_there_is_no_snapshot_before_the_first_frame_nor_of_the_published_method() -> None:
    assert new_tracker().snapshot() is None
    paper = new_tracker(preset="paper")
    paper.update(walked_regions(0))
    assert paper.snapshot() is None


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"identify": False}, "other settings"), ({"forget_s": 3.0}, "other settings")],
)
def test_a_snapshot_of_other_settings_is_refused(settings: dict[str, object], words: str) -> None:
    tracker = new_tracker(**settings)
    with pytest.raises(StateError, match=words):
        tracker.restore(some_snapshot())
    assert encode(tracker.update(walked_boxes(0))) == encode(
        new_tracker(**settings).update(walked_boxes(0))
    )


def changed(snapshot: bytes, change: Callable[[dict[str, object]], None]) -> bytes:
    outer = msgpack.unpackb(snapshot)
    state = msgpack.unpackb(outer["state"])
    change(state)
    return bytes(msgpack.packb(outer | {"state": msgpack.packb(state)}))


def fields_of(state: dict[str, object], name: str) -> dict[str, object]:
    objects = state["objects"]
    assert isinstance(objects, list)
    return next(fields for kind, fields in objects if kind == name)


HOSTILE: dict[str, Callable[[dict[str, object]], None]] = {
    "another format": lambda s: s.update(format=2),
    "another core": lambda s: s.update(what="detector"),
    "no objects": lambda s: s.update(objects=[]),
    "an unknown class": lambda s: s.update(objects=[["Popen", {}]]),
    "a field too few": lambda s: fields_of(s, "Track").pop("mean"),  # type: ignore[func-returns-value]
    "a field too many": lambda s: fields_of(s, "Track").update(__class__=1),
    "a text for a number": lambda s: fields_of(s, "Track").update(confidence="sure"),
    "a number for an array": lambda s: fields_of(s, "Track").update(mean=1.0),
    "a text for tracks": lambda s: fields_of(s, "PeopleTracker").update(_tracks="none"),
    "a reference to nowhere": lambda s: fields_of(s, "Track").update(gallery=["o", 10**6]),
    "a reference backwards": lambda s: fields_of(s, "Track").update(gallery=["o", -1]),
    "an array of objects": lambda s: s.update(arrays=[["|O", [1], b"12345678"]]),
    "an array with too few bytes": lambda s: s.update(arrays=[["<f8", [10**9], b""]]),
    "deep nesting": lambda s: fields_of(s, "Track").update(in_front=nested(60)),
    "code": lambda s: fields_of(s, "Track").update(mean=["r", "Canvas", 1, 1, 1e12, 1, 0.37]),
}  # fmt: skip


def nested(depth: int) -> object:
    return ["t", nested(depth - 1)] if depth else 1


@pytest.mark.parametrize("name", HOSTILE)
def test_a_forged_snapshot_is_one_error_and_changes_nothing(name: str) -> None:
    tracker = new_tracker()
    with pytest.raises(StateError):
        tracker.restore(changed(some_snapshot(), HOSTILE[name]))
    assert encode(tracker.update(walked_boxes(0))) == encode(new_tracker().update(walked_boxes(0)))


def test_bytes_of_any_kind_are_one_error() -> None:
    rng, good, tracker = random.Random(1), some_snapshot(12), new_tracker()
    for _ in range(300):
        spoilt = bytearray(good)
        for _ in range(rng.randrange(1, 4)):
            spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
        cut = bytes(spoilt[: rng.choice((len(spoilt), rng.randrange(len(spoilt))))])
        try:
            tracker.restore(cut)
        except StateError:
            continue
    with pytest.raises(StateError):
        tracker.restore(b"")


def test_a_scale_that_is_being_refitted_goes_on_where_it_was() -> None:
    _, evidence = people.draw([people.straight(people.RED, 100, 0)], 1)
    weights = (evidence > 0).astype(np.float32)

    def begun() -> SceneScale:
        scale = SceneScale(people.HEIGHT, 10.0)
        for person, vote in product(range(8), range(20)):
            foot = 80.0 + 15 * person + vote / 4
            scale.add_person(person, foot, people.tall(foot) * (1 + 0.01 * (vote % 5)))
        return scale

    scale, midway = begun(), 0
    for _ in range(40):
        scale.update(weights)
        packed = write_state(scale, CLASSES, "")
        other = read_state(packed, SceneScale(people.HEIGHT, 10.0), CLASSES, "", MAX_BYTES)
        midway += b"Refit" in packed
        scale.update(weights)
        other.update(weights)
        assert write_state(other, CLASSES, "") == write_state(scale, CLASSES, "")
    assert midway > 3


def test_every_class_of_the_list_is_in_the_snapshots_of_these_scenes() -> None:
    found = {"Refit"}
    for frames in SCENES.values():
        tracker = Tracker(TrackerSettings(), trace=Trace(lambda event: None))
        for seq in range(40):
            tracker.update(frames(seq))
            snapshot = tracker.snapshot()
            assert snapshot is not None
            state = msgpack.unpackb(msgpack.unpackb(snapshot)["state"])
            found |= {kind for kind, _ in state["objects"]}
    assert found == set(CLASSES.by_name)


def test_what_no_list_names_is_not_left_out_silently() -> None:
    classes = StateClasses("thing", (Holder,))
    with pytest.raises(StateError, match="has no place in it"):
        write_state(Holder(), classes, "")


class Holder:
    def __init__(self) -> None:
        self.held = object()
