"""Frozen cameras and the rate of playback, with times given instead of measured."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.capture.backoff import Backoff
from heel.services.capture.frozen import NewsWatch
from heel.services.runtime.pacing import Pacer

A = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)
B = A.copy()
B[5, 7, 1] ^= 1
"""Differs in one sample of a row that the quick comparison does not look at."""


@pytest.mark.parametrize(
    ("frames", "first_came_at"),
    [
        ([(A, 0)], [0]),
        ([(A, 0), (A, 190), (A, 200)], [0, 0, 0]),
        ([(A, 0), (A.copy(), 250)], [0, 0]),
        ([(A, 0), (B, 250)], [0, 250]),
        ([(A, 0), (A, 300), (B, 310), (B, 500), (A, 520)], [0, 0, 310, 310, 520]),
        ([(A, 0), (A[:24], 250)], [0, 250]),
    ],
    ids=["first", "same", "equal copy", "one sample differs", "thaws", "other size"],
)
def test_the_same_bytes_keep_the_time_at_which_they_came_first(
    frames: list[tuple[np.ndarray[tuple[int, int, int], np.dtype[np.uint8]], int]],
    first_came_at: list[int],
) -> None:
    watch = NewsWatch()
    assert [watch.update(image, now_ns) for image, now_ns in frames] == first_came_at


@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_picture_without_contrast_is_nothing_new_whatever_its_noise(level: int) -> None:
    rng = np.random.default_rng(2)
    watch = NewsWatch()
    watch.update(A, 0)
    for now_ns in (40, 80):
        noisy = np.clip(level + rng.normal(0.0, 3.0, A.shape), 0, 255).astype(np.uint8)
        assert watch.update(noisy, now_ns) == 0
    assert watch.update(B, 120) == 120


def test_a_reset_starts_the_count_anew() -> None:
    watch = NewsWatch()
    watch.update(A, 0)
    watch.reset()
    assert watch.update(A, 300) == 300


def test_deadlines_do_not_drift() -> None:
    pacer = Pacer(30.0)
    assert pacer.due_s(0, 100.0) == 100.0
    assert pacer.due_s(108_000, 3700.0) == pytest.approx(3700.0, abs=1e-9)


@pytest.mark.parametrize(
    ("index", "now_s", "delay_s", "behind"),
    [
        (1, 10.00, 0.04, 0),
        (1, 10.03, 0.01, 0),
        (1, 10.04, 0.0, 0),
        (1, 10.07, 0.0, 0),
        (1, 10.08, 0.0, 1),
        (1, 10.50, 0.0, 11),
    ],
)
def test_a_late_player_leaves_out_what_is_overdue(
    index: int, now_s: float, delay_s: float, behind: int
) -> None:
    pacer = Pacer(25.0)
    pacer.due_s(0, 10.0)
    assert pacer.delay_s(index, now_s) == pytest.approx(delay_s)
    assert pacer.frames_behind(index, now_s) == behind


def test_a_player_too_slow_to_catch_up_goes_on_showing_frames() -> None:
    """Each frame takes 0.1 s even if it is left out, and 25 are due a second."""
    pacer, now_s, shown = Pacer(25.0), 10.0, 0
    for index in range(200):
        shown += pacer.frames_behind(index, now_s) == 0
        now_s += 0.1
    assert 20 <= shown <= 80


def test_a_slow_rate_is_no_delay() -> None:
    pacer = Pacer(0.5)
    for index in range(4):
        # Half of the frames are read well before they are due.
        assert pacer.frames_behind(index, 10.0 + 2.0 * index - index % 2) == 0
        assert pacer.due_s(index, 0.0) == pytest.approx(10.0 + 2.0 * index)


def test_after_a_resume_nothing_is_overdue() -> None:
    pacer = Pacer(25.0)
    pacer.due_s(0, 0.0)
    pacer.resume(5, 60.0)
    assert pacer.frames_behind(5, 60.0) == 0
    assert pacer.due_s(6, 60.0) == pytest.approx(60.04)


def test_backoff_doubles_up_to_its_limit() -> None:
    delays = [Backoff().delay_s(attempt) for attempt in (1, 2, 3, 5, 6, 7, 100_000)]
    assert delays == pytest.approx([0.2, 0.4, 0.8, 3.2, 5.0, 5.0, 5.0])
