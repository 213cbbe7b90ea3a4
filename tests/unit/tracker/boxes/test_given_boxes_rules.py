"""The rules of tracking on given boxes, each on a small scene made of boxes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas.errors import HeelError
from heel.services.tracker.boxes.frame import checked
from heel.services.tracker.boxes.sequence import box_tracker
from heel.services.tracker.report import Report

FPS = 10.0
WIDTH, HEIGHT = 40.0, 100.0
IMAGE = (1000, 600)

Place = tuple[float, float]
Path = Callable[[float], Place | None]


def box(place: Place) -> list[float]:
    """A person's box by the middle of its foot line."""
    return [place[0] - WIDTH / 2, place[1] - HEIGHT, place[0] + WIDTH / 2, place[1]]


def run(paths: list[Path], seconds: float, scores: list[float] | None = None) -> list[
    list[Report]
]:  # fmt: skip
    """Shown tracks of every frame; a path tells where somebody's box is, if there is one."""
    tracker = box_tracker(image_size=IMAGE)
    frames = []
    for index in range(round(seconds * FPS)):
        t_s = index / FPS
        here = [(path(t_s), k) for k, path in enumerate(paths)]
        seen = [(place, k) for place, k in here if place is not None]
        boxes = np.array([box(place) for place, _ in seen]).reshape(-1, 4)
        values = np.array([0.99 if scores is None else scores[k] for _, k in seen])
        frames.append(
            [track for track in tracker.update(checked(boxes, values), t_s) if track.shown]
        )
    return frames


def id_at(tracks: list[Report], place: Place) -> int | None:
    """Who is shown at a place."""
    for track in tracks:
        if np.abs(np.array(track.box_xyxy) - box(place)).max() < 25:
            return track.id
    return None


def walk(start: Place, speed: Place = (0.0, 0.0), hidden: tuple[float, float] = (1e9, 1e9),
         ends: float = 1e9) -> Path:  # fmt: skip
    """A person at constant speed in px/s, without a box in `hidden` and after `ends`."""

    def path(t_s: float) -> Place | None:
        if t_s > ends or hidden[0] <= t_s < hidden[1]:
            return None
        return start[0] + speed[0] * t_s, start[1] + speed[1] * t_s

    return path


@pytest.mark.parametrize(
    ("name", "path", "seconds", "early"),
    [
        ("walks", walk((200, 400), (50, 0)), 6, 1.0),
        ("stands", walk((500, 400)), 6, 1.0),
        ("hidden for half a second", walk((200, 400), (50, 0), (2.0, 2.5)), 6, 1.5),
        ("hidden for two seconds", walk((200, 400), (50, 0), (2.0, 4.0)), 8, 1.5),
        ("stands without a box for 14 s", walk((500, 400), hidden=(3.0, 17.0)), 20, 2.0),
    ],
)
def test_one_person_keeps_one_id(name: str, path: Path, seconds: float, early: float) -> None:
    frames = run([path], seconds)
    first, last = path(early), path(seconds - 1 / FPS)
    assert first is not None
    assert last is not None
    before = id_at(frames[round(early * FPS)], first)
    assert before is not None, name
    assert id_at(frames[-1], last) == before, name


def test_stands_still_undetected_for_14_s_and_is_back_18_px_away() -> None:
    def path(t_s: float) -> Place | None:
        return None if 3 <= t_s < 17 else (500.0 if t_s < 3 else 518.0, 400.0)

    frames = run([path], 20)
    assert id_at(frames[20], (500, 400)) == id_at(frames[-1], (518, 400)) == 1


@pytest.mark.parametrize("speed", [40.0, 80.0])
def test_two_who_cross_keep_their_ids(speed: float) -> None:
    left = walk((300, 400), (speed, 0))
    right = walk((300 + 4 * speed, 415), (-speed, 0))
    frames = run([left, right], 4)
    at = [(path(1.0), path(3.9)) for path in (left, right)]
    for early, late in at:
        assert early is not None
        assert late is not None
        assert id_at(frames[10], early) == id_at(frames[39], late) is not None


def test_one_box_around_two_who_meet_starts_nobody_new() -> None:
    left, right = walk((300, 400), (50, 0)), walk((500, 400), (-50, 0))
    tracker = box_tracker(image_size=IMAGE)
    ids: list[set[int]] = []
    for index in range(40):
        a, b = left(index / FPS), right(index / FPS)
        assert a is not None
        assert b is not None
        boxes = np.array([box(a), box(b)])
        if abs(a[0] - b[0]) < 30:
            boxes = np.concatenate([boxes[:, :2].min(0), boxes[:, 2:].max(0)])[None]
        tracks = tracker.update(checked(boxes, np.full(len(boxes), 0.99)), index / FPS)
        ids.append({track.id for track in tracks if track.shown})
    assert ids[10] == ids[-1] == {1, 2}


def test_who_leaves_at_the_edge_is_not_taken_for_who_enters_there() -> None:
    leaver = walk((820, 400), (80, 0), ends=2.0)

    def enterer(t_s: float) -> Place | None:
        return None if t_s < 4 else (985 - 80 * (t_s - 4), 400)

    frames = run([leaver, enterer], 7)
    place = enterer(6.9)
    assert place is not None
    assert id_at(frames[10], (900, 400)) == 1
    assert id_at(frames[-1], place) == 2


def test_a_second_box_of_the_same_person_is_not_shown() -> None:
    frames = run([walk((300, 400), (40, 0)), walk((306, 403), (40, 0))], 4, [0.99, 0.9])
    assert {track.id for tracks in frames for track in tracks} == {1}


def test_boxes_that_come_once_are_not_shown() -> None:
    rng = np.random.default_rng(4)
    tracker = box_tracker(image_size=IMAGE)
    for index in range(60):
        boxes = np.array([box((float(rng.uniform(50, 950)), float(rng.uniform(150, 550))))])
        tracks = tracker.update(checked(boxes, np.array([0.95])), index / FPS)
        assert not any(track.shown for track in tracks)


@pytest.mark.parametrize("scale", [0.5, 1.0, 30.0])
def test_the_scale_of_a_detectors_scores_does_not_matter(scale: float) -> None:
    person, shadow = walk((300, 400), (50, 0)), walk((700, 400))
    frames = run([person, shadow], 6, [0.98 * scale, 0.5 * scale])
    assert [len(tracks) for tracks in frames[10:]] == [1] * 50
    assert id_at(frames[-1], (595, 400)) == 1


def test_poor_boxes_are_shown_once_they_have_walked() -> None:
    good, poor = walk((100, 300), (50, 0)), walk((700, 500), (-50, 0))
    frames = run([good, poor], 6, [0.98, 0.72])
    assert len(frames[10]) == 1
    assert len(frames[-1]) == 2


def test_a_newcomer_is_not_shown_before_the_third_box() -> None:
    frames = run([walk((500, 400))], 1)
    assert [len(tracks) for tracks in frames[:5]] == [0, 0, 1, 1, 1]


def test_who_is_out_of_sight_is_lost_and_less_sure_on_return() -> None:
    tracker = box_tracker(image_size=IMAGE)
    one, nothing = np.array([box((500, 400))]), np.zeros((0, 4))
    for index in range(10):
        before = tracker.update(checked(one, np.array([0.99])), index / FPS)[0]
    away = tracker.update(checked(nothing, np.zeros(0)), 1.0)[0]
    back = tracker.update(checked(one, np.array([0.99])), 1.5)[0]
    assert (away.state, away.shown, back.state) == ("lost", False, "tracked")
    assert back.id == before.id
    assert back.identity_confidence < before.identity_confidence


@pytest.mark.parametrize(
    ("away_s", "apart", "keeps"), [(0.5, 200.0, True), (0.5, 30.0, False), (0.1, 200.0, True)]
)
def test_a_box_that_may_be_another_ones_starts_a_fresh_id_after_time_out_of_sight(
    away_s: float, apart: float, keeps: bool
) -> None:
    """Two stand side by side, both unseen for a while; then one box comes up between them."""
    tracker = box_tracker(image_size=IMAGE)
    pair = np.array([box((400, 400)), box((400 + apart, 400))])
    for index in range(20):
        tracker.update(checked(pair, np.full(2, 0.99)), index / FPS)
    back_s = 1.9 + away_s
    for index in range(20, round(back_s * FPS)):
        tracker.update(checked(np.zeros((0, 4)), np.zeros(0)), index / FPS)
    middle = np.array([box((400 + (15 if apart < 40 else 0), 400))])
    tracks = tracker.update(checked(middle, np.full(1, 0.99)), back_s)
    seen = [track for track in tracks if track.state == "tracked"]
    assert len(seen) == 1
    assert (seen[0].id in (1, 2)) == keeps


def _broken(value: float) -> NDArray[np.float64]:
    return np.array([[10.0, 10.0, value, 100.0]])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 10.0, 5.0])
def test_what_is_not_a_box_is_refused_with_its_value(value: float) -> None:
    with pytest.raises(HeelError, match="is not a box"):
        box_tracker().update(checked(_broken(value), np.array([0.9])), 0.0)


def test_a_score_that_is_not_finite_is_refused() -> None:
    with pytest.raises(HeelError, match="nan"):
        box_tracker().update(checked(_broken(50.0), np.array([np.nan])), 0.0)


def test_scores_must_be_as_many_as_boxes() -> None:
    with pytest.raises(HeelError, match="one each"):
        box_tracker().update(checked(_broken(50.0), np.array([0.9, 0.8])), 0.0)


def test_time_does_not_run_backwards() -> None:
    tracker = box_tracker()
    tracker.update(checked(_broken(50.0), np.array([0.9])), 1.0)
    with pytest.raises(HeelError, match="sort frames"):
        tracker.update(checked(_broken(50.0), np.array([0.9])), 0.5)
