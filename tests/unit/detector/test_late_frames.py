"""Which frame is learned when, and with whose tracks."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import Tracks
from heel.services.detector.background.learning import LateFrames
from heel.services.detector.feedback import free_mask
from heel.services.detector.scene import WorkSize
from tests.unit.detector.drawn_scene import HEIGHT, WIDTH, Person, frame_id, tracks_of

SIZE = WorkSize.of_frame(WIDTH, HEIGHT, 480)
PERSON: Person = (100, 60, 40, 120)


def learned(seqs: list[int], feedback: list[Tracks | None], lag: int = 2) -> list[list[int | None]]:
    """By step, the frames learned, and then the frame whose tracks protected the last of them."""
    late = LateFrames(SIZE, lag, 0)
    steps = []
    for seq, tracks in zip(seqs, feedback, strict=True):
        due = list(late.due(tracks))
        late.add(frame_id(seq), np.full((1, 1, 3), seq, np.uint8))
        steps.append([int(frame.image[0, 0, 0]) for frame in due])
        if due:
            steps[-1].append(due[-1].protected_seq)
    return steps


@pytest.mark.parametrize(
    ("seqs", "told", "steps"),
    [
        ([0, 1, 2, 3], [None, None, 0, 1], [[], [], [0, 0], [1, 1]]),
        ([0, 3, 6, 9], [None, None, 3, 6], [[], [], [0, 3, 3], [6, 6]]),
        ([0, 1, 2, 3], [None, None, 0, 0], [[], [], [0, 0], []]),
        ([0, 1, 2, 3], [None, 0, None, 1], [[], [0, 0], [], [1, 1]]),
    ],
    ids=["lossless", "frames skipped", "the same tracks again", "tracks missing once"],
)
def test_a_frame_is_learned_with_its_tracks(
    seqs: list[int], told: list[int | None], steps: list[list[int | None]]
) -> None:
    feedback = [None if seq is None else tracks_of(seq, [PERSON]) for seq in told]
    assert learned(seqs, feedback) == steps


@pytest.mark.parametrize("lag", [1, 4])
def test_without_tracks_frames_wait_for_a_bounded_time(lag: int) -> None:
    steps = learned(list(range(20)), [None] * 20, lag)
    assert steps[: lag + 7] == [[]] * (lag + 7)
    assert steps[lag + 7 :] == [[seq, None] for seq in range(13 - lag)]


@pytest.mark.parametrize(("last_seq", "protected"), [(95, 95), (80, None)])
def test_old_tracks_protect_for_a_while(last_seq: int, protected: int | None) -> None:
    seqs = list(range(91, 108))
    steps = learned(seqs, [tracks_of(last_seq, [PERSON])] + [None] * 16)
    assert steps[-1][-1] == protected


@pytest.mark.parametrize(("seq", "x", "free"), [(30, 120, 255), (30, 200, 0), (28, 120, 0)])
def test_protection_moves_with_the_person(seq: int, x: int, free: int) -> None:
    tracks = tracks_of(28, [PERSON], velocity_pxps=(400.0, 0.0))
    assert free_mask(tracks, frame_id(seq), SIZE)[100, x] == free


def test_people_outside_the_picture_are_no_trouble() -> None:
    tracks = tracks_of(3, [(-200, -300, 40, 120), (500, 100, 40, 120), (-10, -10, 400, 300)])
    assert not free_mask(tracks, frame_id(3), SIZE).any()


def test_a_waiting_frame_does_not_teach_what_has_started_over_since() -> None:
    late = LateFrames(SIZE, 2, 0)
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    late.add(frame_id(1), image)
    late.forget(np.array([5, 7]))
    late.add(frame_id(2), image)
    before, after = late.due(tracks_of(2, []))
    assert np.flatnonzero(before.free == 0).tolist() == [5, 7]
    assert after.free.all()
