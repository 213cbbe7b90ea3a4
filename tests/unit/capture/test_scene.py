"""The drawn scene: the same from run to run, with a truth that matches its pixels."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from heel.services.capture.scene import Scene, SceneSettings, Truth


@pytest.fixture(scope="module")
def demo() -> Scene:
    return Scene(SceneSettings(noise=0.0))


@pytest.fixture(scope="module")
def crossing() -> Scene:
    return Scene(SceneSettings(name="crossing", noise=0.0))


def rows(scene: Scene, person_id: int) -> dict[int, Truth]:
    """Frame index to truth of one person, over one pass, every fifth frame."""
    return {
        index: row for index, found in sampled(scene) for row in found if row.person_id == person_id
    }


@cache
def sampled(scene: Scene) -> list[tuple[int, list[Truth]]]:
    return [(index, scene.truth(index)) for index in range(0, scene.frame_count, 5)]


def centre_x(row: Truth) -> float:
    return (row.box_xyxy[0] + row.box_xyxy[2]) / 2


@pytest.mark.parametrize("name", ["demo", "crossing", "pacing", "empty"])
def test_a_frame_depends_on_settings_and_index_only(name: str) -> None:
    settings = SceneSettings.model_validate({"name": name, "width": 160, "height": 120})
    one, other = Scene(settings), Scene(settings)
    forward = [one.frame(index) for index in (0, 40, 80)]
    backward = [other.frame(index) for index in (80, 40, 0)]
    for a, b in zip(forward, reversed(backward), strict=True):
        assert np.array_equal(a, b)
    assert one.truth(40) == other.truth(40)


def test_another_seed_gives_another_picture() -> None:
    frames = [
        Scene(SceneSettings(seed=seed, width=160, height=120, noise=0)).frame(60) for seed in (1, 2)
    ]
    assert not np.array_equal(frames[0], frames[1])


def test_frames_do_not_share_memory(crossing: Scene) -> None:
    crossing.frame(0)[:] = 0
    assert crossing.frame(0).mean() > 50


def test_noise_has_the_stated_deviation_and_changes_every_frame() -> None:
    clean = Scene(SceneSettings(name="empty", noise=0.0))
    noisy = Scene(SceneSettings(name="empty", noise=3.0))
    residues = [noisy.frame(i).astype(int) - clean.frame(i).astype(int) for i in (0, 1)]
    inner = [residue[200:400] for residue in residues]
    assert np.std(inner[0]) == pytest.approx(3.0, rel=0.05)
    assert abs(np.mean(inner[0])) < 0.05
    assert abs(np.corrcoef(inner[0].ravel(), inner[1].ravel())[0, 1]) < 0.02


def test_without_noise_only_people_and_their_shadows_change_the_picture(crossing: Scene) -> None:
    still = Scene(SceneSettings(name="empty", noise=0.0)).frame(0)
    assert np.array_equal(crossing.frame(0), still)
    index = crossing.frame_count // 2
    changed = np.any(crossing.frame(index) != still, axis=2)
    for row in crossing.truth(index):
        left, top, right, bottom = (round(value) for value in row.box_xyxy)
        assert changed[top:bottom, left:right].mean() > 0.3
    boxes = np.array([row.box_xyxy for row in crossing.truth(index)])
    assert not changed[: int(boxes[:, 1].min()) - 2].any()


@pytest.mark.parametrize("index", range(20, 500, 40))
def test_a_box_is_tight_around_its_person(demo: Scene, index: int) -> None:
    alone = [row for row in demo.truth(index) if row.visible_fraction > 0.999]
    picture = demo.frame(index).astype(int)
    empty = demo.frame(0).astype(int)
    # People at frame 0 are out of sight, so that the difference is people and shadows.
    strong = np.abs(picture - empty).max(axis=2) > 12
    for row in alone:
        left, top, right, bottom = row.box_xyxy
        middle = strong[round(top) : round(bottom), round(left) : round(right)]
        columns, lines = np.flatnonzero(middle.any(axis=0)), np.flatnonzero(middle.any(axis=1))
        assert columns[0] <= 3
        assert columns[-1] >= middle.shape[1] - 4
        assert lines[0] <= 3
        assert lines[-1] >= middle.shape[0] - 6


def test_the_demo_begins_and_ends_without_people(demo: Scene) -> None:
    assert demo.truth(0) == []
    assert demo.truth(demo.frame_count - 1) == []
    assert 15.0 <= demo.frame_count / demo.settings.fps <= 25.0


def test_the_demo_has_seven_people_of_a_size_that_can_be_tracked(demo: Scene) -> None:
    for person_id in range(1, 8):
        seen = rows(demo, person_id)
        heights = [row.box_xyxy[3] - row.box_xyxy[1] for row in seen.values()]
        assert len(seen) >= 20
        assert min(heights) > 60
    everybody = {row.person_id for _, found in sampled(demo) for row in found}
    assert everybody == set(range(1, 8))


def test_one_person_leaves_and_comes_back(demo: Scene) -> None:
    seen = sorted(rows(demo, 1))
    gaps = np.diff(seen)
    assert gaps.max() >= 25


def test_one_person_stands_still_for_seconds(demo: Scene) -> None:
    centres = [centre_x(row) for row in rows(demo, 3).values()]
    still = np.abs(np.diff(centres)) < 0.5
    longest = max(len(run) for run in "".join("s" if s else "m" for s in still).split("m"))
    assert longest * 5 / demo.settings.fps >= 4.0


def test_people_are_hidden_by_people_and_by_the_lamp_post(demo: Scene) -> None:
    fractions = [row.visible_fraction for _, found in sampled(demo) for row in found]
    assert min(fractions) < 0.3
    assert all(0.0 <= fraction <= 1.0 for fraction in fractions)


def test_the_two_of_the_crossing_change_sides_and_overlap(crossing: Scene) -> None:
    first, second = rows(crossing, 1), rows(crossing, 2)
    shared = sorted(first.keys() & second.keys())
    signs = [np.sign(centre_x(first[i]) - centre_x(second[i])) for i in shared]
    assert signs[0] == -1
    assert signs[-1] == 1
    meeting = next(i for i, sign in zip(shared, signs, strict=True) if sign == 1)
    hidden = [crossing.truth(i)[1].visible_fraction for i in range(meeting - 8, meeting + 8)]
    assert min(hidden) < 0.5


def test_the_empty_scene_is_empty() -> None:
    scene = Scene(SceneSettings(name="empty"))
    assert scene.truth(10) == []
    assert scene.frame_count == 100


def test_a_longer_scene_plays_the_next_pass_with_the_same_people(crossing: Scene) -> None:
    period_frames = crossing.period_s * crossing.settings.fps
    index = 80
    again = crossing.truth(index + round(period_frames))
    for row, later in zip(crossing.truth(index), again, strict=True):
        assert row.person_id == later.person_id
        assert row.box_xyxy == pytest.approx(later.box_xyxy, abs=6.0)


@pytest.mark.parametrize(("people", "expected"), [(0, 0), (3, 3), (12, 12)])
def test_the_number_of_people_can_be_chosen(people: int, expected: int) -> None:
    scene = Scene(SceneSettings(people=people, width=160, height=120, noise=0.0))
    seen = {row.person_id for i in range(0, scene.frame_count, 10) for row in scene.truth(i)}
    assert len(seen) == expected
