"""The mixture on drawn scenes: who melts, who leaves ghosts, what the light does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs
from heel.schemas.blobs import FOREGROUND, MOVING, NONE, SHADOW
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import (
    FPS,
    HEIGHT,
    WIDTH,
    Person,
    background,
    frame_id,
    frame_image,
    tracks_of,
)

SIZE = (WIDTH, HEIGHT)
MIXTURE = DetectorSettings(detector="mixture")
PERSON: Person = (100, 60, 40, 120)
LEARNED = 45
Evidence = NDArray[np.uint8]


def evidence_of(message: Blobs) -> Evidence:
    assert message.evidence is not None
    return message.evidence.array()


def under(person: Person, evidence: Evidence) -> Evidence:
    """The evidence well inside a person's box."""
    left, top, width, height = person
    return evidence[top + 6 : top + height - 6, left + 6 : left + width - 6]


def play(
    images: Iterable[NDArray[np.uint8]], settings: DetectorSettings | None = None
) -> list[Evidence]:
    detector = Detector(settings or MIXTURE)
    return [
        evidence_of(detector.detect(frame_id(seq), image, SIZE, None))
        for seq, image in enumerate(images)
    ]


def clothed(left: int) -> NDArray[np.uint8]:
    """Somebody of PERSON's size in bright and dark clothes, `left` pixels from the left."""
    image = background()
    pattern = np.random.default_rng(3).choice(np.array([20, 60, 200, 240], np.uint8), (30, 10))
    image[60:180, left : left + 40] = np.kron(pattern, np.ones((4, 4), np.uint8))[..., None]
    return image


def scene(seconds: float, image: NDArray[np.uint8] | None = None) -> list[NDArray[np.uint8]]:
    return [background() if image is None else image] * round(seconds * FPS)


@pytest.mark.parametrize(
    ("track", "settings", "seen"),
    [
        ({}, {}, True),
        ({"state": "occluded"}, {}, True),
        ({"state": "lost", "shown": False}, {}, True),
        ({"state": "new"}, {}, False),
        ({}, {"protect": False}, False),
    ],
    ids=str,
)
def test_confirmed_people_who_stand_still_do_not_melt(
    track: dict[str, object], settings: dict[str, object], seen: bool
) -> None:
    detector = Detector(DetectorSettings.model_validate(settings))
    for seq in range(LEARNED):
        detector.detect(frame_id(seq), background(), SIZE, None)
    for seq in range(LEARNED, LEARNED + 15 * FPS):
        feedback = tracks_of(seq - 2, [PERSON], **track) if seq > LEARNED + 1 else None
        message = detector.detect(frame_id(seq), frame_image([PERSON]), SIZE, feedback)
    assert (under(PERSON, evidence_of(message)) == FOREGROUND).mean() == (1.0 if seen else 0.0)


@pytest.mark.parametrize(("dissolve", "left_s"), [(True, 1.0), (False, 1.0), (False, 12.0)])
def test_the_hole_of_a_person_who_was_there_from_the_start_dissolves(
    dissolve: bool, left_s: float
) -> None:
    images = scene(5, clothed(100)) + scene(left_s)
    seen = play(images, DetectorSettings(detector="mixture", dissolve_ghosts=dissolve))[-1]
    gone = dissolve or left_s > 10
    assert bool((under(PERSON, seen) >= FOREGROUND).mean() < 0.1) is gone


def test_a_ghost_dissolves_although_a_track_protects_it() -> None:
    detector = Detector(MIXTURE)
    images = scene(5, clothed(100)) + scene(1)
    for seq, image in enumerate(images):
        feedback = tracks_of(seq - 2, [PERSON]) if seq > 5 * FPS else None
        message = detector.detect(frame_id(seq), image, SIZE, feedback)
    assert (evidence_of(message) >= FOREGROUND).sum() == 0


def test_a_person_at_rest_is_no_ghost() -> None:
    seen = play(scene(5) + scene(2, clothed(100)))[-1]
    assert (under(PERSON, seen) == FOREGROUND).all()


@pytest.mark.parametrize(
    ("share", "tint", "label"),
    [(0.8, 0, SHADOW), (0.99, 0, NONE), (0.5, 0, FOREGROUND), (0.8, 40, FOREGROUND)],
    ids=["shadow", "too light to see", "too dark for a shadow", "another colour"],
)
def test_tells_shadow_from_foreground(share: float, tint: int, label: int) -> None:
    image = background().astype(np.float64)
    image[60:180, 100:140] *= share
    image[60:180, 100:140, 2] += tint
    seen = play([*scene(5), *scene(1, image.astype(np.uint8))])[-1]
    assert (under(PERSON, seen) == label).mean() > 0.9


@pytest.mark.parametrize(
    ("light", "after_s"),
    [(lambda t_s: 60 * (t_s > 1), 12.0), (lambda t_s: 0.8 * t_s, 20.0)],
    ids=["sudden", "slow"],
)
def test_follows_the_light(light: Callable[[float], float], after_s: float) -> None:
    steps = np.arange(0, after_s, 1 / FPS)
    changing = [np.clip(background() + light(t_s), 0, 255).astype(np.uint8) for t_s in steps]
    assert (play(scene(5) + changing)[-1] >= FOREGROUND).mean() < 0.01


@pytest.mark.parametrize("start", [20, 100], ids=str)
def test_sees_whoever_walks_in_view_from_the_first_frame(start: int) -> None:
    path: list[Person] = [(start + 6 * step, 60, 40, 120) for step in range(25)]
    seen = play(clothed(person[0]) for person in path)
    for step in (5, 15, 24):
        assert (under(path[step], seen[step]) >= FOREGROUND).mean() > 0.9
        others = seen[step].copy()
        others[:, max(0, path[step][0] - 12) : path[step][0] + 52] = NONE
        assert (others >= FOREGROUND).mean() < 0.02, "a ghost stayed where the walk began"


def test_only_who_moves_is_moving() -> None:
    walking: list[Person] = [(40 + 8 * step, 60, 40, 120) for step in range(10)]
    standing: Person = (220, 80, 30, 100)
    seen = play(scene(5) + [frame_image([person, standing]) for person in walking])[-1]
    assert (seen[66:174, walking[-1][0] + 36 : walking[-1][0] + 39] == MOVING).mean() > 0.9
    assert (under(standing, seen) == FOREGROUND).all()


@cache
def walk_with_feedback(lag: int, skip: int = 0, every: int = 1) -> list[Evidence]:
    """A person who walks in, stands and walks on; feedback is the truth, `lag` frames late."""
    x = [*range(-40, 140, 6), *[140] * 40, *range(140, 300, 6)]
    detector, seen = Detector(DetectorSettings(detector="mixture", feedback_lag_frames=lag)), []
    for seq, left in enumerate([None] * LEARNED + x):
        people: list[Person] = [] if left is None else [(max(0, left), 60, 40, 120)]
        told = (seq - lag) // every * every - LEARNED
        box: list[Person] = [(max(0, x[told]), 60, 40, 120)] if told >= 0 else []
        feedback = tracks_of(told + LEARNED, box) if told >= -LEARNED else None
        if not skip or seq % skip:
            message = detector.detect(frame_id(seq), frame_image(people), SIZE, feedback)
            seen.append(evidence_of(message))
    return seen


@pytest.mark.parametrize("lag", [1, 3, 4])
def test_the_lag_of_the_feedback_hardly_matters(lag: int) -> None:
    wanted, seen = walk_with_feedback(2), walk_with_feedback(lag)
    differing = [float((a != b).mean()) for a, b in zip(wanted, seen, strict=True)]
    assert max(differing) < 0.005


@pytest.mark.parametrize(("skip", "every"), [(3, 1), (4, 2), (0, 6)], ids=str)
def test_a_live_stream_with_gaps_protects_all_the_same(skip: int, every: int) -> None:
    """Frames are missing, and so are tracks: the newest come again and again."""
    seen = walk_with_feedback(2, skip, every)
    standing: Person = (140, 60, 40, 120)
    at_rest = seen[-40 * (skip - 1) // skip if skip else -40]
    assert (under(standing, at_rest) >= FOREGROUND).mean() > 0.95
