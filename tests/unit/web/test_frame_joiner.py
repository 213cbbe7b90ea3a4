from __future__ import annotations

from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heel.services.web.joiner import FrameJoiner, Joined
from tests.unit.web.web_builders import TRACKER, held, tracks

Step = tuple[Literal["image", "tracks", "due"], int]


def joiner(max_images: int = 8, max_bytes: int = 10_000) -> FrameJoiner:
    return FrameJoiner(0.4, max_images, max_bytes, max_tracks=8)


def play(target: FrameJoiner, steps: list[Step]) -> list[tuple[int, int | None]]:
    """Feed steps; returns (image seq, tracks seq) of what came out, in order."""
    out: list[Joined] = []
    for what, value in steps:
        if what == "image":
            out += target.add_image(held(value, arrived_s=value * 0.04))
        elif what == "tracks":
            out += target.add_tracks(tracks(value), TRACKER)
        else:
            out += target.due(float(value))
    return [(j.image.header.seq, None if j.tracks is None else j.tracks.seq) for j in out]


@pytest.mark.parametrize(
    ("steps", "shown"),
    [
        pytest.param([("image", 0)], [], id="an image waits for its tracks"),
        pytest.param([("image", 0), ("tracks", 0)], [(0, 0)], id="tracks come later"),
        pytest.param([("tracks", 0), ("image", 0)], [(0, 0)], id="tracks overtake their image"),
        pytest.param(
            [("image", 0), ("image", 1), ("tracks", 1), ("tracks", 0)],
            [(1, 1)],
            id="a frame that was skipped is not shown later",
        ),
        pytest.param([("image", 0), ("tracks", 1)], [], id="other tracks do not fit"),
        pytest.param([("image", 0), ("due", 1)], [(0, None)], id="past the deadline without"),
        pytest.param(
            [("image", 0), ("due", 1), ("tracks", 0)], [(0, None)], id="late tracks are forgotten"
        ),
        pytest.param([("image", 3), ("image", 3), ("tracks", 3)], [(3, 3)], id="a repeated image"),
    ],
)
def test_shows_each_frame_with_its_own_tracks(
    steps: list[Step], shown: list[tuple[int, int | None]]
) -> None:
    assert play(joiner(), steps) == shown


def test_tells_epochs_apart() -> None:
    target = joiner()
    target.add_image(held(5, epoch=1))
    assert target.add_tracks(tracks(5, epoch=2), TRACKER) == []
    (shown,) = target.add_image(held(5, epoch=2))
    assert shown.tracks is not None
    assert (shown.image.header.epoch, shown.tracks.epoch) == (2, 2)


def test_shows_a_restarted_camera_whose_numbers_begin_anew() -> None:
    target = joiner()
    target.add_image(held(500, epoch=1))
    target.add_tracks(tracks(500, epoch=1), TRACKER)
    target.add_image(held(0, epoch=2))
    assert len(target.add_tracks(tracks(0, epoch=2), TRACKER)) == 1


def test_names_the_producer_of_the_ids() -> None:
    target = joiner()
    target.add_image(held(0))
    (shown,) = target.add_tracks(tracks(0), TRACKER)
    assert shown.tracker == TRACKER


@pytest.mark.parametrize(("max_images", "max_bytes"), [(4, 10_000), (100, 40)])
def test_without_a_tracker_memory_is_bounded_and_pictures_go_on(
    max_images: int, max_bytes: int
) -> None:
    target = joiner(max_images, max_bytes)
    shown = [seq for n in range(50) for seq, _ in play(target, [("image", n)])]
    assert target.waiting == 4
    assert shown == list(range(46))


def test_says_when_the_next_image_is_due() -> None:
    target = joiner()
    assert target.next_due_s() is None
    target.add_image(held(0, arrived_s=2.0))
    assert target.next_due_s() == pytest.approx(2.4)
    assert target.due(2.39) == []
    assert len(target.due(2.4)) == 1


def test_counts_what_it_passes_over() -> None:
    target = joiner()
    play(target, [("image", 0), ("image", 1), ("image", 2), ("tracks", 2), ("image", 1)])
    assert target.passed_over == 3


@given(
    st.lists(
        st.tuples(st.sampled_from(["image", "tracks", "due"]), st.integers(0, 12)), max_size=80
    )
)
def test_whatever_the_order_nothing_is_mixed_goes_back_or_grows(steps: list[Step]) -> None:
    target = joiner(max_images=4)
    shown = play(target, steps)
    assert all(of_tracks in (None, of_image) for of_image, of_tracks in shown)
    numbers = [seq for seq, _ in shown]
    assert numbers == sorted(set(numbers))
    assert target.waiting <= 4
