"""Drawn sequences and the evaluation data, for every test of the scores."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Rows = NDArray[np.float64]
Draw = Callable[[int], tuple[Rows, Rows]]

_REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture
def draw_sequence() -> Draw:
    """Makes (ground truth, tracks) of a crowd from a seed, in MOTChallenge columns.

    People come, go, cross and leave gaps; one in eight rows is flagged 0. The tracks miss, jitter,
    swap and change identities, add false boxes and start and end outside the ground truth.
    """
    return _draw


@pytest.fixture
def sequence_dir(request: pytest.FixtureRequest) -> Path:
    """A sequence of the evaluation data, by name (indirect parameter)."""
    root = Path(os.environ.get("HEEL_DATA", _REPOSITORY.parent / "shared" / "data"))
    folder = root / request.param
    if not (folder / "gt" / "gt.txt").is_file():
        pytest.skip(f"no {request.param} in {root} (set HEEL_DATA to the evaluation data)")
    return folder


def _draw(seed: int) -> tuple[Rows, Rows]:
    rng = np.random.default_rng(seed)
    truth: list[list[float]] = []
    tracks: list[list[float]] = []
    next_identity = 100
    for person in range(1, 9):
        start, length = rng.integers(3, 30), rng.integers(5, 40)
        box = np.array([*rng.uniform(0, 120, 2), *rng.uniform(20, 40, 2)])
        velocity = rng.normal(0, 2.5, 2)
        identity = person
        for frame in range(start, start + length):
            box[:2] += velocity
            if rng.random() < 0.1:
                continue
            truth.append([frame, person, *box.round(2), rng.random() > 0.125, -1, -1, -1])
            if rng.random() < 0.06:
                next_identity += 1
                identity = next_identity
            if rng.random() < 0.85:
                seen = box + rng.normal(0, 3.0, 4)
                tracks.append([frame, identity, *seen.round(2), 0.9, -1, -1, -1])
    for false in range(20):
        frame = rng.integers(1, 75)
        box = np.array([*rng.uniform(0, 150, 2), *rng.uniform(20, 40, 2)])
        tracks.append([frame, 500 + false % 4 * 10 + frame, *box.round(2), 0.4, -1, -1, -1])
    return np.array(truth), _without_duplicates(np.array(tracks))


def _without_duplicates(rows: Rows) -> Rows:
    _, first = np.unique(rows[:, :2], axis=0, return_index=True)
    return rows[first]
